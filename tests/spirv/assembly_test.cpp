// SPDX-License-Identifier: Apache-2.0
// Shapes that compilers seldom make, by hand.
#include "support.h"

#include "spirv/module/numbers.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace vellum::test
{
namespace
{

using Status = spirv::RewriteResult::Status;

std::string loopOn(const std::string &query, const std::string &control = "None", const std::string &before = "")
{
    return R"(
        OpBranch %h
   %h = OpLabel
        OpLoopMerge %m %c )" +
           control + R"(
        OpBranch %k
   %k = OpLabel
)" + before +
           " %r = OpRayQueryProceedKHR %bool " + query + R"(
        OpBranchConditional %r %body %m
%body = OpLabel
        OpRayQueryConfirmIntersectionKHR )" +
           query + R"(
        OpBranch %c
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
)";
}

Forms formsOfText(const std::string &text)
{
    return formsOf(rewriteValid(assemble(text)));
}

// Debug information about a local variable %local; withDebugSet() declares what it needs.
constexpr const char *kDebugLocal = "%source = OpExtInst %void %set 35 %name\n"
                                    "%unit = OpExtInst %void %set 1 %u1 %u1 %source %u2\n"
                                    "%type = OpExtInst %void %set 2 %name %u0 %u0 %u0\n"
                                    "%local = OpExtInst %void %set 26 %name %type %source %u1 %u1 %unit %u0\n"
                                    "%expression = OpExtInst %void %set 31\n";

std::string withDebugSet(std::string text, const std::string &set)
{
    text.replace(text.find("OpName"), 0, "%name = OpString \"q\"\n");
    return text.replace(text.find("OpMemoryModel"), 0,
                        "OpExtension \"SPV_KHR_non_semantic_info\"\n%set = OpExtInstImport \"" + set + "\"\n");
}

// The module with an instruction put before the first one of another opcode.
Module insertBefore(const Module &words, uint32_t opcode, const Module &instruction)
{
    Module out(words.begin(), words.begin() + 5);
    bool done = false;
    for (size_t at = 5; at < words.size(); at += words[at] >> 16) {
        if (!done && (words[at] & 0xffff) == opcode) {
            out.insert(out.end(), instruction.begin(), instruction.end());
            done = true;
        }
        out.insert(out.end(), words.begin() + static_cast<ptrdiff_t>(at),
                   words.begin() + static_cast<ptrdiff_t>(at + (words[at] >> 16)));
    }
    EXPECT_TRUE(done);
    return out;
}

TEST(Queries, PrivateVariable)
{
    const Forms f = formsOfText(moduleText("OpRayQueryInitializeKHR %private %as %u0 %mask %zero %f0 %one %f1" +
                                           loopOn("%private") + "%again = OpRayQueryProceedKHR %bool %private\n"));
    EXPECT_EQ(f.flatCalls, 1u);
    EXPECT_EQ(f.innerCalls, 1u);
    EXPECT_EQ(f.candidateFunctions, 1u);
}

TEST(Queries, StructsAndArraysThroughChains)
{
    const std::string globals = R"(
      %three = OpConstant %uint 3
      %inner = OpTypeArray %Query %three
     %Holder = OpTypeStruct %uint %inner
      %outer = OpTypeArray %Holder %u2
  %ptr_outer = OpTypePointer Private %outer
 %ptr_holder = OpTypePointer Private %Holder
  %ptr_inner = OpTypePointer Private %inner
    %holders = OpVariable %ptr_outer Private
)";
    const std::string body = R"(
     %i = OpLoad %uint %var
    %c1 = OpAccessChain %ptr_holder %holders %i
    %c2 = OpInBoundsAccessChain %ptr_inner %c1 %u1
    %c3 = OpCopyObject %ptr_inner %c2
    %c4 = OpAccessChain %ptr_private %c3 %i
    %c5 = OpAccessChain %ptr_private %holders %u0 %u1 %u2
    %p1 = OpRayQueryProceedKHR %bool %c4
    %p2 = OpRayQueryProceedKHR %bool %c5
    %p3 = OpRayQueryProceedKHR %bool %c4
)";
    std::string text = moduleText(body, globals);
    text.replace(text.find("%scene %out"), 11, "%scene %out %holders");
    const Forms f = formsOfText(text);
    EXPECT_EQ(f.innerCalls, 3u);
    EXPECT_EQ(f.proceedFunctions, 2u); // two access paths to a query
    EXPECT_EQ(f.candidateFunctions, 2u);
}

TEST(Queries, Parameters)
{
    const std::string globals = "%fun = OpTypeFunction %void %ptr_query\n";
    const std::string functions = R"(
  %trace = OpFunction %void None %fun
  %param = OpFunctionParameter %ptr_query
  %start = OpLabel
)" + loopOn("%param") + R"(
           OpReturn
           OpFunctionEnd
)";
    const Forms f = formsOfText(moduleText("%none = OpFunctionCall %void %trace %q\n"
                                           "%again = OpRayQueryProceedKHR %bool %q\n",
                                           globals, functions));
    EXPECT_EQ(f.flatCalls, 1u);
    EXPECT_EQ(f.innerCalls, 1u);
    EXPECT_EQ(f.candidateFunctions, 1u); // the parameter and the variable have the same pointer type
}

TEST(Queries, RejectsOtherAccess)
{
    const Module words = assemble(moduleText("%s = OpSelect %ptr_query %true %q %q\n"
                                             "%p = OpRayQueryProceedKHR %bool %s\n"));
    const auto result = spirv::rewrite(words, {});
    EXPECT_EQ(result.status, Status::Failed);
    EXPECT_NE(result.error.find("OpRayQueryProceedKHR"), std::string::npos);
}

TEST(Loops, ControlsThatCountIterationsForbidTheFlatForm)
{
    EXPECT_EQ(formsOfText(moduleText(loopOn("%q", "Unroll"))).flatCalls, 1u);
    EXPECT_EQ(formsOfText(moduleText(loopOn("%q", "MaxIterations 9"))).flatCalls, 0u);
    EXPECT_EQ(formsOfText(moduleText(loopOn("%q", "DependencyInfinite"))).flatCalls, 0u);
}

TEST(Loops, SideEffectsBeforeTheCallForbidTheFlatForm)
{
    const auto flat = [](const std::string &before) {
        return formsOfText(moduleText(loopOn("%q", "None", before))).flatCalls;
    };
    EXPECT_EQ(flat("%x = OpLoad %uint %result\n%y = OpIAdd %uint %x %u1\n"), 1u);
    EXPECT_EQ(flat("%x = OpLoad %uint %result Volatile\n"), 0u);
    EXPECT_EQ(flat("%x = OpAtomicIAdd %uint %result %u1 %u0 %u1\n"), 0u);
    EXPECT_EQ(flat("OpStore %var %u1\n"), 0u);
    // The lookup would use data of the last candidate, which is another one.
    EXPECT_EQ(flat("%x = OpRayQueryGetIntersectionTypeKHR %uint %q %i0\n"), 0u);
}

// Invocations that find a candidate in the same call run the body together, whatever was decided for each before.
TEST(Loops, GuaranteedConvergenceForbidsTheFlatForm)
{
    std::string text = moduleText(loopOn("%q"));
    text.replace(text.find("OpName"), 0, "OpExecutionMode %main SubgroupUniformControlFlowKHR\n");
    text.replace(text.find("OpMemoryModel"), 0, "OpExtension \"SPV_KHR_subgroup_uniform_control_flow\"\n");
    Module words = assemble(text);
    EXPECT_EQ(formsOf(rewriteValid(words)).flatCalls, 0u);
    // SPIR-V Tools may be too old for the other mode.
    const uint32_t known = spv::ExecutionModeSubgroupUniformControlFlowKHR;
    const uint32_t other = spv::ExecutionModeMaximallyReconvergesKHR;
    std::ranges::replace(words, known, other);
    Module rewritten = spirv::rewrite(words, {}).words;
    std::ranges::replace(rewritten, other, known);
    EXPECT_EQ(formsOf(rewritten).flatCalls, 0u);
    EXPECT_EQ(formsOf(rewritten).innerCalls, 1u);
}

TEST(Loops, LineNumbersDoNotMatter)
{
    std::string text = moduleText(loopOn("%q", "None", "OpLine %file 1 2\n"));
    text.replace(text.find("OpName"), 6, "%file = OpString \"a.comp\"\nOpName");
    text.replace(text.find("%h = OpLabel"), 12, "%h = OpLabel\nOpLine %file 3 4\n");
    text.replace(text.find("%c = OpLabel"), 12, "%c = OpLabel\nOpLine %file 5 6\nOpNoLine\n");
    EXPECT_EQ(formsOfText(text).flatCalls, 1u);
}

// Debug information in the continue target must not use values of the body, which is not on the path to it if a
// candidate is decided. Optimizers leave it for an assignment in the third part of a for loop.
TEST(Loops, DebugInformationAboutTheBodyForbidsTheFlatForm)
{
    const auto flat = [](const std::string &value) {
        std::string text = moduleText(loopOn("%q"), kDebugLocal);
        text.replace(text.find("OpRayQueryConfirmIntersectionKHR"), 0, "%x = OpLoad %uint %result\n");
        text.replace(text.find("%c = OpLabel"), 12,
                     "%c = OpLabel\n%d = OpExtInst %void %set 29 %local " + value + " %expression\n");
        return formsOfText(withDebugSet(text, "NonSemantic.Shader.DebugInfo.100")).flatCalls;
    };
    EXPECT_EQ(flat("%u1"), 1u);
    EXPECT_EQ(flat("%x"), 0u);
}

// The custom index of a candidate is stored in a variable next to its query if all uses of the query are known. Debug
// instructions about the query are not uses.
TEST(Queries, KeepTheIndexInSpiteOfDebugInformation)
{
    const std::string get = "%x = OpRayQueryGetIntersectionInstanceCustomIndexKHR %int %q %i0\nOpStore %var %u1\n";
    const auto variables = [&](const std::string &set) {
        const std::string text = moduleText("%p = OpRayQueryProceedKHR %bool %q\n"
                                            "%d = OpExtInst %void %set 28 %local %q %expression\n" +
                                                get,
                                            kDebugLocal);
        return count(disassemble(rewriteValid(assemble(withDebugSet(text, set)))),
                     "OpVariable %_ptr_Function_uint Function");
    };
    const size_t others = variables("NonSemantic.Other"); // of unknown effect
    EXPECT_EQ(variables("NonSemantic.Shader.DebugInfo.100"), others + 1);
}

TEST(Declarations, MicromapDeclarationsAreRemoved)
{
    std::string text = moduleText("");
    text.replace(text.find("OpExtension"), 11,
                 "OpCapability RayTracingOpacityMicromapEXT\nOpExtension \"SPV_EXT_opacity_micromap\"\n"
                 "OpExtension \"SPV_KHR_opacity_micromap\"\nOpExtension");
    Module words = assemble(text);
    words = insertBefore(words, spv::OpExtension, {2u << 16 | spv::OpCapability, 6032});
    const uint32_t main = 1; // any id: the mode goes with all its operands
    words = insertBefore(words, spv::OpName, {4u << 16 | spv::OpExecutionModeId, main, 6031, main});
    ASSERT_NE(validate(words), "");
    const auto result = spirv::rewrite(words, {});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "");
    EXPECT_EQ(count(disassemble(result.words), "icromap"), 0u);
    EXPECT_EQ(count(disassemble(result.words), "vellum"), 0u); // nothing to look up
}

TEST(Declarations, VulkanMemoryModel)
{
    std::string text = moduleText(loopOn("%q"));
    text.replace(text.find("OpExtension"), 11, "OpCapability VulkanMemoryModel\nOpExtension");
    text.replace(text.find("Logical GLSL450"), 15, "Logical Vulkan");
    EXPECT_EQ(formsOfText(text).flatCalls, 1u);
}

TEST(Declarations, RejectsOtherAddressingModels)
{
    std::string text = moduleText(loopOn("%q"));
    text.replace(text.find("Logical GLSL450"), 15, "Physical64 GLSL450");
    const auto result = spirv::rewrite(assemble(text), {});
    EXPECT_EQ(result.status, Status::Failed);
    EXPECT_NE(result.error.find("addressing model"), std::string::npos);
}

TEST(UnknownInstructions, PassThroughWhereTheyStand)
{
    const Module unknown{3u << 16 | 0x7abc, 0x1234567, 0x89abcde};
    const Module words = assemble(moduleText(loopOn("%q")));
    for (const uint32_t before : {spv::OpRayQueryProceedKHR, spv::OpTypeBool, spv::OpDecorate}) {
        const auto result = spirv::rewrite(insertBefore(words, before, unknown), {});
        ASSERT_EQ(result.status, Status::Rewritten) << result.error;
        const auto at = std::search(result.words.begin(), result.words.end(), unknown.begin(), unknown.end());
        EXPECT_NE(at, result.words.end());
    }
    // In a block that continues the loop an instruction may have any effect, so the flat form is not used.
    Module out = spirv::rewrite(insertBefore(words, spv::OpRayQueryProceedKHR, unknown), {}).words;
    const auto at = std::search(out.begin(), out.end(), unknown.begin(), unknown.end());
    out.erase(at, at + 3); // spirv-dis does not pass them through
    EXPECT_EQ(formsOf(out).innerCalls, 1u);
}

TEST(Flags, NullIsAConstant)
{
    std::string text = moduleText(loopOn("%q"), "%null = OpConstantNull %uint\n");
    text.replace(text.find("%as %u0"), 7, "%as %null");
    EXPECT_EQ(count(disassemble(rewriteValid(assemble(text))), "vellumDriverFlags"), 0u);
}

TEST(Flags, MayBeSigned)
{
    std::string text = moduleText("%f = OpRayQueryGetRayFlagsKHR %int %q\n" + loopOn("%q"), "");
    text.replace(text.find("OpRayQueryInitializeKHR"), 0,
                 "%loaded = OpLoad %uint %var\n%signed = OpBitcast %int %loaded\n");
    text.replace(text.find("%as %u0"), 7, "%as %signed");
    const std::string out = disassemble(rewriteValid(assemble(text)));
    EXPECT_EQ(count(out, "%uint_1153\n"), 1u);
    EXPECT_EQ(count(out, "OpRayQueryGetRayFlagsKHR"), 0u);
}

} // namespace
} // namespace vellum::test
