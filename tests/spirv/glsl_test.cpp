// SPDX-License-Identifier: Apache-2.0
// Shaders as compilers make them.
#include "support.h"

#include <gtest/gtest.h>

#include <ostream>

namespace vellum::test
{
namespace
{

using Status = spirv::RewriteResult::Status;

struct Case {
    const char *shader;
    size_t flat, inner; // proceed calls as glslang compiles them
    size_t optimizedFlat, optimizedInner;
};

void PrintTo(const Case &c, std::ostream *out)
{
    *out << c.shader;
}

const Case kCases[] = {
    {"while_loop.comp", 1, 0, 1, 0},     {"empty_loop.comp", 1, 0, 1, 0},   {"nested.comp", 2, 0, 2, 0},
    {"once.comp", 0, 1, 0, 1},           {"in_if.comp", 0, 1, 0, 1},        {"for_loop.comp", 0, 1, 1, 0},
    {"do_while.comp", 0, 1, 0, 1},       {"break_out.comp", 0, 1, 0, 1},    {"with_condition.comp", 0, 1, 0, 1},
    {"array.comp", 2, 2, 2, 2},          {"parameter.comp", 1, 1, 1, 1},    {"flags.comp", 1, 0, 1, 0},
    {"constant_flags.comp", 1, 1, 1, 1}, {"opaque_boxes.comp", 1, 0, 1, 0}, {"specialized.comp", 1, 0, 1, 0},
    {"addresses.comp", 1, 0, 1, 0},      {"alpha.frag", 1, 0, 1, 0},        {"kept_flags.comp", 1, 2, 2, 2},
};

class Glsl : public testing::TestWithParam<std::tuple<Case, const char *>>
{
};

TEST_P(Glsl, ExpectedForms)
{
    const auto &[c, variant] = GetParam();
    const Module words = loadShader(c.shader, variant);
    if (std::string(variant) == "debug" && !validate(words).empty())
        return; // glslang 12 makes invalid debug information of some of them
    const Forms plain = formsOf(rewriteValid(words));
    EXPECT_EQ(plain.flatCalls, c.flat);
    EXPECT_EQ(plain.innerCalls, c.inner);
}

// Without the debug variant: spirv-opt of 2023 rejects debug information of glslang 12.
class OptimizedGlsl : public Glsl
{
};

TEST_P(OptimizedGlsl, IsRewrittenAfterOptimization)
{
    const auto &[c, variant] = GetParam();
    const Module words = optimize(loadShader(c.shader, variant));
    const Forms forms = formsOf(rewriteValid(words));
    EXPECT_EQ(forms.flatCalls, c.optimizedFlat) << disassemble(words);
    EXPECT_EQ(forms.innerCalls, c.optimizedInner) << disassemble(words);
}

TEST_P(OptimizedGlsl, StaysValidWhenTheDriverOptimizes)
{
    const auto &[c, variant] = GetParam();
    if (std::string(c.shader) == "do_while.comp")
        return; // spirv-opt of 2023 inlines a function with a loop into a continue construct
    EXPECT_EQ(validate(optimize(rewriteValid(loadShader(c.shader, variant)))), "");
}

std::string caseName(const testing::TestParamInfo<Glsl::ParamType> &test)
{
    std::string name = std::get<0>(test.param).shader;
    name[name.find('.')] = '_';
    return name + "_" + std::get<1>(test.param);
}

INSTANTIATE_TEST_SUITE_P(All, Glsl,
                         testing::Combine(testing::ValuesIn(kCases), testing::Values("v15", "v14", "v16", "debug")),
                         caseName);
INSTANTIATE_TEST_SUITE_P(All, OptimizedGlsl,
                         testing::Combine(testing::ValuesIn(kCases), testing::Values("v15", "v14", "v16")), caseName);

TEST(Modules, ModulesWithoutTracesAreUnchanged)
{
    const Module words = loadShader("plain.comp", "v15");
    EXPECT_FALSE(spirv::scan(words).tracesRays);
    const auto result = spirv::rewrite(words, {});
    EXPECT_EQ(result.status, Status::Unchanged);
    EXPECT_TRUE(result.words.empty());
}

TEST(Modules, KeepsThoseThatNeedNoRewriting)
{
    const Module words = loadShader("miss.rmiss", "v15");
    EXPECT_TRUE(spirv::scan(words).tracesRays);
    EXPECT_EQ(spirv::rewrite(words, {}).status, Status::Unchanged);
}

TEST(Modules, RayTracingStagesReadTheirCustomIndex)
{
    for (const char *variant : {"v15", "v14", "v16", "debug"}) {
        const std::string text = disassemble(rewriteValid(loadShader("hit.rchit", variant)));
        EXPECT_EQ(count(text, "OpFunctionCall %uint %vellumCustomIndex"), 1u);
        EXPECT_EQ(count(text, "vellumResolve"), 0u); // nothing that is not needed
    }
}

TEST(Modules, CarryTheRootAddress)
{
    const std::string text = disassemble(rewriteValid(loadShader("while_loop.comp", "v15")));
    EXPECT_EQ(count(text, "OpConstant %uint 1985229328"), 1u); // 0x76543210
    EXPECT_EQ(count(text, "OpConstant %uint 4275878552"), 1u); // 0xfedcba98
    EXPECT_EQ(count(text, "OpSpecConstant"), 0u);
    EXPECT_EQ(count(text, "PhysicalStorageBuffer64"), 1u);
    EXPECT_EQ(count(text, "SPV_KHR_physical_storage_buffer"), 0u);
    const std::string old = disassemble(rewriteValid(loadShader("while_loop.comp", "v14")));
    EXPECT_EQ(count(old, "\"SPV_KHR_physical_storage_buffer\""), 1u);
}

// Vulkan 1.1 has SPIR-V 1.3, which ray queries do not need more than.
TEST(Modules, Spirv13StaysUnchanged)
{
    std::string text = moduleText("%p = OpRayQueryProceedKHR %bool %q\n");
    const std::string interface = "\"main\" %scene %out";
    ASSERT_NE(text.find(interface), std::string::npos);
    text.replace(text.find(interface), interface.size(), "\"main\""); // neither input nor output
    Module words = assemble(text);
    words[1] = 0x10300;
    const std::string rewritten = disassemble(rewriteValid(words));
    EXPECT_EQ(count(rewritten, "\"SPV_KHR_physical_storage_buffer\""), 1u);
}

TEST(Flags, ConstantFlagsAreRemovedAndRestored)
{
    const std::string text = disassemble(rewriteValid(loadShader("constant_flags.comp", "v15")));
    EXPECT_EQ(count(text, " %uint_4 %uint_255"), 1u) << text;
    EXPECT_EQ(count(text, " %uint_16 %uint_255"), 1u) << text;
    EXPECT_GE(count(text, "OpBitwiseOr %uint %"), 1u);
    EXPECT_GE(count(text, "%uint_1152"), 2u);
}

TEST(Flags, OpaqueMakesBoxesOpaque)
{
    const std::string text = disassemble(rewriteValid(loadShader("opaque_boxes.comp", "v15")));
    EXPECT_EQ(count(text, "OpLogicalOr %bool"), 1u);
    EXPECT_EQ(count(text, "%true\n"), 1u) << text;
}

// The index of a candidate is unknown if a function advances the query, and that of a committed hit if the driver
// decided it without a lookup.
TEST(Modules, KeepTheCustomIndexOfACandidateThatTheyDecide)
{
    for (const char *variant : {"v15", "v14", "v16"}) {
        const std::string text = disassemble(rewriteValid(loadShader("candidate_index.comp", variant)));
        EXPECT_EQ(count(text, "OpFunctionCall %uint %vellumCustomIndex"), 2u);
        EXPECT_EQ(count(text, "OpFunctionCall %uint %vellumIndexOf"), 2u);
    }
    // Queries that do not consume micromaps have no candidates that are decided.
    spirv::RewriteOptions options;
    options.queriesConsume = spirv::QueriesConsume::WhereDeclared;
    const auto idle = spirv::rewrite(loadShader("candidate_index.comp", "v15"), options);
    EXPECT_EQ(count(disassemble(idle.words), "OpFunctionCall %uint %vellumCustomIndex"), 4u);
    EXPECT_EQ(count(disassemble(idle.words), "vellumIndexOf"), 0u);
}

// Ray flags that are not constant are kept in a variable and hidden from the driver.
TEST(GlslFlags, InASideVariable)
{
    for (const char *variant : {"v15", "v14", "v16"}) {
        for (const char *shader : {"flags.comp", "specialized.comp", "kept_flags.comp"}) {
            const Module words = rewriteValid(loadShader(shader, variant));
            EXPECT_EQ(validate(optimize(words)), "") << shader << ' ' << variant;
            const std::string text = disassemble(words);
            EXPECT_EQ(count(text, "OpRayQueryGetRayFlagsKHR"), 0u) << shader;
            EXPECT_EQ(count(text, "OpConstant %uint 1153"), 1u) << shader; // the three flags
        }
    }
    // The flags, and the candidate's custom index.
    EXPECT_EQ(
        count(disassemble(rewriteValid(loadShader("flags.comp", "v15"))), "OpVariable %_ptr_Private_uint Private"), 2u);
}

// constant_flags.comp passes the same constants everywhere: nothing has to be kept.
TEST(GlslFlags, LieNowhereWhereTheyAreConstant)
{
    for (const char *shader : {"while_loop.comp", "constant_flags.comp", "opaque_boxes.comp"}) {
        const Module words = loadShader(shader, "v15");
        const Module kept = spirv::rewrite(words, {.constantQueryFlags = false}).words;
        EXPECT_LT(count(disassemble(rewriteValid(words)), "OpVariable"), count(disassemble(kept), "OpVariable"));
    }
}

// Drivers compile the linked functions faster without the variables that glslang makes of their constants.
TEST(GlslLinked, HaveFewVariables)
{
    const std::string text = disassemble(rewriteValid(loadShader("while_loop.comp", "v15")));
    EXPECT_LE(count(text, "OpVariable %_ptr_Function_"), 12u); // 43 with them
}

} // namespace
} // namespace vellum::test
