// SPDX-License-Identifier: Apache-2.0
// The execution mode OpacityMicromapIdKHR: which ray queries consume micromaps where only VK_KHR_opacity_micromap is
// enabled. Modules are run before and after the rewrite. SPIR-V Tools that know the mode are not needed: assembly has
// it as numbers.
#include "machine.h"
#include "support.h"

#include "spirv/module/numbers.h"

#include <gtest/gtest.h>
#include <spirv-tools/optimizer.hpp>

#include <random>

namespace vellum::test
{
namespace
{

using spirv::QueriesConsume;
using Status = spirv::RewriteResult::Status;
using Seen = std::vector<uint32_t>;

const spirv::RewriteOptions kWhereDeclared{.rootAddress = 0xfedcba9876543210,
                                           .queriesConsume = QueriesConsume::WhereDeclared};

// The 1st and 3rd candidate are decided where micromaps are consumed.
const std::vector<Candidate> kScript{{1, true}, {2, false}, {3, true}, {4, false}};
const Seen kAll{1, 2, 3, 4}, kUndecided{2, 4};

// %trace stores the name of every candidate that the application sees.
const char *const kTraceFunction = R"(
  %trace = OpFunction %void None %fun
  %param = OpFunctionParameter %ptr_query
  %start = OpLabel
    %res = OpAccessChain %ptr_uint %out %i0
           OpBranch %h
      %h = OpLabel
           OpLoopMerge %m %c None
           OpBranch %k
      %k = OpLabel
      %r = OpRayQueryProceedKHR %bool %param
           OpBranchConditional %r %seen %m
   %seen = OpLabel
      %n = OpRayQueryGetIntersectionPrimitiveIndexKHR %uint %param %i0
           OpStore %res %n
           OpBranch %c
      %c = OpLabel
           OpBranch %h
      %m = OpLabel
           OpReturn
           OpFunctionEnd
)";

// Declarations of an entry point: nothing, or an id of kConstants.
const char *const kConstants = R"(
    %fun = OpTypeFunction %void %ptr_query
   %null = OpConstantNull %bool
   %spec = OpSpecConstantFalse %bool
  %spec1 = OpSpecConstantTrue %bool
 %number = OpSpecConstant %uint 3
   %same = OpSpecConstantOp %bool IEqual %number %u2
    %not = OpSpecConstantOp %bool LogicalNot %spec
)";

void put(std::string &text, const std::string &before, const std::string &what)
{
    text.insert(text.find(before), what);
}

std::string withDeclarations(std::string text)
{
    put(text, "OpExtension", "OpCapability !6032\nOpExtension \"SPV_KHR_opacity_micromap\"\n");
    put(text, "%void = OpTypeVoid", R"(
    OpDecorate %spec SpecId 7
    OpDecorate %spec1 SpecId 8
    OpDecorate %number SpecId 9
)");
    return text;
}

std::string modeText(const std::string &entry, const std::string &operand)
{
    return operand.empty() ? "" : "OpExecutionModeId %" + entry + " !6031 " + operand + "\n";
}

std::string oneEntry(const std::string &operand, const std::string &globals = "", const std::string &body = "")
{
    std::string text = withDeclarations(
        moduleText(body + "%call = OpFunctionCall %void %trace %q\n", kConstants + globals, kTraceFunction));
    put(text, "OpName", modeText("main", operand));
    return text;
}

// "main" and "other" share %trace.
std::string twoEntries(const std::string &main, const std::string &other)
{
    std::string text = oneEntry(main);
    put(text, "OpExecutionMode ", R"(OpEntryPoint GLCompute %other "other" %scene %out
)");
    put(text, "OpName", "OpExecutionMode %other LocalSize 1 1 1\n" + modeText("other", other));
    return text + R"(
  %other = OpFunction %void None %voidfun
 %other1 = OpLabel
     %q2 = OpVariable %ptr_query Function
    %as2 = OpLoad %Scene %scene
           OpRayQueryInitializeKHR %q2 %as2 %u0 %mask %zero %f0 %one %f1
  %call2 = OpFunctionCall %void %trace %q2
           OpReturn
           OpFunctionEnd
)";
}

spirv::RewriteResult rewriteText(const std::string &text, const spirv::RewriteOptions &options = kWhereDeclared)
{
    const auto result = spirv::rewrite(assemble(text), options);
    EXPECT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "") << disassemble(result.words);
    EXPECT_EQ(count(disassemble(result.words), "icromap"), 0u);
    return result;
}

Seen runText(const std::string &text, const std::map<uint32_t, uint32_t> &specialization = {},
             const std::string &entry = "main", const spirv::RewriteOptions &options = kWhereDeclared)
{
    return Machine(rewriteText(text, options).words, kScript, specialization).run(entry);
}

TEST(ExecutionMode, ConstantOperands)
{
    EXPECT_EQ(runText(oneEntry("%true")), kUndecided);
    EXPECT_EQ(runText(oneEntry("%false")), kAll);
    EXPECT_EQ(runText(oneEntry("%null")), kAll);
    EXPECT_EQ(runText(oneEntry("")), kAll);
}

TEST(ExecutionMode, SpecializationConstants)
{
    EXPECT_EQ(runText(oneEntry("%spec")), kAll);
    EXPECT_EQ(runText(oneEntry("%spec"), {{7, 1}}), kUndecided);
    EXPECT_EQ(runText(oneEntry("%spec1")), kUndecided);
    EXPECT_EQ(runText(oneEntry("%spec1"), {{8, 0}}), kAll);
    EXPECT_EQ(runText(oneEntry("%spec1"), {{7, 0}}), kUndecided); // another constant's
    EXPECT_EQ(runText(oneEntry("%same")), kAll);
    EXPECT_EQ(runText(oneEntry("%same"), {{9, 2}}), kUndecided);
    EXPECT_EQ(runText(oneEntry("%not")), kUndecided);
    EXPECT_EQ(runText(oneEntry("%not"), {{7, 1}}), kAll);
}

// The other form, with a loop inside vellumProceed.
TEST(ExecutionMode, ProceedCallsWithoutALoop)
{
    const std::string body = R"(
      %p = OpRayQueryProceedKHR %bool %q
     %n1 = OpRayQueryGetIntersectionPrimitiveIndexKHR %uint %q %i0
           OpStore %result %n1
)";
    EXPECT_EQ(runText(oneEntry("%spec", "", body)), kAll);
    EXPECT_EQ(runText(oneEntry("%spec", "", body), {{7, 1}}), kUndecided);
    EXPECT_EQ(runText(oneEntry("%true", "", body)), kUndecided);
    EXPECT_EQ(formsOf(rewriteText(oneEntry("%spec", "", body)).words).innerCalls, 1u);
}

// With VK_EXT_opacity_micromap neither the mode nor its operand matters.
TEST(ExecutionMode, DoesNotMatterWhereAllQueriesConsume)
{
    for (const char *operand : {"", "%true", "%false", "%spec", "%u0", "%main"})
        EXPECT_EQ(runText(oneEntry(operand), {}, "main", {}), kUndecided) << operand;
    EXPECT_EQ(runText(twoEntries("%false", ""), {}, "other", {}), kUndecided);
}

// A constant operand leaves nothing of itself in the code.
TEST(ExecutionMode, TrueAddsNoCode)
{
    spirv::RewriteOptions always = kWhereDeclared;
    always.queriesConsume = QueriesConsume::Always;
    EXPECT_EQ(rewriteText(oneEntry("%true")).words, rewriteText(oneEntry("%true"), always).words);
    EXPECT_EQ(rewriteText(twoEntries("%true", "%true")).words, rewriteText(twoEntries("%true", "%true"), always).words);
}

TEST(ExecutionMode, UndeclaredAddsNoCode)
{
    EXPECT_EQ(spirv::rewrite(assemble(moduleText("%p = OpRayQueryProceedKHR %bool %q\n")), kWhereDeclared).status,
              Status::Unchanged);
    EXPECT_EQ(count(disassemble(rewriteText(oneEntry("%false")).words), "vellum"), 0u);
    // Custom indices are slots nevertheless.
    for (const char *shader : {"while_loop.comp", "flags.comp", "opaque_boxes.comp", "array.comp"}) {
        const auto result = spirv::rewrite(loadShader(shader, "v15"), kWhereDeclared);
        const std::string text = disassemble(result.words);
        EXPECT_EQ(count(text, "vellumCandidate"), 0u) << shader;
        EXPECT_EQ(count(text, "vellumProceed"), 0u) << shader;
        EXPECT_EQ(count(text, "Flags("), 0u) << shader;
    }
}

TEST(ExecutionMode, AFalseSpecializationConstantIsFoldedAway)
{
    for (const bool value : {false, true}) {
        spvtools::Optimizer optimizer(SPV_ENV_VULKAN_1_2);
        optimizer.RegisterPass(spvtools::CreateSetSpecConstantDefaultValuePass(
            std::unordered_map<uint32_t, std::vector<uint32_t>>{{7, {value}}}));
        optimizer.RegisterPass(spvtools::CreateFreezeSpecConstantValuePass());
        optimizer.RegisterPerformancePasses();
        Module out;
        const Module words = rewriteText(oneEntry("%spec")).words;
        ASSERT_TRUE(optimizer.Run(words.data(), words.size(), &out));
        const std::string text = disassemble(out);
        EXPECT_EQ(count(text, "OpRayQueryGetIntersectionBarycentricsKHR"), value ? 1u : 0u) << text;
        EXPECT_EQ(count(text, "OpRayQueryConfirmIntersectionKHR"), value ? 1u : 0u);
    }
}

TEST(ExecutionMode, EntryPointsThatShareFunctions)
{
    const std::map<uint32_t, uint32_t> specialization{{7, 1}, {8, 0}};
    const std::map<std::string, Seen> declared{
        {"", kAll}, {"%true", kUndecided}, {"%false", kAll}, {"%spec", kUndecided}, {"%spec1", kAll}, {"%not", kAll}};
    for (const auto &[main, seenByMain] : declared)
        for (const auto &[other, seenByOther] : declared) {
            const std::string text = twoEntries(main, other);
            if (main.empty() && other.empty())
                continue;
            EXPECT_EQ(runText(text, specialization, "main"), seenByMain) << main << " " << other;
            EXPECT_EQ(runText(text, specialization, "other"), seenByOther) << main << " " << other;
        }
}

TEST(ExecutionMode, SharedFunctionsOfOlderModules)
{
    // Before SPIR-V 1.4 an interface has no Private variables.
    Module words = assemble(twoEntries("%true", "%false"));
    words[1] = 0x00010300;
    const auto result = spirv::rewrite(words, kWhereDeclared);
    ASSERT_EQ(result.status, Status::Rewritten);
    EXPECT_EQ(Machine(result.words, kScript).run("main"), kUndecided);
    EXPECT_EQ(Machine(result.words, kScript).run("other"), kAll);
    std::string error;
    const auto before = spirv::Module::parse(words, error), after = spirv::Module::parse(result.words, error);
    for (size_t i = 0; i < 2; ++i)
        EXPECT_EQ(after->section(spirv::Section::EntryPoints)[i].count,
                  before->section(spirv::Section::EntryPoints)[i].count);
}

TEST(ExecutionMode, StageOfAPipeline)
{
    for (const char *entry : {"main", "other"}) {
        spirv::RewriteOptions options = kWhereDeclared;
        options.pipelineStage = spirv::PipelineStage{entry, spv::ExecutionModelGLCompute};
        const Module words = rewriteText(twoEntries("%true", "%false"), options).words;
        EXPECT_EQ(Machine(words, kScript).run(entry), std::string(entry) == "main" ? kUndecided : kAll);
        EXPECT_EQ(count(disassemble(words), "vellumIfConsumed"), 0u); // nothing is shared
    }
}

// The ray flags that the driver receives, and those that the application reads.
struct FlagCase {
    const char *operand;
    bool consumes;
};

TEST(ExecutionMode, RayFlagsAreHiddenOnlyWhereMicromapsAreConsumed)
{
    constexpr uint32_t opaque = 0x1, cullNoOpaque = 0x80, force2State = 0x400, cullBack = 0x10;
    const std::string read = R"(
     %rf = OpRayQueryGetRayFlagsKHR %uint %q
           OpStore %result %rf
)";
    for (const FlagCase c : {FlagCase{"%true", true}, {"%spec", true}, {"%spec1", false}, {"%false", false}})
        for (const bool constant : {true, false})
            for (const uint32_t flags : {opaque, cullNoOpaque | cullBack, force2State | cullBack, cullBack}) {
                std::string text =
                    oneEntry(c.operand, "%flags = OpConstant %uint " + std::to_string(flags) + "\n", read);
                put(text, "OpExtension",
                    "OpCapability RayTracingOpacityMicromapEXT\n"
                    "OpExtension \"SPV_EXT_opacity_micromap\"\n");
                put(text, "OpRayQueryInitializeKHR", constant ? "" : "%rt = OpIAdd %uint %u0 %flags\n");
                text.replace(text.find("%as %u0"), 7, constant ? "%as %flags" : "%as %rt");
                Machine machine(rewriteText(text, kWhereDeclared).words, {}, {{7, 1}, {8, 0}});
                EXPECT_EQ(machine.run(), Seen{flags}) << c.operand << " " << constant;
                const uint32_t hidden = c.consumes ? opaque | cullNoOpaque | force2State : force2State;
                EXPECT_EQ(machine.rayFlags(), flags & ~hidden) << c.operand << " " << constant;
            }
}

// The machine's driver holds every box for non-opaque; with the flag Opaque, which it must not see where micromaps are
// consumed, the application does not.
TEST(ExecutionMode, BoxesAreOpaqueByTheHiddenFlag)
{
    for (const FlagCase c : {FlagCase{"%true", true}, {"%spec", true}, {"%spec1", false}, {"%false", false}})
        for (const bool constant : {true, false}) {
            std::string text = oneEntry(c.operand, "%flags = OpConstant %uint 1\n", R"(
            %o = OpRayQueryGetIntersectionCandidateAABBOpaqueKHR %bool %q
            %s = OpSelect %uint %o %u1 %u0
                 OpStore %result %s
)");
            put(text, "OpRayQueryInitializeKHR", constant ? "" : "%rt = OpIAdd %uint %u0 %flags\n");
            text.replace(text.find("%as %u0"), 7, constant ? "%as %flags" : "%as %rt");
            EXPECT_EQ(Machine(rewriteText(text, kWhereDeclared).words, {}, {{7, 1}, {8, 0}}).run(), Seen{c.consumes})
                << c.operand;
        }
}

void expectRejected(const Module &words, const char *what)
{
    const auto result = spirv::rewrite(words, kWhereDeclared);
    EXPECT_EQ(result.status, Status::Failed) << what;
    EXPECT_NE(result.error.find("OpacityMicromapIdKHR"), std::string::npos) << result.error;
    EXPECT_EQ(spirv::rewrite(words, {}).status, Status::Rewritten) << what; // does not matter there
}

TEST(ExecutionMode, RejectsWrongOperands)
{
    for (const char *operand : {"%u0", "%number", "%main", "%bool", "%scene", "%entry", "%call", "%never"}) {
        std::string text = oneEntry(operand);
        expectRejected(assemble(text), operand);
    }
    std::string text = oneEntry("%true");
    text.replace(text.find("!6031 %true"), 11, "!6031 !999999");
    expectRejected(assemble(text), "id beyond the bound");
    text = oneEntry("");
    put(text, "OpName", "OpExecutionModeId %main !6031\n");
    expectRejected(assemble(text), "no operand");
    text = oneEntry("");
    put(text, "OpName", "OpExecutionMode %main !6031 %true\n");
    expectRejected(assemble(text), "not OpExecutionModeId");
    text = oneEntry("%true");
    put(text, "OpName", modeText("main", "%false"));
    expectRejected(assemble(text), "twice");
    text = oneEntry("%true");
    put(text, "OpName", modeText("main", "%true"));
    EXPECT_EQ(runText(text), kUndecided);
}

TEST(ExecutionMode, DamagedModulesAreNoCrash)
{
    std::mt19937 random(31);
    const auto below = [&](size_t n) { return static_cast<uint32_t>(random() % n); };
    int rewritten = 0, failed = 0;
    const Module original = assemble(twoEntries("%spec", "%true"));
    for (int round = 0; round < 4000; ++round) {
        Module words = original;
        for (uint32_t n = 1 + below(3); n > 0; --n)
            words[below(words.size())] = below(3) == 0 ? static_cast<uint32_t>(random()) : below(original[3] + 2);
        const auto result = spirv::rewrite(words, kWhereDeclared);
        rewritten += result.status == Status::Rewritten;
        failed += result.status == Status::Failed;
        ASSERT_EQ(result.error.empty(), result.status != Status::Failed);
    }
    EXPECT_GT(rewritten, 500);
    EXPECT_GT(failed, 500);
}

} // namespace
} // namespace vellum::test
