// SPDX-License-Identifier: Apache-2.0
// Payloads with ray flags before them: whose payload it is, and what type shaders get that declare none.
#include "support.h"

#include "spirv/module/numbers.h"
#include "spirv/payload_types.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace vellum::test
{
namespace
{

using Status = spirv::RewriteResult::Status;

spirv::RewriteResult rewriteAs(const Module &words, uint32_t model, spirv::Prologue prologue,
                               const spirv::HiddenFlags &hidden, const char *entryPoint = "main")
{
    return spirv::rewrite(
        words, {.rootAddress = 0x1000,
                .pipelineStage = spirv::PipelineStage{entryPoint, static_cast<uint32_t>(model), prologue, hidden}});
}

spirv::TypeWords payloadOf(const Module &words, uint32_t model)
{
    spirv::PayloadTypes types;
    types.add(words, "main", static_cast<uint32_t>(model));
    return types.common();
}

// A closest-hit shader with a payload of type %payload, in `version`. The interface is that of 1.4 and later.
Module closestHit(const std::string &types, const std::string &capabilities = "", uint32_t version = 0x00010500)
{
    const bool interfaces = version >= 0x00010400;
    Module words = assemble(rayTracingText(
        std::string("OpEntryPoint ClosestHitKHR %f \"main\"") + (interfaces ? " %variable" : ""), types + R"(
%pp = OpTypePointer IncomingRayPayloadKHR %payload
%variable = OpVariable %pp IncomingRayPayloadKHR
)" + functionText("f"),
        "OpCapability RayTracingKHR\n" + capabilities));
    words[1] = version;
    EXPECT_EQ(validate(words), "") << types;
    return words;
}

// The layer's own any-hit shader declares what the application's shaders of the same pipeline were made to declare.
TEST(Payloads, GivesShadersWithoutOneTheSameTypeAsTheOthers)
{
    const struct {
        const char *types;
        const char *capabilities = "";
    } cases[] = {
        {"%payload = OpTypeFloat 32"},
        {"%payload = OpTypeBool"},
        {"%float = OpTypeFloat 32\n%payload = OpTypeVector %float 2"}, // there is one in the any-hit shader
        {"%u = OpTypeInt 32 0\n%n = OpConstant %u 3\n%half = OpTypeFloat 16\n%long = OpTypeInt 64 1\n"
         "%column = OpTypeVector %half 3\n%matrix = OpTypeMatrix %column 2\n%array = OpTypeArray %matrix %n\n"
         "%inner = OpTypeStruct %array %long\n%empty = OpTypeStruct\n%inners = OpTypeArray %inner %n\n"
         "%payload = OpTypeStruct %inners %empty %matrix",
         "OpCapability Float16\nOpCapability Int64"},
    };
    for (const auto &c : cases) {
        const Module application = closestHit(c.types, c.capabilities);
        const spirv::HiddenFlags hidden{kNoneFixed, 0, payloadOf(application, spv::ExecutionModelClosestHitKHR)};
        ASSERT_FALSE(hidden.payload.empty()) << c.types;
        const auto widened =
            rewriteAs(application, spv::ExecutionModelClosestHitKHR, spirv::Prologue::None, hidden).words;
        for (const char *variant : {"v15", "v14", "v16"}) {
            for (const auto prologue : {spirv::Prologue::TriangleHits, spirv::Prologue::BoxHits}) {
                const auto own =
                    rewriteAs(loadShader("empty.rahit", variant), spv::ExecutionModelAnyHitKHR, prologue, hidden).words;
                EXPECT_EQ(validate(own), "") << c.types << disassemble(own);
                const spirv::TypeWords type = payloadOf(own, spv::ExecutionModelAnyHitKHR);
                EXPECT_FALSE(type.empty());
                EXPECT_EQ(type, payloadOf(widened, spv::ExecutionModelClosestHitKHR)) << c.types << disassemble(own);
            }
        }
    }
}

TEST(Payloads, SeveralTypesOrSpecializedAreUnknown)
{
    const auto model = static_cast<uint32_t>(spv::ExecutionModelClosestHitKHR);
    const Module number = closestHit("%payload = OpTypeFloat 32");
    const Module whole = closestHit("%payload = OpTypeInt 32 0");
    spirv::PayloadTypes one, other;
    EXPECT_TRUE(one.common().empty());
    one.add(number, "main", model);
    one.add(loadShader("empty.rahit", "v15"), "main", spv::ExecutionModelAnyHitKHR); // declares none
    const spirv::TypeWords type = one.common();
    EXPECT_FALSE(type.empty());
    one.add(number, "main", model);
    one.add(whole, "other", model); // not of this entry point
    EXPECT_EQ(one.common(), type);
    other.add(whole, "main", model);
    spirv::PayloadTypes both = one;
    both.add(spirv::PayloadTypes());
    EXPECT_EQ(both.common(), type);
    both.add(other);
    EXPECT_TRUE(both.common().empty());
    both = other;
    both.add(number, "main", model);
    EXPECT_TRUE(both.common().empty());
    // Payloads of rays that a shader traces count as well: here there are two of different types.
    EXPECT_TRUE(payloadOf(loadShader("forward.rchit", "v15"), spv::ExecutionModelClosestHitKHR).empty());
    EXPECT_FALSE(payloadOf(loadShader("trace.rgen", "v15"), spv::ExecutionModelRayGenerationKHR).empty());

    EXPECT_TRUE(payloadOf({}, spv::ExecutionModelClosestHitKHR).empty());
    EXPECT_TRUE(payloadOf(closestHit("%u = OpTypeInt 32 0\n%n = OpSpecConstant %u 3\n%payload = OpTypeArray %u %n"),
                          spv::ExecutionModelClosestHitKHR)
                    .empty());
    // If the payload's type is unknown, the payload is the prefix alone.
    const auto own = rewriteAs(loadShader("empty.rahit", "v15"), spv::ExecutionModelAnyHitKHR,
                               spirv::Prologue::TriangleHits, {kNoneFixed, 0});
    EXPECT_EQ(payloadOf(own.words, spv::ExecutionModelAnyHitKHR),
              (spirv::TypeWords{spv::OpTypeStruct, 1, spv::OpTypeInt, 32, 0}));
}

// Before SPIR-V 1.4 no interface has payloads: an unused one is nevertheless the ray's, if it is the only one.
TEST(Payloads, FindsUnusedOnesBeforeSpirv14)
{
    const Module words = closestHit("%payload = OpTypeFloat 32", "", 0x00010300);
    Module anyHit = words;
    const auto entry = std::ranges::find(anyHit, static_cast<uint32_t>(spv::ExecutionModelClosestHitKHR));
    *entry = spv::ExecutionModelAnyHitKHR;
    const auto result = rewriteAs(anyHit, spv::ExecutionModelAnyHitKHR, spirv::Prologue::TriangleHits, {kNoneFixed, 0});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "");
    EXPECT_EQ(count(disassemble(result.words), "OpVariable %_ptr_IncomingRayPayload"), 1u) << disassemble(result.words);
}

// In a module of several stages the payload may belong to another stage, and then rays that reach this one do not have
// it.
TEST(Payloads, IgnoresThoseOfOtherStages)
{
    const auto module = [](const std::string &store) {
        Module words = assemble(rayTracingText(R"(
        OpEntryPoint AnyHitKHR %f "main"
        OpEntryPoint ClosestHitKHR %g "big"
        OpName %payload "payload"
)",
                                               R"(
%uint = OpTypeInt 32 0
%many = OpConstant %uint 64
%array = OpTypeArray %uint %many
%pp = OpTypePointer IncomingRayPayloadKHR %array
%pu = OpTypePointer IncomingRayPayloadKHR %uint
%payload = OpVariable %pp IncomingRayPayloadKHR
)" + functionText("f") + functionText("h", store) + functionText("g", "%n = OpFunctionCall %void %h")));
        words[1] = 0x00010300;
        return words;
    };
    const auto incoming = [](const Module &words, const char *entryPoint, uint32_t model) {
        spirv::PayloadTypes types;
        return types.add(words, entryPoint, static_cast<uint32_t>(model));
    };
    const spirv::TypeWords big{spv::OpTypeArray, 64, spv::OpTypeInt, 32, 0};
    const Module used = module("%p = OpAccessChain %pu %payload %many\nOpStore %p %many\n"), unused = module("");
    EXPECT_EQ(incoming(used, "main", spv::ExecutionModelAnyHitKHR), std::nullopt);
    EXPECT_EQ(incoming(used, "big", spv::ExecutionModelClosestHitKHR), big);
    EXPECT_EQ(incoming(unused, "main", spv::ExecutionModelAnyHitKHR), big);
    EXPECT_EQ(incoming({}, "main", spv::ExecutionModelAnyHitKHR), spirv::TypeWords{}); // nothing is known

    const auto rewritten = [&](const Module &words, const spirv::TypeWords &payload) {
        const auto result =
            rewriteAs(words, spv::ExecutionModelAnyHitKHR, spirv::Prologue::TriangleHits, {kNoneFixed, 0, payload});
        EXPECT_EQ(result.status, Status::Rewritten) << result.error;
        EXPECT_EQ(validate(result.words), "");
        return result.words;
    };
    const spirv::TypeWords number{spv::OpTypeFloat, 32};
    EXPECT_EQ(incoming(rewritten(used, number), "main", spv::ExecutionModelAnyHitKHR),
              (spirv::TypeWords{spv::OpTypeStruct, 2, spv::OpTypeInt, 32, 0, spv::OpTypeFloat, 32}));
    EXPECT_EQ(
        incoming(rewritten(unused, number), "main", spv::ExecutionModelAnyHitKHR),
        (spirv::TypeWords{spv::OpTypeStruct, 2, spv::OpTypeInt, 32, 0, spv::OpTypeArray, 64, spv::OpTypeInt, 32, 0}));
}

// Of two variables, the stage's payload is the one that its code uses; a literal that equals the id of the other is not
// a use.
TEST(Payloads, LiteralsAreNotUses)
{
    std::string module = rayTracingText(R"(
        OpEntryPoint AnyHitKHR %f "main"
        OpEntryPoint ClosestHitKHR %g "other"
        OpName %64 "payloadOfOther"
        OpName %payload "payload"
        OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
)",
                                        R"(
%uint = OpTypeInt 32 0
%long = OpTypeInt 64 0
%float = OpTypeFloat 32
%block = OpTypeStruct %uint
%pb = OpTypePointer PhysicalStorageBuffer %block
%pu = OpTypePointer PhysicalStorageBuffer %uint
%pp = OpTypePointer IncomingRayPayloadKHR %uint
%pf = OpTypePointer IncomingRayPayloadKHR %float
%address = OpConstant %long 4096
%zero = OpConstant %uint 0
%64 = OpVariable %pf IncomingRayPayloadKHR
%payload = OpVariable %pp IncomingRayPayloadKHR
)" + functionText("f", R"(
%b = OpConvertUToPtr %pb %address
%m = OpAccessChain %pu %b %zero
%v = OpLoad %uint %m Aligned 64
     OpStore %payload %v
)") + functionText("g", "%w = OpLoad %float %64"),
                                        R"(
        OpCapability RayTracingKHR
        OpCapability PhysicalStorageBufferAddresses
        OpCapability Int64
)");
    module.replace(module.find("Logical"), 7, "PhysicalStorageBuffer64");
    Module words = assemble(module);
    words[1] = 0x00010300;
    const auto result = rewriteAs(words, spv::ExecutionModelAnyHitKHR, spirv::Prologue::TriangleHits, {kNoneFixed, 0});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "");
    const std::string text = disassemble(result.words);
    EXPECT_EQ(count(text, "_uint %payload %uint_"), 2u) << text;
    EXPECT_EQ(count(text, "%payloadOfOther %uint_0"), 0u) << text;
}

} // namespace
} // namespace vellum::test
