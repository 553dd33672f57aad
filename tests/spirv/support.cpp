// SPDX-License-Identifier: Apache-2.0
#include "support.h"

#include "module_file.h"

#include <gtest/gtest.h>
#include <spirv-tools/optimizer.hpp>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

namespace vellum::test
{
namespace
{

// The lines of a module that say what it needs.
std::set<std::string> needsOf(const Module &words)
{
    std::istringstream text(disassemble(words));
    std::set<std::string> needs;
    for (std::string line; std::getline(text, line);) {
        if (line.find("OpCapability ") != std::string::npos || line.find("OpExtension ") != std::string::npos)
            needs.insert(line.substr(line.find("Op")));
    }
    return needs;
}

} // namespace

Module loadShader(const std::string &name, const std::string &variant)
{
    return readModule(std::string(SHADER_DIRECTORY) + "/" + name + "." + variant + ".spv");
}

Module optimize(const Module &words)
{
    spvtools::Optimizer optimizer(environmentOf(words));
    optimizer.RegisterPerformancePasses();
    Module out;
    spvtools::OptimizerOptions options;
    options.set_run_validator(false);
    EXPECT_TRUE(optimizer.Run(words.data(), words.size(), &out, options));
    return out;
}

Module assemble(const std::string &text)
{
    spvtools::SpirvTools tools(SPV_ENV_VULKAN_1_2);
    std::string messages;
    tools.SetMessageConsumer([&](spv_message_level_t, const char *, const spv_position_t &at, const char *message) {
        messages += "line " + std::to_string(at.line) + ": " + message + "\n";
    });
    Module words;
    EXPECT_TRUE(tools.Assemble(text, &words, SPV_TEXT_TO_BINARY_OPTION_PRESERVE_NUMERIC_IDS)) << messages << text;
    return words;
}

std::string disassemble(const Module &words)
{
    std::string text;
    spvtools::SpirvTools(SPV_ENV_VULKAN_1_3).Disassemble(words, &text);
    return text;
}

namespace
{

// For tests/drivers: writes to the folder that the environment names, if any.
void writeModule(const Module &words)
{
    const char *folder = std::getenv("VELLUM_TEST_MODULES");
    if (folder == nullptr)
        return;
    const auto *test = testing::UnitTest::GetInstance()->current_test_info();
    static int number = 0;
    std::string name = std::string(test->test_suite_name()) + "." + test->name() + "." + std::to_string(number++);
    std::ranges::replace(name, '/', '-');
    std::ofstream file(std::string(folder) + "/" + name + ".spv", std::ios::binary);
    file.write(reinterpret_cast<const char *>(words.data()), static_cast<std::streamsize>(words.size() * 4));
    EXPECT_TRUE(file.flush()) << folder;
}

} // namespace

void expectNoMoreNeeds(const Module &words, const Module &rewritten)
{
    EXPECT_EQ(rewritten.at(1), words.at(1)); // the version
    const std::set<std::string> before = needsOf(words);
    for (const std::string &need : needsOf(rewritten))
        EXPECT_TRUE(before.contains(need) || need == "OpCapability PhysicalStorageBufferAddresses" ||
                    need == "OpExtension \"SPV_KHR_physical_storage_buffer\"")
            << need;
}

Module rewriteValid(const Module &words)
{
    writeModule(words);
    EXPECT_EQ(validate(words), "") << disassemble(words);
    // Both halves differ, so that a swap is found.
    const auto result = spirv::rewrite(words, {.rootAddress = 0xfedcba9876543210});
    EXPECT_EQ(result.status, spirv::RewriteResult::Status::Rewritten) << result.error;
    EXPECT_EQ(validate(result.words), "") << disassemble(result.words);
    expectNoMoreNeeds(words, result.words);
    const auto kept = spirv::rewrite(words, {.constantQueryFlags = false});
    EXPECT_EQ(kept.status, spirv::RewriteResult::Status::Rewritten) << kept.error;
    EXPECT_EQ(validate(kept.words), "") << disassemble(kept.words);
    expectNoMoreNeeds(words, kept.words);
    return result.words;
}

size_t count(const std::string &text, const std::string &part)
{
    size_t n = 0;
    for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
        ++n;
    return n;
}

Forms formsOf(const Module &rewritten)
{
    const std::string text = disassemble(rewritten);
    Forms f;
    f.proceedFunctions = count(text, "\"vellumProceed\"");
    f.candidateFunctions = count(text, "\"vellumCandidate\"");
    f.innerCalls = count(text, "OpFunctionCall %bool %vellumProceed");
    f.flatCalls = count(text, "OpRayQueryProceedKHR") - f.proceedFunctions;
    return f;
}

std::string moduleText(const std::string &body, const std::string &globals, const std::string &functions)
{
    // Mesa's ANV crashes on a query of the module's that nothing uses.
    const bool usesPrivate = (body + globals + functions).find("%private") != std::string::npos;
    const std::string interface = usesPrivate ? "%scene %out %private" : "%scene %out";
    const std::string variable = usesPrivate ? "    %private = OpVariable %ptr_private Private\n" : "";
    return R"(
               OpCapability Shader
               OpCapability RayQueryKHR
               OpExtension "SPV_KHR_ray_query"
               OpMemoryModel Logical GLSL450
               OpEntryPoint GLCompute %main "main" )" +
           interface +
           R"(
               OpExecutionMode %main LocalSize 8 1 1
               OpName %main "main"
               OpDecorate %scene DescriptorSet 0
               OpDecorate %scene Binding 0
               OpDecorate %out DescriptorSet 0
               OpDecorate %out Binding 1
               OpDecorate %Out Block
               OpMemberDecorate %Out 0 Offset 0
       %void = OpTypeVoid
       %bool = OpTypeBool
       %uint = OpTypeInt 32 0
        %int = OpTypeInt 32 1
      %float = OpTypeFloat 32
         %v3 = OpTypeVector %float 3
    %voidfun = OpTypeFunction %void
      %Query = OpTypeRayQueryKHR
      %Scene = OpTypeAccelerationStructureKHR
        %Out = OpTypeStruct %uint
  %ptr_query = OpTypePointer Function %Query
%ptr_private = OpTypePointer Private %Query
  %ptr_scene = OpTypePointer UniformConstant %Scene
    %ptr_out = OpTypePointer StorageBuffer %Out
   %ptr_uint = OpTypePointer StorageBuffer %uint
   %var_uint = OpTypePointer Function %uint
         %u0 = OpConstant %uint 0
         %u1 = OpConstant %uint 1
         %u2 = OpConstant %uint 2
       %mask = OpConstant %uint 255
         %i0 = OpConstant %int 0
         %f0 = OpConstant %float 0
         %f1 = OpConstant %float 1
       %zero = OpConstantComposite %v3 %f0 %f0 %f0
        %one = OpConstantComposite %v3 %f1 %f1 %f1
       %true = OpConstantTrue %bool
      %false = OpConstantFalse %bool
      %scene = OpVariable %ptr_scene UniformConstant
        %out = OpVariable %ptr_out StorageBuffer
)" + variable +
           globals +
           R"(
       %main = OpFunction %void None %voidfun
      %entry = OpLabel
          %q = OpVariable %ptr_query Function
        %var = OpVariable %var_uint Function
         %as = OpLoad %Scene %scene
     %result = OpAccessChain %ptr_uint %out %i0
               OpRayQueryInitializeKHR %q %as %u0 %mask %zero %f0 %one %f1
)" + body +
           R"(
               OpReturn
               OpFunctionEnd
)" + functions;
}

std::string rayTracingText(const std::string &declarations, const std::string &body, const std::string &needs)
{
    return needs + R"(
        OpExtension "SPV_KHR_ray_tracing"
        OpMemoryModel Logical GLSL450
)" + declarations +
           R"(
%void = OpTypeVoid
%proc = OpTypeFunction %void
)" + body;
}

std::string functionText(const std::string &name, const std::string &code)
{
    return "%" + name + " = OpFunction %void None %proc\n%label_" + name + " = OpLabel\n" + code +
           "\nOpReturn\nOpFunctionEnd\n";
}

} // namespace vellum::test
