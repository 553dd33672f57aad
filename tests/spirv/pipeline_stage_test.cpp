// SPDX-License-Identifier: Apache-2.0
// Stages of ray tracing pipelines that use micromaps.
#include "support.h"

#include "spirv/module/numbers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace vellum::test
{
namespace
{

using spirv::Prologue;
using Status = spirv::RewriteResult::Status;

struct Stage {
    const char *shader;
    uint32_t model;
    Prologue prologue;
};

spirv::RewriteOptions optionsOf(const Stage &stage)
{
    return {.rootAddress = 0x1000,
            .pipelineStage = spirv::PipelineStage{"main", static_cast<uint32_t>(stage.model), stage.prologue}};
}

std::string rewriteStage(const Stage &stage, const char *variant = "v15")
{
    const auto result = spirv::rewrite(loadShader(stage.shader, variant), optionsOf(stage));
    EXPECT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "") << stage.shader << ' ' << variant << '\n' << disassemble(result.words);
    EXPECT_EQ(validate(optimize(result.words)), "") << stage.shader << ' ' << variant;
    expectNoMoreNeeds(loadShader(stage.shader, variant), result.words);
    return disassemble(result.words);
}

constexpr Stage kTriangles{"any_hit.rahit", spv::ExecutionModelAnyHitKHR, Prologue::TriangleHits};
constexpr Stage kBoxes{"any_hit.rahit", spv::ExecutionModelAnyHitKHR, Prologue::BoxHits};
constexpr Stage kEither{"any_hit.rahit", spv::ExecutionModelAnyHitKHR, Prologue::EitherHits};
constexpr Stage kEmpty{"empty.rahit", spv::ExecutionModelAnyHitKHR, Prologue::TriangleHits};
constexpr Stage kCulling{"box.rint", spv::ExecutionModelIntersectionKHR, Prologue::BoxCulling};
constexpr Stage kTrace{"trace.rgen", spv::ExecutionModelRayGenerationKHR, Prologue::None};

TEST(PipelineStages, AreValidInEveryVersion)
{
    for (const char *variant : {"v15", "v14", "v16"})
        for (const Stage &stage :
             {kTriangles, kBoxes, kEither, kEmpty, kCulling, kTrace,
              Stage{"empty.rahit", spv::ExecutionModelAnyHitKHR, Prologue::BoxHits},
              Stage{"empty.rahit", spv::ExecutionModelAnyHitKHR, Prologue::EitherHits},
              Stage{"struct_attributes.rahit", spv::ExecutionModelAnyHitKHR, Prologue::EitherHits},
              Stage{"matrix_attributes.rahit", spv::ExecutionModelAnyHitKHR, Prologue::TriangleHits},
              Stage{"integer_attributes.rahit", spv::ExecutionModelAnyHitKHR, Prologue::TriangleHits},
              Stage{"struct_attributes.rahit", spv::ExecutionModelAnyHitKHR, Prologue::TriangleHits},
              Stage{"hit.rchit", spv::ExecutionModelClosestHitKHR, Prologue::None},
              Stage{"miss.rmiss", spv::ExecutionModelMissKHR, Prologue::None}})
            rewriteStage(stage, variant);
}

TEST(PipelineStages, TheLookupRunsBeforeAnyHitShadersOfTriangles)
{
    const std::string text = rewriteStage(kTriangles);
    EXPECT_EQ(count(text, "OpFunctionCall %uint %vellumResolve"), 1u);
    EXPECT_EQ(count(text, "OpFunctionCall %void %main"), 1u);
    EXPECT_EQ(count(text, "OpEntryPoint AnyHitNV %vellumEntry \"main\"") +
                  count(text, "OpEntryPoint AnyHitKHR %vellumEntry \"main\""),
              1u);
    EXPECT_EQ(count(text, "OpIgnoreIntersectionKHR"), 2u); // the application's, and the layer's
    // The application's variables are used, none is there twice.
    for (const char *builtIn : {"InstanceCustomIndex", "IncomingRayFlags", "PrimitiveId", "RayGeometryIndex"})
        EXPECT_EQ(count(text, std::string("BuiltIn ") + builtIn), 1u) << builtIn;
    EXPECT_EQ(count(text, "OpVariable %_ptr_HitAttributeNV") + count(text, "OpVariable %_ptr_HitAttributeKHR"), 1u);
}

// Unknown instructions may be next to the entry points.
TEST(PipelineStages, UnknownInstructionsOutsideTheEntryPointStay)
{
    const std::vector<uint32_t> unknown{3u << 16 | 0x7abc, 0x1234567, 0x89abcde};
    Module words = loadShader(kTriangles.shader, "v15");
    size_t at = 5;
    while ((words[at] & 0xffff) != spv::OpEntryPoint)
        at += words[at] >> 16;
    words.insert(words.begin() + static_cast<ptrdiff_t>(at), unknown.begin(), unknown.end());
    const auto result = spirv::rewrite(words, optionsOf(kTriangles));
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_FALSE(std::ranges::search(result.words, unknown).empty());
}

TEST(PipelineStages, MissingDeclarationsOfAnyHitShadersAreAdded)
{
    const std::string text = rewriteStage(kEmpty);
    EXPECT_EQ(count(text, "OpFunctionCall %uint %vellumResolve"), 1u);
    for (const char *builtIn : {"InstanceCustomIndex", "IncomingRayFlags", "PrimitiveId", "RayGeometryIndex"})
        EXPECT_EQ(count(text, std::string("BuiltIn ") + builtIn), 1u) << builtIn;
}

TEST(PipelineStages, BoxesAreNotLookedUp)
{
    EXPECT_EQ(count(rewriteStage(kBoxes), "vellumResolve"), 0u);
    const std::string text = rewriteStage(kCulling);
    EXPECT_EQ(count(text, "vellumResolve"), 0u);
    EXPECT_EQ(count(text, "OpFunctionCall %bool %vellumCullsBox"), 1u);
    EXPECT_EQ(count(text, "OpFunctionCall %void %main"), 1u);
}

// In a library, groups of triangles and of boxes may use the any-hit shader: the hit kind decides.
TEST(PipelineStages, EitherKindOfHit)
{
    const std::string text = rewriteStage(kEither);
    EXPECT_EQ(count(text, "OpFunctionCall %uint %vellumResolve"), 1u);
    EXPECT_EQ(count(text, "BuiltIn HitKind"), 1u);
    EXPECT_EQ(count(text, "OpFunctionCall %void %main"), 1u);
    EXPECT_EQ(count(text, "OpFunctionCall %uint %vellumCustomIndex"), 1u);
    // Attributes that no triangle has.
    const std::string boxes =
        rewriteStage({"short_attributes.rahit", spv::ExecutionModelAnyHitKHR, Prologue::EitherHits});
    EXPECT_EQ(count(boxes, "vellumResolve"), 0u);
    EXPECT_EQ(count(boxes, "OpFunctionCall %void %main"), 1u);
}

TEST(PipelineStages, RayFlagsAreHidden)
{
    const std::string text = rewriteStage(kTrace);
    // The run-time flags and the specialization constant, which may still change.
    EXPECT_EQ(count(text, "OpBitwiseXor %uint"), 2u);
    EXPECT_EQ(count(text, "%uint_4 %uint_255"), 1u); // Opaque | TerminateOnFirstHit
    EXPECT_EQ(count(text, "OpTraceRayKHR %"), 4u);
    EXPECT_EQ(count(text, "%uint_16 %uint_255"), 1u); // nothing to hide
}

// In pipelines without micromaps only the flag that the driver does not know is hidden, if the module can have it.
TEST(PipelineStages, HidesOnlyTheUnknownFlagWithoutMicromaps)
{
    std::vector<uint32_t> trace = loadShader("trace.rgen", "v15");
    EXPECT_EQ(spirv::rewrite(trace, {}).status, Status::Unchanged);
    trace.insert(trace.begin() + 5, {2u << 16 | spv::OpCapability, 5381u /* RayTracingOpacityMicromapEXT */});
    const auto hiding = spirv::rewrite(trace, {});
    ASSERT_EQ(hiding.status, Status::Rewritten);
    const std::string traced = disassemble(hiding.words);
    EXPECT_EQ(validate(hiding.words), "");
    EXPECT_EQ(count(traced, "OpBitwiseXor %uint"), 2u); // at run time, and specialized
    EXPECT_EQ(count(traced, "OpConstant %uint 1024"), 1u);
    EXPECT_EQ(count(traced, "OpConstant %uint 1153"), 0u);
    // Nobody has hidden anything from what an any-hit shader reads.
    const std::vector<uint32_t> anyHit = loadShader("any_hit.rahit", "v15");
    const auto result = spirv::rewrite(anyHit, {});
    ASSERT_EQ(result.status, Status::Rewritten);
    EXPECT_EQ(validate(result.words), "");
    const std::string text = disassemble(result.words);
    EXPECT_EQ(count(text, "OpFunctionCall %uint %vellumCustomIndex"), 1u);
    EXPECT_EQ(count(text, "OpBitwiseOr"), count(disassemble(anyHit), "OpBitwiseOr"));
}

std::string rewriteHiding(const Stage &stage, spirv::HiddenFlags hidden, const char *variant = "v15")
{
    spirv::RewriteOptions options = optionsOf(stage);
    options.pipelineStage->hidden = hidden;
    const auto result = spirv::rewrite(loadShader(stage.shader, variant), options);
    EXPECT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "") << stage.shader << ' ' << variant << '\n' << disassemble(result.words);
    EXPECT_EQ(validate(optimize(result.words)), "") << stage.shader << ' ' << variant;
    expectNoMoreNeeds(loadShader(stage.shader, variant), result.words);
    return disassemble(result.words);
}

const spirv::HiddenFlags kInPayload{.fixed = 0};

TEST(PipelineStages, AreValidInEveryVersionWithFlagsInPayloads)
{
    for (const char *variant : {"v15", "v14", "v16"}) {
        for (const Stage &stage : {kTriangles, kBoxes, kEither, kEmpty, kCulling, kTrace,
                                   Stage{"empty.rahit", spv::ExecutionModelAnyHitKHR, Prologue::BoxHits},
                                   Stage{"empty.rahit", spv::ExecutionModelAnyHitKHR, Prologue::EitherHits},
                                   Stage{"any_hit.rahit", spv::ExecutionModelAnyHitKHR, Prologue::None},
                                   Stage{"forward.rchit", spv::ExecutionModelClosestHitKHR, Prologue::None},
                                   Stage{"hit.rchit", spv::ExecutionModelClosestHitKHR, Prologue::None},
                                   Stage{"miss.rmiss", spv::ExecutionModelMissKHR, Prologue::None}}) {
            rewriteHiding(stage, kInPayload, variant);
            for (const uint32_t constant : {0u, 0x81u})
                rewriteHiding(stage, {kAllFixed, constant}, variant);
        }
    }
}

// Each ray's flags are stored in the payload before it is traced; a shader reads those of its own ray before it passes
// the payload on.
TEST(PipelineStages, FlagsTravelInPayloads)
{
    const std::string traced = rewriteHiding(kTrace, kInPayload);
    EXPECT_EQ(count(traced, "OpConstant %uint 1153"), 1u); // the three flags, of which those known at run time keep
    EXPECT_EQ(count(traced, "OpStore %"), count(disassemble(loadShader("trace.rgen", "v15")), "OpStore %") + 4);
    EXPECT_EQ(count(traced, "OpTraceRayKHR %"), 4u);
    const std::string hit = rewriteHiding(kTriangles, kInPayload);
    EXPECT_EQ(count(hit, "OpVariable %_ptr_IncomingRayPayload"), 1u); // the application's
    EXPECT_EQ(count(rewriteHiding(kEmpty, kInPayload), "OpVariable %_ptr_IncomingRayPayload"), 1u);
    // The incoming value in the payload is kept: the application reads it before and after its own trace.
    const std::string forward =
        rewriteHiding({"forward.rchit", spv::ExecutionModelClosestHitKHR, Prologue::None}, kInPayload);
    EXPECT_EQ(count(forward, "OpVariable %_ptr_Private_uint Private"), 1u);
    EXPECT_EQ(count(forward, "OpFunctionCall %void %main"), 1u);
    EXPECT_EQ(count(forward, "OpBitwiseOr %uint"), 2u);
    // A shader that reads no flags needs nothing before it.
    EXPECT_EQ(
        count(rewriteHiding({"miss.rmiss", spv::ExecutionModelMissKHR, Prologue::None}, kInPayload), "%vellumEntry"),
        0u);
}

TEST(PipelineStages, IntersectionShadersSeeNoPayload)
{
    spirv::RewriteOptions options = optionsOf(kCulling);
    const std::vector<uint32_t> words = loadShader("box.rint", "v15");
    EXPECT_FALSE(spirv::rewrite(words, options).lacksHiddenFlags);
    options.pipelineStage->hidden = kInPayload;
    const auto result = spirv::rewrite(words, options);
    EXPECT_TRUE(result.lacksHiddenFlags);
    EXPECT_EQ(count(disassemble(result.words), "vellumCullsBox"), 0u);
    options.pipelineStage->hidden = {kAllFixed, 0x80};
    const auto constant = spirv::rewrite(words, options);
    EXPECT_FALSE(constant.lacksHiddenFlags);
    EXPECT_EQ(count(disassemble(constant.words), "OpFunctionCall %bool %vellumCullsBox"), 1u);
    // A flag that all rays share is visible.
    options.pipelineStage->hidden = {0x80, 0x80};
    const auto mixed = spirv::rewrite(words, options);
    EXPECT_TRUE(mixed.lacksHiddenFlags);
    EXPECT_EQ(validate(mixed.words), "");
    EXPECT_EQ(count(disassemble(mixed.words), "OpFunctionCall %bool %vellumCullsBox"), 1u);
    EXPECT_EQ(count(disassemble(mixed.words), "%uint_128\n"), count(disassemble(constant.words), "%uint_128\n"));
}

TEST(PipelineStages, FlagsThatAllRaysHaveAlikeAreFixed)
{
    const auto of = [](uint32_t constant) { return spirv::TracedFlags{.traces = true, .constant = constant}; };
    spirv::TracedFlags all;
    all.add({});
    EXPECT_EQ(all, spirv::TracedFlags{});
    all.add(of(0x81));
    EXPECT_EQ(all, of(0x81));
    all.add(of(0x80));
    EXPECT_EQ(all, (spirv::TracedFlags{.traces = true, .fixed = kAllFixed & ~1u, .constant = 0x80}));
    all.add(of(0x81));
    EXPECT_EQ(all, (spirv::TracedFlags{.traces = true, .fixed = kAllFixed & ~1u, .constant = 0x80}));
    all.add({.traces = true, .fixed = 0x400, .constant = 0x400});
    EXPECT_EQ(all, (spirv::TracedFlags{.traces = true, .fixed = 0}));
}

// The distance between the hit records of an instance's geometries.
TEST(PipelineStages, TheGreatestStrideOfRaysIsKnown)
{
    std::vector<uint32_t> words = loadShader("constant_trace.rgen", "v15");
    EXPECT_EQ(spirv::scan(words).traced.mostStride, 0u);
    EXPECT_EQ(spirv::scan(loadShader("hit.rchit", "v15")).traced.mostStride, 0u);
    EXPECT_EQ(spirv::scan({}).traced.mostStride, 15u);
    size_t ray = 5;
    while ((words[ray] & 0xffff) != spv::OpTraceRayKHR)
        ray += words[ray] >> 16;
    words[ray + 5] = words[ray + 2]; // its flags, 0x85
    EXPECT_EQ(spirv::scan(words).traced.mostStride, 5u);
    words[ray + 5] = words[ray + 1]; // no constant
    EXPECT_EQ(spirv::scan(words).traced.mostStride, 15u);
}

TEST(PipelineStages, ConstantFlagsOfAllRaysAreKnown)
{
    const auto traced = spirv::scan(loadShader("trace.rgen", "v15")).traced;
    EXPECT_TRUE(traced.traces);
    EXPECT_EQ(traced.fixed, 0u);
    EXPECT_FALSE(spirv::scan(loadShader("hit.rchit", "v15")).traced.traces);
    const auto constant = spirv::scan(loadShader("constant_trace.rgen", "v15")).traced;
    EXPECT_TRUE(constant.traces);
    EXPECT_EQ(constant, (spirv::TracedFlags{.traces = true, .constant = 0x81}));
    // In a truncated module it is unknown, or the maximum of the part that is left.
    const std::vector<uint32_t> words = loadShader("constant_trace.rgen", "v15");
    for (size_t size = 0; size < words.size(); ++size) {
        const auto cut = spirv::scan(std::span(words).first(size)).traced;
        EXPECT_EQ(cut.constant & ~0x81u, 0u);
        EXPECT_EQ(~cut.fixed & cut.constant, 0u);
    }
    const std::string text =
        rewriteHiding({"constant_trace.rgen", spv::ExecutionModelRayGenerationKHR, Prologue::None}, {kAllFixed, 0x81});
    EXPECT_EQ(count(text, "OpTraceRayKHR %"), 2u);
    EXPECT_EQ(count(text, "%uint_4 %uint_255"), 1u);
    EXPECT_EQ(count(text, "%uint_16 %uint_255"), 1u);
}

TEST(PipelineStages, FailedRewritesStateTheReason)
{
    spirv::RewriteOptions options = optionsOf(kTriangles);
    options.pipelineStage->entryPoint = "other";
    auto result = spirv::rewrite(loadShader("any_hit.rahit", "v15"), options);
    EXPECT_EQ(result.status, Status::Failed);
    EXPECT_NE(result.error.find("\"other\""), std::string::npos) << result.error;

    options = optionsOf(kTriangles);
    result = spirv::rewrite(loadShader("trace.rgen", "v15"), options);
    EXPECT_EQ(result.status, Status::Failed); // "main" is there, but of another stage
    result = spirv::rewrite(loadShader("short_attributes.rahit", "v15"), options);
    EXPECT_EQ(result.status, Status::Failed);
    EXPECT_NE(result.error.find("hit attributes"), std::string::npos) << result.error;
}

// Two entry points that share a function and a built-in, and a copy of the built-in from memory to memory.
std::string twoEntryPoints()
{
    return rayTracingText(R"(
        OpEntryPoint AnyHitKHR %f "first" %index %index2 %payload
        OpEntryPoint ClosestHitKHR %f "second" %index %index2 %payload
        OpEntryPoint RayGenerationKHR %g "main"
        OpDecorate %index BuiltIn InstanceCustomIndexKHR
        OpDecorate %index2 BuiltIn IncomingRayFlagsKHR
)",
                          R"(
 %int = OpTypeInt 32 1
  %in = OpTypePointer Input %int
  %pp = OpTypePointer IncomingRayPayloadKHR %int
%index = OpVariable %in Input
%index2 = OpVariable %in Input
%payload = OpVariable %pp IncomingRayPayloadKHR
)" + functionText("f", R"(
        OpCopyMemory %payload %index Volatile
  %v = OpLoad %int %index2
        OpStore %payload %v
)") + functionText("g"));
}

TEST(PipelineStages, RemovesOtherEntryPoints)
{
    const Module words = assemble(twoEntryPoints());
    for (const auto &[name, model, prologue] :
         {std::tuple("first", spv::ExecutionModelAnyHitKHR, Prologue::TriangleHits),
          std::tuple("first", spv::ExecutionModelAnyHitKHR, Prologue::BoxHits),
          std::tuple("second", spv::ExecutionModelClosestHitKHR, Prologue::None)}) {
        const auto result = spirv::rewrite(
            words,
            {.rootAddress = 0x1000,
             .pipelineStage = spirv::PipelineStage{name, static_cast<uint32_t>(model), prologue, {kAllFixed, 0x80}}});
        ASSERT_EQ(result.status, Status::Rewritten) << result.error;
        EXPECT_EQ(validate(result.words), "") << disassemble(result.words);
        const std::string text = disassemble(result.words);
        EXPECT_EQ(count(text, "OpEntryPoint"), 1u);
        EXPECT_EQ(count(text, std::string("\"") + name + "\""), 1u);
        EXPECT_EQ(count(text, "OpCopyMemory"), 0u);
        // A prologue that looks the hit up also finds the custom index.
        const bool known = prologue == Prologue::TriangleHits;
        EXPECT_EQ(count(text, "OpFunctionCall %uint %vellumCustomIndex"), known ? 0u : 1u) << text;
        EXPECT_EQ(count(text, "OpStore %vellumKnownIndex"), known ? 1u : 0u) << text;
        EXPECT_EQ(count(text, "OpLoad %uint %vellumKnownIndex"), known ? 1u : 0u) << text;
        EXPECT_EQ(count(text, "Volatile"), 1u);
        EXPECT_GE(count(text, "%uint_128\n"), 1u); // of the flags that it reads
    }
}

// Decorations by groups count as others: built-ins are found, and members of structures keep theirs.
TEST(PipelineStages, ReadsDecorationGroups)
{
    std::string text = twoEntryPoints();
    const size_t first = text.find("OpDecorate %index "), end = text.find("%void =");
    text.replace(first, end - first, R"(
        OpName %group "group"
        OpDecorate %group BuiltIn InstanceCustomIndexKHR
        OpDecorate %group2 BuiltIn IncomingRayFlagsKHR
        OpDecorate %offset Offset 48
        OpDecorate %block Block
        OpDecorate %unused Block
  %group = OpDecorationGroup
 %group2 = OpDecorationGroup
 %offset = OpDecorationGroup
  %block = OpDecorationGroup
 %unused = OpDecorationGroup
        OpGroupDecorate %group %index
        OpGroupDecorate %group2 %index2
        OpGroupDecorate %block %struct %struct2
        OpGroupMemberDecorate %offset %struct 0 %struct2 0
)");
    text.insert(text.find("%index = OpVariable"), "%struct = OpTypeStruct %int\n%struct2 = OpTypeStruct %int\n");
    const auto result = spirv::rewrite(
        assemble(text),
        {.rootAddress = 0x1000,
         .pipelineStage = spirv::PipelineStage{
             "first", static_cast<uint32_t>(spv::ExecutionModelAnyHitKHR), Prologue::BoxHits, {kAllFixed, 0x80}}});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "") << disassemble(result.words);
    const std::string out = disassemble(result.words);
    EXPECT_EQ(count(out, "OpFunctionCall %uint %vellumCustomIndex"), 1u) << out;
    EXPECT_EQ(count(out, "BuiltIn IncomingRayFlags"), 1u) << out;
    EXPECT_EQ(count(out, "Offset 48"), 2u) << out;
    EXPECT_EQ(count(out, "Group"), 0u) << out;
}

// Instructions that compilers do not emit, in a module with one any-hit shader. `declarations` end the part before the
// types.
std::string anyHitText(const std::string &capability, const std::string &declarations, const std::string &body)
{
    return rayTracingText("OpEntryPoint AnyHitKHR %f \"main\" %index %payload\n" + declarations +
                              "OpDecorate %index BuiltIn InstanceCustomIndexKHR",
                          R"(
 %int = OpTypeInt 32 1
  %in = OpTypePointer Input %int
  %pp = OpTypePointer IncomingRayPayloadKHR %int
%index = OpVariable %in Input
%payload = OpVariable %pp IncomingRayPayloadKHR
)" + functionText("f", body),
                          "OpCapability " + capability + "\nOpExtension \"SPV_NV_shader_invocation_reorder\"");
}

TEST(PipelineStages, FindsBuiltInsThroughCopiedPointers)
{
    for (const char *copy : {"%p = OpAccessChain %in %index\n", "%p = OpInBoundsAccessChain %in %index\n",
                             "%p = OpCopyObject %in %index\n"}) {
        const Module words =
            assemble(anyHitText("RayTracingKHR", "", std::string(copy) + "%v = OpLoad %int %p\nOpStore %payload %v"));
        EXPECT_EQ(validate(words), "");
        const auto result = spirv::rewrite(words, optionsOf(kTriangles));
        ASSERT_EQ(result.status, Status::Rewritten) << result.error;
        EXPECT_EQ(count(disassemble(result.words), "OpLoad %uint %vellumKnownIndex"), 1u) << copy;
    }
}

TEST(PipelineStages, RecognizesThemByTheirEntryPoints)
{
    const Module words = assemble(anyHitText("ShaderInvocationReorderNV", "", ""));
    EXPECT_EQ(validate(words), "");
    EXPECT_TRUE(spirv::scan(words).tracesRays);
    const auto result = spirv::rewrite(words, optionsOf(kTriangles));
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(count(disassemble(result.words), "OpFunctionCall %uint %vellumResolve"), 1u);
}

// spirv-val rejects it; the rewriter must survive it.
TEST(PipelineStages, KeepsUnknownExecutionModes)
{
    const Module words =
        assemble(anyHitText("RayTracingKHR", "OpExecutionMode %f SignedZeroInfNanPreserve 32\nOpNop\n", ""));
    EXPECT_EQ(spirv::rewrite(words, optionsOf(kTriangles)).status, Status::Rewritten);
}

// Before SPIR-V 1.4, the interface does not list the attributes that an entry point uses.
TEST(PipelineStages, UseTheirOwnHitAttributes)
{
    Module words = assemble(rayTracingText(R"(
        OpEntryPoint AnyHitKHR %f "main"
        OpEntryPoint IntersectionKHR %g "box"
)",
                                           R"(
%float = OpTypeFloat 32
%vec2 = OpTypeVector %float 2
%vec4 = OpTypeVector %float 4
  %p2 = OpTypePointer HitAttributeKHR %vec2
  %p4 = OpTypePointer HitAttributeKHR %vec4
  %pp = OpTypePointer IncomingRayPayloadKHR %vec2
%payload = OpVariable %pp IncomingRayPayloadKHR
  %uv = OpVariable %p2 HitAttributeKHR
 %box = OpVariable %p4 HitAttributeKHR
%zero = OpConstantNull %vec4
)" + functionText("inner", "%v = OpLoad %vec2 %uv\nOpStore %payload %v") +
                                               functionText("f", "%c = OpFunctionCall %void %inner") +
                                               functionText("g", "OpStore %box %zero")));
    words[1] = 0x00010300;
    const auto result = spirv::rewrite(words, optionsOf(kTriangles));
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    const std::string text = disassemble(result.words);
    EXPECT_EQ(count(text, "OpLoad %v2float"), 2u) << text; // the application's and the layer's, of the same variable
}

// Types of hit attributes that would take for ever to walk through.
TEST(PipelineStages, RejectsHostileHitAttributes)
{
    std::string types = "%s0 = OpTypeStruct\n";
    for (int i = 1; i < 12; ++i) {
        const std::string member = " %s" + std::to_string(i - 1);
        types += "%s" + std::to_string(i) + " = OpTypeStruct";
        for (int m = 0; m < 64; ++m)
            types += member;
        types += "\n";
    }
    const Module words = assemble(rayTracingText("OpEntryPoint AnyHitKHR %f \"main\" %a", types + R"(
   %p = OpTypePointer HitAttributeKHR %s11
   %a = OpVariable %p HitAttributeKHR
)" + functionText("f")));
    EXPECT_EQ(spirv::rewrite(words, optionsOf(kTriangles)).status, Status::Failed);
}

} // namespace
} // namespace vellum::test
