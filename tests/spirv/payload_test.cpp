// Payloads with ray flags before them: whose payload it is, what type shaders get that declare none, and hit objects.
#include "support.h"

#include "spirv/module/opcodes.h"
#include "spirv/payload_types.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace vellum::test
{
namespace
{

using Status = spirv::RewriteResult::Status;
using Way = spirv::HiddenFlags::Way;

spirv::RewriteResult rewriteAs(const Module &words, spv::ExecutionModel model, spirv::Decides decides,
                               const spirv::HiddenFlags &hidden, const char *entryPoint = "main")
{
    return spirv::rewrite(
        words, {.rootAddress = 0x1000,
                .pipelineStage = spirv::PipelineStage{entryPoint, static_cast<std::uint32_t>(model), decides, hidden}});
}

spirv::TypeWords payloadOf(const Module &words, spv::ExecutionModel model)
{
    spirv::PayloadTypes types;
    types.add(words, "main", static_cast<std::uint32_t>(model));
    return types.common();
}

// A closest-hit shader with a payload of type %payload, in `version`. The interface is that of 1.4 and later.
Module closestHit(const std::string &types, const std::string &capabilities = "", std::uint32_t version = 0x00010500)
{
    const bool interfaces = version >= 0x00010400;
    Module words = assemble("OpCapability RayTracingKHR\n" + capabilities + R"(
        OpExtension "SPV_KHR_ray_tracing"
        OpMemoryModel Logical GLSL450
        OpEntryPoint ClosestHitKHR %f "main")" +
                            (interfaces ? " %variable" : "") + R"(
%void = OpTypeVoid
%proc = OpTypeFunction %void
)" + types + R"(
%pp = OpTypePointer IncomingRayPayloadKHR %payload
%variable = OpVariable %pp IncomingRayPayloadKHR
%f = OpFunction %void None %proc
%l = OpLabel
     OpReturn
     OpFunctionEnd
)");
    words[1] = version;
    EXPECT_EQ(validate(words), "") << types;
    return words;
}

// The layer's own any-hit shader declares what the application's shaders of the same pipeline were made to declare.
TEST(Payloads, ShadersThatDeclareNoneGetTheSameAsTheOthers)
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
        const spirv::HiddenFlags hidden{Way::InPayload, 0, payloadOf(application, spv::ExecutionModelClosestHitKHR)};
        ASSERT_FALSE(hidden.payload.empty()) << c.types;
        const auto widened =
            rewriteAs(application, spv::ExecutionModelClosestHitKHR, spirv::Decides::Nothing, hidden).words;
        for (const char *variant : {"v15", "v14", "v16"}) {
            for (const auto decides : {spirv::Decides::TriangleHits, spirv::Decides::BoxHits}) {
                const auto own =
                    rewriteAs(loadShader("empty.rahit", variant), spv::ExecutionModelAnyHitKHR, decides, hidden).words;
                EXPECT_EQ(validate(own), "") << c.types << disassemble(own);
                const spirv::TypeWords type = payloadOf(own, spv::ExecutionModelAnyHitKHR);
                EXPECT_FALSE(type.empty());
                EXPECT_EQ(type, payloadOf(widened, spv::ExecutionModelClosestHitKHR)) << c.types << disassemble(own);
            }
        }
    }
}

TEST(Payloads, OfSeveralTypesOrOneThatMayChangeAreNotKnown)
{
    const auto model = static_cast<std::uint32_t>(spv::ExecutionModelClosestHitKHR);
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
    // Where it is not known, the prefix is alone.
    const auto own = rewriteAs(loadShader("empty.rahit", "v15"), spv::ExecutionModelAnyHitKHR,
                               spirv::Decides::TriangleHits, {Way::InPayload, 0});
    EXPECT_EQ(payloadOf(own.words, spv::ExecutionModelAnyHitKHR),
              (spirv::TypeWords{spv::OpTypeStruct, 1, spv::OpTypeInt, 32, 0}));
}

// Before SPIR-V 1.4 no interface has payloads: one that no code uses is the ray's all the same, if it is the only one.
TEST(Payloads, ThatNothingUsesAreFoundInOldModules)
{
    const Module words = closestHit("%payload = OpTypeFloat 32", "", 0x00010300);
    Module anyHit = words;
    const auto entry = std::ranges::find(anyHit, static_cast<std::uint32_t>(spv::ExecutionModelClosestHitKHR));
    *entry = spv::ExecutionModelAnyHitKHR;
    const auto result =
        rewriteAs(anyHit, spv::ExecutionModelAnyHitKHR, spirv::Decides::TriangleHits, {Way::InPayload, 0});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "");
    EXPECT_EQ(count(disassemble(result.words), "OpVariable %_ptr_IncomingRayPayload"), 1u) << disassemble(result.words);
}

// Of two, it is the one that the stage's code uses; a literal that happens to be equal to the other's id is no use.
TEST(Payloads, AreNotMistakenForLiterals)
{
    Module words = assemble(R"(
        OpCapability RayTracingKHR
        OpCapability PhysicalStorageBufferAddresses
        OpCapability Int64
        OpExtension "SPV_KHR_ray_tracing"
        OpMemoryModel PhysicalStorageBuffer64 GLSL450
        OpEntryPoint AnyHitKHR %f "main"
        OpEntryPoint ClosestHitKHR %g "other"
        OpName %64 "payloadOfOther"
        OpName %payload "payload"
        OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
%void = OpTypeVoid
%proc = OpTypeFunction %void
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
%f = OpFunction %void None %proc
%l = OpLabel
%b = OpConvertUToPtr %pb %address
%m = OpAccessChain %pu %b %zero
%v = OpLoad %uint %m Aligned 64
     OpStore %payload %v
     OpReturn
     OpFunctionEnd
%g = OpFunction %void None %proc
%k = OpLabel
%w = OpLoad %float %64
     OpReturn
     OpFunctionEnd
)");
    words[1] = 0x00010300;
    const auto result =
        rewriteAs(words, spv::ExecutionModelAnyHitKHR, spirv::Decides::TriangleHits, {Way::InPayload, 0});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "");
    const std::string text = disassemble(result.words);
    EXPECT_EQ(count(text, "_uint %payload %uint_"), 2u) << text;
    EXPECT_EQ(count(text, "%payloadOfOther %uint_0"), 0u) << text;
}

// A ray generation shader; `body` may use %object, a hit object, and `other` is that of a second entry point.
Module hitObjects(const std::string &body, const std::string &other = "")
{
    return assemble(R"(
        OpCapability RayTracingKHR
        OpCapability ShaderInvocationReorderNV
        OpExtension "SPV_KHR_ray_tracing"
        OpExtension "SPV_NV_shader_invocation_reorder"
        OpMemoryModel Logical GLSL450
        OpEntryPoint RayGenerationKHR %f "main" %scene %payload %object
        OpEntryPoint RayGenerationKHR %g "other" %scene %payload %object
        OpDecorate %scene DescriptorSet 0
        OpDecorate %scene Binding 0
%void = OpTypeVoid
%proc = OpTypeFunction %void
%uint = OpTypeInt 32 0
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
%zero = OpConstant %uint 0
%opaque = OpConstant %uint 1
%noOpaque = OpConstant %uint 2
%force = OpConstant %uint 1024
%number = OpConstant %float 1
%vector = OpConstantComposite %vec3 %number %number %number
%f = OpFunction %void None %proc
%l = OpLabel
%s = OpLoad %structure %scene
)" + body + R"(
     OpReturn
     OpFunctionEnd
%g = OpFunction %void None %proc
%k = OpLabel
%t = OpLoad %structure %scene
)" + other + R"(
     OpReturn
     OpFunctionEnd
)");
}

const char *const kTrace =
    "OpTraceRayKHR %s %opaque %zero %zero %zero %zero %vector %number %vector %number %payload\n";
const char *const kTraceObject =
    "OpHitObjectTraceRayNV %object %t %zero %zero %zero %zero %zero %vector %number %vector %number %payload\n";
const char *const kRecordMissNV = "OpHitObjectRecordMissNV %object %zero %vector %number %vector %number\n";

// The same with other opcodes, of the same number of words: assemblers are older than
// SPV_EXT_shader_invocation_reorder.
Module with(Module words, std::uint32_t opcode, std::uint32_t newer)
{
    for (std::size_t at = 5; at < words.size(); at += words[at] >> 16)
        if ((words[at] & 0xffff) == opcode)
            words[at] = (words[at] & 0xffff0000) | newer;
    return words;
}

// Hit objects have no room for flags, and what executes them would hand on a payload without. In code that the stage
// does not reach they do no harm.
TEST(Payloads, HitObjectsAreRefusedWhereTheStageReachesThem)
{
    const auto rewrite = [](const Module &words, Way way, const char *entryPoint) {
        return rewriteAs(words, spv::ExecutionModelRayGenerationKHR, spirv::Decides::Nothing, {way, 0}, entryPoint);
    };
    for (const char *use : {kTraceObject, kRecordMissNV, "OpHitObjectExecuteShaderNV %object %payload\n"}) {
        const Module words = hitObjects(kTrace, use);
        EXPECT_EQ(validate(words), "") << use;
        const auto reached = rewrite(words, Way::InPayload, "other");
        EXPECT_EQ(reached.status, Status::Failed) << use;
        EXPECT_NE(reached.error.find("hit objects"), std::string::npos) << reached.error;
        const auto apart = rewrite(words, Way::InPayload, "main");
        EXPECT_EQ(apart.status, Status::Rewritten) << use << apart.error;
        EXPECT_EQ(validate(apart.words), "") << disassemble(apart.words);
        for (const char *entryPoint : {"main", "other"})
            EXPECT_EQ(rewrite(words, Way::Carried, entryPoint).status, Status::Rewritten) << use;
    }
}

// What a hit object is told to have missed with are ray flags like those of a ray (OpHitObjectRecordMissEXT; stood for
// by one of the NV instructions of as many words that is not looked at).
TEST(Payloads, FlagsOfRecordedMissesAreHidden)
{
    const std::uint32_t getTMax = 5274; // OpHitObjectGetRayTMaxNV
    Module words = hitObjects(kTrace + std::string("%x = OpHitObjectGetRayTMaxNV %float %object\n"));
    // 8 words: the hit object, flags, miss index, origin, t_min, direction, t_max.
    for (std::size_t at = 5; at < words.size(); at += words[at] >> 16) {
        if ((words[at] & 0xffff) != getTMax)
            continue;
        const Module trace = words; // its operands
        std::size_t traced = 5;
        while ((trace[traced] & 0xffff) != spv::OpTraceRayKHR)
            traced += trace[traced] >> 16;
        Module miss{8u << 16 | spirv::kOpHitObjectRecordMissEXT, words[at + 3], 0, trace[traced + 4]};
        miss.insert(miss.end(), trace.begin() + static_cast<std::ptrdiff_t>(traced + 7),
                    trace.begin() + static_cast<std::ptrdiff_t>(traced + 11));
        words.erase(words.begin() + static_cast<std::ptrdiff_t>(at),
                    words.begin() + static_cast<std::ptrdiff_t>(at + (words[at] >> 16)));
        words.insert(words.begin() + static_cast<std::ptrdiff_t>(at), miss.begin(), miss.end());
        break;
    }
    const auto idOf = [&](std::uint32_t value) {
        for (std::size_t at = 5; at < words.size(); at += words[at] >> 16)
            if ((words[at] & 0xffff) == spv::OpConstant && words[at + 3] == value)
                return words[at + 2];
        return 0u;
    };
    const auto flagsOf = [](const Module &module) {
        for (std::size_t at = 5; at < module.size(); at += module[at] >> 16) {
            if ((module[at] & 0xffff) != spirv::kOpHitObjectRecordMissEXT)
                continue;
            for (std::size_t c = 5; c < module.size(); c += module[c] >> 16)
                if ((module[c] & 0xffff) == spv::OpConstant && module[c + 2] == module[at + 2])
                    return module[c + 3];
        }
        return ~0u;
    };
    const auto setFlags = [&](std::uint32_t value) {
        for (std::size_t at = 5; at < words.size(); at += words[at] >> 16)
            if ((words[at] & 0xffff) == spirv::kOpHitObjectRecordMissEXT)
                words[at + 2] = idOf(value);
    };
    setFlags(1); // Opaque, as the ray has
    EXPECT_EQ(spirv::tracedFlags(words).hidden, 1u);
    const auto model = spv::ExecutionModelRayGenerationKHR;
    EXPECT_EQ(flagsOf(rewriteAs(words, model, spirv::Decides::Nothing, {Way::Constant, 1}).words), 0u);
    EXPECT_EQ(flagsOf(rewriteAs(words, model, spirv::Decides::Nothing, {Way::Carried, 0}).words), 1u << 11);
    EXPECT_EQ(rewriteAs(words, model, spirv::Decides::Nothing, {Way::InPayload, 0}).status, Status::Failed);
    setFlags(2); // NoOpaque: not what the ray has
    EXPECT_TRUE(spirv::tracedFlags(words).traces);
    EXPECT_FALSE(spirv::tracedFlags(words).hidden);
    // In a pipeline without micromaps only the flag that the driver does not know is hidden.
    setFlags(1024);
    words.insert(words.begin() + 5, {2u << 16 | spv::OpCapability, spirv::kCapabilityOpacityMicromap});
    EXPECT_EQ(flagsOf(spirv::rewrite(words, {.pipelinesCarryFlagBits = [] { return false; }}).words), 0u);
    // Hits that are recorded without flags have none.
    const Module recorded = hitObjects(kTrace, kRecordMissNV);
    EXPECT_FALSE(spirv::tracedFlags(recorded).hidden);
    EXPECT_EQ(spirv::tracedFlags(hitObjects("", kRecordMissNV)).hidden, 0u);
    EXPECT_EQ(spirv::tracedFlags(with(hitObjects("", kRecordMissNV), spirv::kOpHitObjectRecordMissNV,
                                      spirv::kOpHitObjectRecordFromQueryEXT))
                  .hidden,
              std::nullopt);
}

} // namespace
} // namespace vellum::test
