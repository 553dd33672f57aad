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

// In a module of several stages it may be another's, of which a ray that meets this one knows nothing.
TEST(Payloads, OfOtherStagesAreNotTaken)
{
    const auto module = [](const std::string &store) {
        Module words = assemble(R"(
        OpCapability RayTracingKHR
        OpExtension "SPV_KHR_ray_tracing"
        OpMemoryModel Logical GLSL450
        OpEntryPoint AnyHitKHR %f "main"
        OpEntryPoint ClosestHitKHR %g "big"
        OpName %payload "payload"
%void = OpTypeVoid
%proc = OpTypeFunction %void
%uint = OpTypeInt 32 0
%many = OpConstant %uint 64
%array = OpTypeArray %uint %many
%pp = OpTypePointer IncomingRayPayloadKHR %array
%pu = OpTypePointer IncomingRayPayloadKHR %uint
%payload = OpVariable %pp IncomingRayPayloadKHR
%f = OpFunction %void None %proc
%l = OpLabel
     OpReturn
     OpFunctionEnd
%h = OpFunction %void None %proc
%m = OpLabel
)" + store + R"(
     OpReturn
     OpFunctionEnd
%g = OpFunction %void None %proc
%k = OpLabel
%n = OpFunctionCall %void %h
     OpReturn
     OpFunctionEnd
)");
        words[1] = 0x00010300;
        return words;
    };
    const auto incoming = [](const Module &words, const char *entryPoint, spv::ExecutionModel model) {
        spirv::PayloadTypes types;
        return types.add(words, entryPoint, static_cast<std::uint32_t>(model));
    };
    const spirv::TypeWords big{spv::OpTypeArray, 64, spv::OpTypeInt, 32, 0};
    const Module used = module("%p = OpAccessChain %pu %payload %many\nOpStore %p %many\n"), unused = module("");
    EXPECT_EQ(incoming(used, "main", spv::ExecutionModelAnyHitKHR), std::nullopt);
    EXPECT_EQ(incoming(used, "big", spv::ExecutionModelClosestHitKHR), big);
    EXPECT_EQ(incoming(unused, "main", spv::ExecutionModelAnyHitKHR), big);
    EXPECT_EQ(incoming({}, "main", spv::ExecutionModelAnyHitKHR), spirv::TypeWords{}); // nothing is known

    const auto rewritten = [&](const Module &words, const spirv::TypeWords &payload) {
        const auto result =
            rewriteAs(words, spv::ExecutionModelAnyHitKHR, spirv::Decides::TriangleHits, {Way::InPayload, 0, payload});
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

// A hit object gets the flags that the driver knows of its ray query: where none is hidden, they are the application's
// on any driver. `flags` are those of the query of "main", which makes the hit object; "other" has a query whose flags
// are computed and makes one if `both`.
Module fromQuery(const char *flags, const char *otherFlags, bool both)
{
    const auto body = [](const char *query, const char *structure, const std::string &of) {
        return std::string("OpRayQueryInitializeKHR ") + query + " " + structure + " " + of +
               " %zero %vector %number %vector %number\n";
    };
    const std::string record = "OpHitObjectRecordEmptyNV %object\n";
    std::string text = R"(
        OpCapability RayTracingKHR
        OpCapability RayQueryKHR
        OpCapability ShaderInvocationReorderNV
        OpExtension "SPV_KHR_ray_tracing"
        OpExtension "SPV_KHR_ray_query"
        OpExtension "SPV_NV_shader_invocation_reorder"
        OpMemoryModel Logical GLSL450
        OpEntryPoint RayGenerationKHR %f "main" %scene %object %query %computed
        OpEntryPoint RayGenerationKHR %g "other" %scene %object %query %computed
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
%hit = OpTypeHitObjectNV
%op = OpTypePointer Private %hit
%object = OpVariable %op Private
%rq = OpTypeRayQueryKHR
%qp = OpTypePointer Private %rq
%query = OpVariable %qp Private
%up = OpTypePointer Private %uint
%computed = OpVariable %up Private
%zero = OpConstant %uint 0
%opaque = OpConstant %uint 1
%skip = OpConstant %uint 256
%number = OpConstant %float 1
%vector = OpConstantComposite %vec3 %number %number %number
)";
    text += "%f = OpFunction %void None %proc\n%l = OpLabel\n%s = OpLoad %structure %scene\n" +
            body("%query", "%s", flags) + record + "OpReturn\nOpFunctionEnd\n";
    text += "%g = OpFunction %void None %proc\n%k = OpLabel\n%t = OpLoad %structure %scene\n" +
            std::string("%c = OpLoad %uint %computed\n") + body("%query", "%t", otherFlags) + (both ? record : "") +
            "OpReturn\nOpFunctionEnd\n";
    Module words = assemble(text);
    EXPECT_EQ(validate(words), "") << text;
    // OpHitObjectRecordEmptyNV %object, which nothing here looks at, stands for a longer one with the query behind it.
    const std::uint32_t recordEmpty = 5259;
    std::uint32_t query = 0;
    for (std::size_t at = 5; at < words.size(); at += words[at] >> 16) {
        if ((words[at] & 0xffff) == spv::OpRayQueryInitializeKHR)
            query = words[at + 1];
        if ((words[at] & 0xffff) != recordEmpty)
            continue;
        words[at] = 5u << 16 | spirv::kOpHitObjectRecordFromQueryEXT;
        words.insert(words.begin() + static_cast<std::ptrdiff_t>(at) + 2, {query, words[at + 1], words[at + 1]});
    }
    return words;
}

TEST(Payloads, HitObjectsOfQueriesWithoutHiddenFlagsPass)
{
    const auto rewrite = [](const Module &words, bool carries, const char *entryPoint) {
        spirv::RewriteOptions options{.rootAddress = 0x1000, .queriesCarryFlagBits = [carries] { return carries; }};
        if (entryPoint)
            options.pipelineStage = spirv::PipelineStage{
                entryPoint, spv::ExecutionModelRayGenerationKHR, spirv::Decides::Nothing, {Way::Constant, 0}};
        const auto result = spirv::rewrite(words, options);
        if (result.status == Status::Failed) {
            EXPECT_NE(result.error.find("hit object from a ray query"), std::string::npos) << result.error;
        }
        return result.status != Status::Failed;
    };
    const Module harmless = fromQuery("%skip", "%zero", true), hidden = fromQuery("%opaque", "%opaque", true),
                 mixed = fromQuery("%skip", "%opaque", true), computed = fromQuery("%skip", "%c", true),
                 apart = fromQuery("%skip", "%c", false);
    EXPECT_EQ(spirv::tracedFlags(harmless).hidden, 0u);
    for (const Module *words : {&hidden, &mixed, &computed, &apart}) {
        EXPECT_TRUE(spirv::tracedFlags(*words).traces);
        EXPECT_FALSE(spirv::tracedFlags(*words).hidden);
        EXPECT_TRUE(rewrite(*words, true, nullptr));
        EXPECT_FALSE(rewrite(*words, false, nullptr)); // of one of the entry points
        EXPECT_FALSE(rewrite(*words, false, "main"));
    }
    for (const char *entryPoint : {static_cast<const char *>(nullptr), "main", "other"})
        EXPECT_TRUE(rewrite(harmless, false, entryPoint));
    // What is wrong in what the stage does not reach does no harm.
    EXPECT_TRUE(rewrite(apart, false, "other"));
    EXPECT_FALSE(rewrite(computed, false, "other"));
}

} // namespace
} // namespace vellum::test
