// SPDX-License-Identifier: Apache-2.0
// Marks where a module traces rays.
#include "support.h"

#include "spirv/module/numbers.h"
#include "spirv/sites/trace_sites.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace vellum::test
{
namespace
{

using spirv::StageName;
using spirv::TraceSite;

constexpr uint64_t kAddress = 0x123400001000;

struct Shader {
    const char *name;
    uint32_t model;
    bool query;
    size_t sites;
};
class TraceSitesOf : public testing::TestWithParam<Shader>
{
};

TEST_P(TraceSitesOf, AreFoundAndMarked)
{
    const Shader &shader = GetParam();
    const StageName stage{"main", shader.model};
    for (const char *variant : {"v14", "v15", "v16", "debug"}) {
        const Module words = loadShader(shader.name, variant);
        const std::vector<TraceSite> sites = spirv::traceSites(words, stage);
        const TraceSite expected{shader.query, spirv::StructureBinding{0, 0, 0}, 0xff};
        EXPECT_EQ(sites, std::vector(shader.sites, expected)) << variant;
        std::vector<uint32_t> marks(sites.size(), 7);
        const Module marked = spirv::markTraces(words, stage, kAddress, marks);
        EXPECT_EQ(validate(marked), "") << variant;
        const auto calls = [](const Module &module) { return count(disassemble(module), "OpFunctionCall"); };
        EXPECT_EQ(calls(marked), calls(words) + sites.size()) << variant;
        // The rewriter takes what it is given by an application that is validated.
        EXPECT_EQ(spirv::rewrite(marked, {.rootAddress = 0x1000}).error, "") << variant;
        // The first site is not marked.
        marks[0] = UINT32_MAX;
        EXPECT_EQ(calls(spirv::markTraces(words, stage, kAddress, marks)), calls(words) + sites.size() - 1) << variant;
    }
}

INSTANTIATE_TEST_SUITE_P(Glsl, TraceSitesOf,
                         testing::Values(Shader{"while_loop.comp", spv::ExecutionModelGLCompute, true, 1},
                                         Shader{"nested.comp", spv::ExecutionModelGLCompute, true, 2},
                                         Shader{"in_if.comp", spv::ExecutionModelGLCompute, true, 1},
                                         Shader{"alpha.frag", spv::ExecutionModelFragment, true, 1},
                                         Shader{"trace.rgen", spv::ExecutionModelRayGenerationKHR, false, 4},
                                         Shader{"forward.rchit", spv::ExecutionModelClosestHitKHR, false, 3}),
                         [](const auto &shader) {
                             std::string name = shader.param.name;
                             std::replace(name.begin(), name.end(), '.', '_');
                             return name;
                         });

// Two entry points that trace rays, whose acceleration structures are in an array.
const char *const kArray = R"(
        OpCapability Shader
        OpCapability RayQueryKHR
        OpExtension "SPV_KHR_ray_query"
        OpMemoryModel Logical GLSL450
        OpEntryPoint GLCompute %f "one" %structures %query %index
        OpEntryPoint GLCompute %g "two" %structures %query %index
        OpExecutionMode %f LocalSize 1 1 1
        OpExecutionMode %g LocalSize 1 1 1
        OpDecorate %structures DescriptorSet 2
        OpDecorate %structures Binding 5
        OpDecorate %index BuiltIn LocalInvocationIndex
%void = OpTypeVoid
%proc = OpTypeFunction %void
%uint = OpTypeInt 32 0
%float = OpTypeFloat 32
%vec3 = OpTypeVector %float 3
%zero = OpConstant %uint 0
%one = OpConstant %uint 1
%four = OpConstant %uint 4
%wide = OpConstant %uint 0x1fe
%zf = OpConstant %float 0
%up = OpConstantComposite %vec3 %zf %zf %zf
%structure = OpTypeAccelerationStructureKHR
%array = OpTypeArray %structure %four
%ap = OpTypePointer UniformConstant %array
%sp = OpTypePointer UniformConstant %structure
%structures = OpVariable %ap UniformConstant
%rq = OpTypeRayQueryKHR
%qp = OpTypePointer Private %rq
%query = OpVariable %qp Private
%ip = OpTypePointer Input %uint
%index = OpVariable %ip Input
%f = OpFunction %void None %proc
%lf = OpLabel
%p1 = OpAccessChain %sp %structures %one
%s1 = OpLoad %structure %p1
OpRayQueryInitializeKHR %query %s1 %zero %wide %up %zf %up %zf
%i = OpLoad %uint %index
%p2 = OpAccessChain %sp %structures %i
%s2 = OpLoad %structure %p2
OpRayQueryInitializeKHR %query %s2 %zero %i %up %zf %up %zf
OpReturn
OpFunctionEnd
%g = OpFunction %void None %proc
%lg = OpLabel
%p3 = OpAccessChain %sp %structures %zero
%s3 = OpLoad %structure %p3
OpRayQueryInitializeKHR %query %s3 %zero %zero %up %zf %up %zf
OpReturn
OpFunctionEnd
)";

TEST(TraceSites, OnlyOfOneEntryPoint)
{
    const Module words = assemble(kArray);
    const auto site = [](std::optional<uint32_t> element, std::optional<uint32_t> cullMask) {
        return TraceSite{true, spirv::StructureBinding{2, 5, element}, cullMask};
    };
    const StageName one{"one", spv::ExecutionModelGLCompute};
    EXPECT_EQ(spirv::traceSites(words, one), (std::vector{site(1, 0xfe), site({}, {})}));
    EXPECT_EQ(spirv::traceSites(words, {"two", spv::ExecutionModelGLCompute}), std::vector{site(0, 0)});
    EXPECT_TRUE(spirv::traceSites(words, {"one", spv::ExecutionModelFragment}).empty());
    const std::vector<uint32_t> marks{3, 4};
    const Module marked = spirv::markTraces(words, one, kAddress, marks);
    EXPECT_EQ(validate(marked), "");
    EXPECT_EQ(count(disassemble(marked), "OpFunctionCall"), 2u);
}

// Copies of structures and of pointers to them are followed.
TEST(TraceSites, AreFoundThroughCopies)
{
    std::string text = kArray;
    text.replace(text.find("%s1 = OpLoad"), 4, "%c1 = OpLoad %structure %p1\n%s1 = OpCopyObject %structure %c1\n;");
    text.replace(text.find("%s3 = OpLoad %structure %p3"), 27,
                 "%c3 = OpCopyObject %sp %p3\n%s3 = OpLoad %structure %c3");
    const Module words = assemble(text);
    ASSERT_EQ(validate(words), "");
    const TraceSite first{true, spirv::StructureBinding{2, 5, 1}, 0xfe},
        third{true, spirv::StructureBinding{2, 5, 0}, 0};
    EXPECT_EQ(spirv::traceSites(words, {"one", spv::ExecutionModelGLCompute}).front(), first);
    EXPECT_EQ(spirv::traceSites(words, {"two", spv::ExecutionModelGLCompute}), std::vector{third});
}

// Ids that are copies of themselves, directly or through each other, end the search.
TEST(TraceSites, CopiesOfThemselves)
{
    const std::vector<TraceSite> unknown{{true, {}, 0}};
    for (const char *copies :
         {"%s3 = OpCopyObject %structure %s3", "%c3 = OpCopyObject %structure %s3\n%s3 = OpCopyObject %structure %c3",
          "%c3 = OpAccessChain %sp %c3\n%s3 = OpLoad %structure %c3",
          "%c3 = OpAccessChain %sp %c3 %zero\n%s3 = OpLoad %structure %c3", "%s3 = OpPhi %structure %s3 %lg"}) {
        std::string text = kArray;
        text.replace(text.find("%s3 = OpLoad %structure %p3"), 27, copies);
        EXPECT_EQ(spirv::traceSites(assemble(text), {"two", spv::ExecutionModelGLCompute}), unknown) << copies;
    }
}

TEST(TraceSites, MalformedModulesHaveNone)
{
    Module words = assemble(kArray);
    words.pop_back();
    const StageName one{"one", spv::ExecutionModelGLCompute};
    EXPECT_TRUE(spirv::traceSites(words, one).empty());
    EXPECT_TRUE(spirv::markTraces(words, one, kAddress, {}).empty());
}

} // namespace
} // namespace vellum::test
