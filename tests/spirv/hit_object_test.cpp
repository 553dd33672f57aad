// SPDX-License-Identifier: Apache-2.0
// Hit objects, and the variables with their hidden ray flags, for pipelines that pass flags in payloads.
#include "machine.h"
#include "support.h"

#include "spirv/module/numbers.h"

#include <gtest/gtest.h>

#include <map>

namespace vellum::test
{
namespace
{

using Status = spirv::RewriteResult::Status;
using Seen = std::vector<uint32_t>;

constexpr uint32_t kTraced = Machine::kTraced, kExecuted = Machine::kExecuted;

spirv::RewriteResult rewriteRayGeneration(const Module &words, const spirv::HiddenFlags &hidden,
                                          const char *entryPoint = "main")
{
    spirv::RewriteOptions options{.rootAddress = 0x1000,
                                  .pipelineStage = spirv::PipelineStage{entryPoint, spv::ExecutionModelRayGenerationKHR,
                                                                        spirv::Prologue::None, hidden}};
    return spirv::rewrite(words, options);
}

// A ray generation shader; `body` may use %object, a hit object, and `other` is that of a second entry point.
std::string moduleOf(const std::string &body, const std::string &other = "", const std::string &functions = "")
{
    return rayTracingText(R"(
        OpEntryPoint RayGenerationKHR %f "main" %scene %payload %object %objects %query %computed %attributes
        OpEntryPoint RayGenerationKHR %g "other" %scene %payload %object %objects %query %computed %attributes
        OpDecorate %scene DescriptorSet 0
        OpDecorate %scene Binding 0
)",
                          R"(
%uint = OpTypeInt 32 0
%int = OpTypeInt 32 1
%float = OpTypeFloat 32
%vec3 = OpTypeVector %float 3
%structure = OpTypeAccelerationStructureKHR
%sp = OpTypePointer UniformConstant %structure
%scene = OpVariable %sp UniformConstant
%pp = OpTypePointer RayPayloadKHR %uint
%payload = OpVariable %pp RayPayloadKHR
%hit = OpTypeHitObjectNV
%op = OpTypePointer Private %hit
%object = OpVariable %op Private
%local = OpTypePointer Function %hit
%two = OpConstant %uint 2
%array = OpTypeArray %hit %two
%ap = OpTypePointer Private %array
%objects = OpVariable %ap Private
%rq = OpTypeRayQueryKHR
%qp = OpTypePointer Private %rq
%query = OpVariable %qp Private
%up = OpTypePointer Private %uint
%computed = OpVariable %up Private
%atp = OpTypePointer HitObjectAttributeNV %float
%attributes = OpVariable %atp HitObjectAttributeNV
%taking = OpTypeFunction %void %op %local
%zero = OpConstant %uint 0
%opaque = OpConstant %uint 1
%noOpaque = OpConstant %uint 2
%skip = OpConstant %uint 256
%cull = OpConstant %int 128
%force = OpConstant %uint 1024
%number = OpConstant %float 1
%vector = OpConstantComposite %vec3 %number %number %number
)" + functionText("f", "%own = OpVariable %local Function\n%s = OpLoad %structure %scene\n" + body) +
                              functionText("g", "%t = OpLoad %structure %scene\n" + other) + functions,
                          R"(
        OpCapability RayTracingKHR
        OpCapability RayQueryKHR
        OpCapability ShaderInvocationReorderNV
        OpExtension "SPV_KHR_ray_query"
        OpExtension "SPV_NV_shader_invocation_reorder"
)");
}

Module hitObjects(const std::string &body, const std::string &other = "", const std::string &functions = "")
{
    const Module words = assemble(moduleOf(body, other, functions));
    EXPECT_EQ(validate(words), "") << body << other << functions;
    return words;
}

// The module with SPV_EXT_shader_invocation_reorder, which assemblers do not support yet. Instructions that the NV
// extension lacks are represented in the text by others with as many operands.
Module toExt(Module words)
{
    static const std::map<uint32_t, uint32_t> kExt{
        {spv::OpTypeHitObjectNV, spv::OpTypeHitObjectEXT},
        {spv::OpHitObjectTraceRayNV, spv::OpHitObjectTraceRayEXT},
        {spv::OpHitObjectTraceRayMotionNV, spv::OpHitObjectTraceRayMotionEXT},
        {spv::OpHitObjectExecuteShaderNV, spv::OpHitObjectExecuteShaderEXT},
        {spv::OpHitObjectRecordEmptyNV, spv::OpHitObjectRecordEmptyEXT},
        {5279, spv::OpHitObjectReorderExecuteShaderEXT},                     // OpReorderThreadWithHitObjectNV
        {spv::OpHitObjectRecordMissMotionNV, spv::OpHitObjectRecordMissEXT}, // object, flags, index, ...
        {spv::OpHitObjectRecordHitWithIndexNV, spv::OpHitObjectTraceReorderExecuteEXT},
        {5258, spv::OpHitObjectGetRayFlagsEXT},     // OpHitObjectGetShaderBindingTableRecordIndexNV
        {5294, spv::OpHitObjectRecordFromQueryEXT}, // OpEmitMeshTasksEXT
    };
    for (size_t at = 5; at < words.size(); at += words[at] >> 16)
        if (const auto ext = kExt.find(words[at] & 0xffff); ext != kExt.end())
            words[at] = (words[at] & 0xffff0000) | ext->second;
    return words;
}

Module extHitObjects(const std::string &body)
{
    return toExt(assemble(moduleOf(body)));
}

const std::string kAlong = " %zero %zero %zero %zero %vector %number %vector %number %payload\n";

std::string traceRay(const std::string &flags)
{
    return "OpTraceRayKHR %s " + flags + kAlong;
}

std::string traceObject(const std::string &flags, const std::string &object = "%object", const char *scene = "%s")
{
    return "OpHitObjectTraceRayNV " + object + " " + scene + " " + flags + kAlong;
}

std::string recordMissNV(const std::string &object = "%object")
{
    return "OpHitObjectRecordMissNV " + object + " %zero %vector %number %vector %number\n";
}

std::string executeNV(const std::string &object = "%object")
{
    return "OpHitObjectExecuteShaderNV " + object + " %payload\n";
}

// Instructions of the EXT extension, by their representation in the text.
std::string recordMissEXT(const std::string &flags)
{
    return "OpHitObjectRecordMissMotionNV %object " + flags + " %zero %vector %number %vector %number\n";
}
std::string traceReorderExecute(const std::string &flags)
{
    return "OpHitObjectRecordHitWithIndexNV %object %s " + flags + kAlong;
}
std::string initialize(const std::string &flags, const char *scene = "%s")
{
    return std::string("OpRayQueryInitializeKHR %query ") + scene + " " + flags +
           " %zero %vector %number %vector %number\n";
}
const std::string kReorderExecute = "OpReorderThreadWithHitObjectNV %object %payload\n";
const std::string kRecordFromQuery = "OpEmitMeshTasksEXT %object %query %zero %attributes\n";
// A ray with the flags that the application reads of the hit object.
const std::string kTraceWithItsFlags =
    "%flags = OpHitObjectGetShaderBindingTableRecordIndexNV %uint %object\n" + traceRay("%flags");

// Runs a ray generation shader of a pipeline that passes flags in payloads.
Seen run(const Module &words, const char *entryPoint = "main")
{
    const auto result = rewriteRayGeneration(words, {kNoneFixed, 0}, entryPoint);
    EXPECT_EQ(result.status, Status::Rewritten) << result.error;
    if (result.status != Status::Rewritten)
        return {};
    return Machine(result.words, {}).run(entryPoint);
}

// The shaders of a hit object find the hidden flags of its ray in the payload, whatever was traced since.
TEST(HitObjects, KeepTheHiddenFlagsOfTheirRay)
{
    const Module words = hitObjects(traceObject("%opaque") + traceRay("%cull") + executeNV() + recordMissNV("%own") +
                                    executeNV("%own") + executeNV());
    EXPECT_EQ(run(words), (Seen{1, kTraced, 128, kTraced, 1, kExecuted, 0, kExecuted, 1, kExecuted}));
    const auto result = rewriteRayGeneration(words, {kNoneFixed, 0});
    EXPECT_EQ(validate(result.words), "") << disassemble(result.words);
}

// Flags that the application computes are passed on.
TEST(HitObjects, KeepFlagsThatAreComputed)
{
    const Module words =
        hitObjects("OpStore %computed %opaque\n%c = OpLoad %uint %computed\n%d = OpBitwiseOr %uint %c %skip\n" +
                   traceObject("%d") + executeNV());
    EXPECT_EQ(run(words), (Seen{1, kTraced | 256, 1, kExecuted | 256}));
    const auto result = rewriteRayGeneration(words, {kNoneFixed, 0});
    EXPECT_EQ(validate(result.words), "") << disassemble(result.words);
}

TEST(HitObjects, FunctionsGetTheFlags)
{
    const Module words = hitObjects(
        traceObject("%opaque") + recordMissNV("%own") + "%called = OpFunctionCall %void %h %object %own\n", "", R"(
%h = OpFunction %void None %taking
%a = OpFunctionParameter %op
%b = OpFunctionParameter %local
%m = OpLabel
     OpHitObjectExecuteShaderNV %a %payload
     OpHitObjectExecuteShaderNV %b %payload
     OpReturn
     OpFunctionEnd
)");
    EXPECT_EQ(run(words), (Seen{1, kTraced, 1, kExecuted, 0, kExecuted}));
    const auto result = rewriteRayGeneration(words, {kNoneFixed, 0});
    EXPECT_EQ(validate(result.words), "") << disassemble(result.words);
}

TEST(HitObjects, ArraysHaveArraysOfFlags)
{
    const Module words =
        hitObjects("%one = OpAccessChain %op %objects %zero\n" + traceObject("%opaque", "%one") + executeNV("%one"));
    const auto result = rewriteRayGeneration(words, {kNoneFixed, 0});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "") << disassemble(result.words);
    EXPECT_EQ(count(disassemble(result.words), "OpTypeArray %uint %uint_2"), 1u) << disassemble(result.words);
}

TEST(HitObjects, ExtExtensionKeepsFlags)
{
    EXPECT_EQ(run(extHitObjects(traceObject("%force") + kReorderExecute + executeNV())),
              (Seen{1024, kTraced, 1024, kExecuted, 1024, kExecuted}));
    EXPECT_EQ(run(extHitObjects(recordMissEXT("%opaque") + executeNV())), (Seen{kTraced, 1, kExecuted}));
    EXPECT_EQ(run(extHitObjects(traceReorderExecute("%cull") + executeNV())), (Seen{128, kTraced, 128, kExecuted}));
    EXPECT_EQ(run(extHitObjects(traceObject("%opaque") + "OpHitObjectRecordEmptyNV %object\n" + kTraceWithItsFlags)),
              (Seen{1, kTraced, 0, kTraced}));
}

TEST(HitObjects, ShowTheFlagsOfTheirRay)
{
    for (const char *flags : {"%opaque", "%skip", "%noOpaque", "%force"}) {
        const Module words = extHitObjects(traceObject(flags) + kTraceWithItsFlags);
        const Seen seen = run(words);
        ASSERT_EQ(seen.size(), 4u) << flags;
        EXPECT_EQ(seen[2], seen[0]) << flags; // the hidden ones,
        EXPECT_EQ(seen[3], seen[1]) << flags; // and those that the driver knows
    }
}

// A hit object has the flags that the driver knows of the query that it is made from.
TEST(HitObjects, KeepTheFlagsOfTheirQuery)
{
    const struct {
        const char *flags;
        uint32_t hidden, driver;
    } cases[] = {{"%opaque", 1, 0}, {"%skip", 0, 256}, {"%zero", 0, 0}, {"%c", 1024, 2}};
    for (const auto &c : cases) {
        const std::string computed = "%e = OpBitwiseOr %uint %force %noOpaque\nOpStore %computed %e\n"
                                     "%c = OpLoad %uint %computed\n";
        const std::string made = computed + initialize(c.flags) + kRecordFromQuery;
        EXPECT_EQ(run(extHitObjects(made + executeNV())), (Seen{c.hidden, kExecuted | c.driver})) << c.flags;
        EXPECT_EQ(run(extHitObjects(made + kTraceWithItsFlags)), (Seen{c.hidden, kTraced | c.driver})) << c.flags;
        // Pipelines without micromaps are not rewritten for themselves. The application reads its flags nevertheless.
        const auto whole = spirv::rewrite(extHitObjects(made + kTraceWithItsFlags), {.rootAddress = 0x1000});
        ASSERT_EQ(whole.status, Status::Rewritten) << whole.error;
        EXPECT_EQ(Machine(whole.words, {}).run(), (Seen{kTraced | c.driver | c.hidden})) << c.flags;
    }
}

// Flags are hidden from the driver only for queries that consume micromaps.
TEST(HitObjects, QueriesWithoutMicromapsKeepDriverFlags)
{
    std::string text = moduleOf(initialize("%skip") + kRecordFromQuery + kTraceWithItsFlags,
                                initialize("%opaque", "%t") + kRecordFromQuery);
    text.replace(text.find("OpDecorate"), 0, "OpExecutionModeId %g SubgroupsPerWorkgroupId %yes\n");
    text.replace(text.find("%uint ="), 0, "%bool = OpTypeBool\n%yes = OpConstantTrue %bool\n");
    Module words = toExt(assemble(text));
    for (size_t at = 5; at < words.size(); at += words[at] >> 16)
        if ((words[at] & 0xffff) == spv::OpExecutionModeId)
            words[at + 2] = spv::ExecutionModeOpacityMicromapIdKHR;
    const auto result =
        spirv::rewrite(words, {.rootAddress = 0x1000, .queriesConsume = spirv::QueriesConsume::WhereDeclared});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(Machine(result.words, {}).run("main"), (Seen{kTraced | 256}));
}

// A copy of an object has no variable for its flags, nor has an object that is accessed in an unknown way. Code that
// the stage does not reach does not matter.
TEST(HitObjects, CopiesAreRejected)
{
    const std::string copy = "%copied = OpLoad %hit %object\nOpStore %own %copied\n" + executeNV("%own");
    const Module words = assemble(moduleOf(traceObject("%opaque") + copy, traceObject("%opaque", "%object", "%t")));
    const auto reached = rewriteRayGeneration(words, {kNoneFixed, 0}, "main");
    EXPECT_EQ(reached.status, Status::Failed);
    EXPECT_NE(reached.error.find("copies a hit object"), std::string::npos) << reached.error;
    EXPECT_EQ(rewriteRayGeneration(words, {kNoneFixed, 0}, "other").status, Status::Rewritten);
}

TEST(HitObjects, PassWhereFlagsAreConstant)
{
    for (const std::string &use : {traceObject("%opaque"), recordMissNV(), executeNV()})
        EXPECT_EQ(rewriteRayGeneration(hitObjects(use), {kAllFixed, 1}).status, Status::Rewritten) << use;
    const auto tracedFlags = [](const Module &words) { return spirv::scan(words).traced; };
    const spirv::TracedFlags opaque{.traces = true, .constant = 1}, none{.traces = true},
        differ{.traces = true, .fixed = kAllFixed & ~1u};
    EXPECT_EQ(tracedFlags(hitObjects(traceObject("%opaque") + executeNV())), opaque);
    // Hits that are recorded without flags have none.
    EXPECT_EQ(tracedFlags(hitObjects(recordMissNV())), none);
    EXPECT_EQ(tracedFlags(hitObjects(traceObject("%opaque") + recordMissNV())), differ);
    // An empty object has no ray.
    EXPECT_EQ(tracedFlags(hitObjects(traceObject("%opaque") + "OpHitObjectRecordEmptyNV %object\n")), opaque);
    // The ray flags of a recorded miss are like those of a ray.
    EXPECT_EQ(tracedFlags(extHitObjects(recordMissEXT("%opaque") + traceRay("%opaque"))), opaque);
    EXPECT_EQ(tracedFlags(extHitObjects(recordMissEXT("%noOpaque") + traceRay("%opaque"))), differ);
    const auto constant = rewriteRayGeneration(extHitObjects(recordMissEXT("%opaque")), {kAllFixed, 1});
    EXPECT_EQ(Machine(constant.words, {}).run(), (Seen{kTraced}));
    // An object that is recorded from a query has the query's flags, and the application can read them.
    EXPECT_EQ(tracedFlags(extHitObjects(initialize("%skip") + kRecordFromQuery)), none);
    const Module reads = extHitObjects(initialize("%opaque") + kRecordFromQuery +
                                       "%flags = OpHitObjectGetShaderBindingTableRecordIndexNV %uint %object\n"
                                       "%cell = OpAccessChain %up %computed\nOpStore %cell %flags\n");
    EXPECT_EQ(Machine(rewriteRayGeneration(reads, {kAllFixed, 1}).words, {}).run(), (Seen{1}));
    EXPECT_EQ(tracedFlags(extHitObjects(initialize("%opaque") + kRecordFromQuery)), opaque);
    const std::string computed = "%c = OpLoad %uint %computed\n";
    EXPECT_EQ(tracedFlags(extHitObjects(computed + initialize("%c") + kRecordFromQuery)),
              (spirv::TracedFlags{.traces = true, .fixed = 0}));
    // In a pipeline without micromaps, only the flag that the driver does not know is hidden.
    Module idle = extHitObjects(recordMissEXT("%force"));
    idle.insert(idle.begin() + 5, {2u << 16 | spv::OpCapability, spv::CapabilityRayTracingOpacityMicromapKHR});
    const auto result = spirv::rewrite(idle, {});
    EXPECT_EQ(Machine(result.words, {}).run(), (Seen{kTraced}));
}

} // namespace
} // namespace vellum::test
