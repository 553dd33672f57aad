// SPDX-License-Identifier: Apache-2.0
// The execution mode OpacityMicromapIdKHR, read, added and removed. The result is validated with a mode in its place
// that older SPIR-V Tools know (withKnownMode).
#include "support.h"

#include "spirv/module/micromap_mode.h"
#include "spirv/module/numbers.h"

#include <gtest/gtest.h>

namespace vellum::test
{
namespace
{

using spirv::EntryPoint;
using spirv::MicromapMode;
using spirv::ModeEdit;
using To = ModeEdit::To;
using When = MicromapMode::When;

// The text of a module in which "DenormPreserve" stands for the mode.
std::string textOf(const Module &words)
{
    return disassemble(withKnownMode(words));
}

size_t khrExtensions(const Module &words)
{
    return count({reinterpret_cast<const char *>(words.data()), words.size() * 4}, "SPV_KHR_opacity_micromap");
}

Module edited(const Module &words, const ModeEdit &edit)
{
    const spirv::ModeResult result = spirv::editMicromapMode(words, edit);
    EXPECT_EQ(result.error, "");
    EXPECT_FALSE(result.words.empty()) << "unchanged";
    if (result.words.empty())
        return words;
    EXPECT_EQ(validate(withKnownMode(result.words)), "") << textOf(result.words);
    EXPECT_TRUE(spirv::editMicromapMode(result.words, edit).words.empty()) << "changes again";
    return result.words;
}

std::string rejection(const Module &words, const ModeEdit &edit)
{
    const spirv::ModeResult result = spirv::editMicromapMode(words, edit);
    EXPECT_TRUE(result.words.empty());
    return result.error;
}

std::vector<EntryPoint> entriesOf(const Module &words)
{
    std::string error;
    const auto entries = spirv::readEntryPoints(words, error);
    EXPECT_TRUE(entries.has_value()) << error;
    return entries.value_or(std::vector<EntryPoint>{});
}

MicromapMode modeOf(const Module &words, const std::string &name = "main")
{
    for (const EntryPoint &entry : entriesOf(words))
        if (entry.name == name)
            return entry.mode;
    ADD_FAILURE() << "no entry point " << name;
    return {};
}

// Inserts `what` before `before`.
std::string with(std::string text, const std::string &before, const std::string &what)
{
    text.insert(text.find(before), what);
    return text;
}

std::string declaring(const std::string &text, const std::string &modes)
{
    const std::string needs = "OpCapability !6032\nOpExtension \"SPV_KHR_opacity_micromap\"\n";
    return with(with(text, "OpExtension", needs), "OpName", modes);
}

// "main" has a query of its own, "caller" one in a function that it calls, "plain" none.
Module threeEntries()
{
    std::string text = with(moduleText(""), "OpExecutionMode ",
                            "OpEntryPoint GLCompute %caller \"caller\" %scene\n"
                            "OpEntryPoint GLCompute %plain \"plain\"\n");
    text = with(text, "OpName", "OpExecutionMode %caller LocalSize 1 1 1\nOpExecutionMode %plain LocalSize 1 1 1\n");
    return assemble(text + R"(
  %helper = OpFunction %void None %voidfun
      %h1 = OpLabel
      %q2 = OpVariable %ptr_query Function
     %as2 = OpLoad %Scene %scene
            OpRayQueryInitializeKHR %q2 %as2 %u0 %mask %zero %f0 %one %f1
            OpReturn
            OpFunctionEnd
  %caller = OpFunction %void None %voidfun
      %c1 = OpLabel
      %c2 = OpFunctionCall %void %helper
            OpReturn
            OpFunctionEnd
   %plain = OpFunction %void None %voidfun
      %p1 = OpLabel
            OpReturn
            OpFunctionEnd
)");
}

TEST(MicromapMode, ReadForEachEntryPoint)
{
    const std::vector<EntryPoint> entries = entriesOf(threeEntries());
    ASSERT_EQ(entries.size(), 3u);
    EXPECT_EQ(entries[0].name, "main");
    EXPECT_EQ(entries[0].model, spv::ExecutionModelGLCompute);
    EXPECT_TRUE(entries[0].queries);
    EXPECT_TRUE(entries[1].queries);
    EXPECT_FALSE(entries[2].queries);
    for (const EntryPoint &entry : entries) {
        EXPECT_FALSE(entry.traces);
        EXPECT_EQ(entry.mode, MicromapMode{});
    }
}

TEST(MicromapMode, OperandsAreRead)
{
    const auto decide = [](const std::string &operand) {
        const std::string globals = "%null = OpConstantNull %bool\n%spec = OpSpecConstantTrue %bool\n"
                                    "%free = OpSpecConstantFalse %bool\n"
                                    "%not = OpSpecConstantOp %bool LogicalNot %spec\n";
        return modeOf(assemble(declaring(with(moduleText("", globals), "%void =", "OpDecorate %spec SpecId 4\n"),
                                         "OpExecutionModeId %main !6031 " + operand + "\n")));
    };
    EXPECT_EQ(decide("%true"), MicromapMode{When::Always});
    EXPECT_EQ(decide("%false"), MicromapMode{When::Never});
    EXPECT_EQ(decide("%null"), MicromapMode{When::Never});
    EXPECT_EQ(decide("%free"), MicromapMode{When::Never});
    EXPECT_EQ(decide("%spec"), (MicromapMode{When::Specialized, 4, true}));
    EXPECT_EQ(decide("%not"), MicromapMode{When::Computed});
    EXPECT_EQ(decide("%u1"), MicromapMode{When::Invalid});
    EXPECT_EQ(decide("%true\nOpExecutionModeId %main !6031 %false"), MicromapMode{When::Invalid});
}

TEST(MicromapMode, TracedRaysAreFound)
{
    const Module words = loadShader("trace.rgen", "v15");
    ASSERT_EQ(entriesOf(words).size(), 1u);
    EXPECT_TRUE(entriesOf(words)[0].traces);
    EXPECT_FALSE(entriesOf(words)[0].queries);
    EXPECT_TRUE(spirv::editMicromapMode(words, {}).words.empty()) << "has no ray queries";
}

TEST(MicromapMode, AlwaysForAllWithQueries)
{
    const Module words = edited(threeEntries(), {});
    EXPECT_EQ(modeOf(words), MicromapMode{When::Always});
    EXPECT_EQ(modeOf(words, "caller"), MicromapMode{When::Always});
    EXPECT_EQ(modeOf(words, "plain"), MicromapMode{});
    const std::string text = textOf(words);
    EXPECT_EQ(count(text, "OpConstantTrue"), 1u) << "the module's is used\n" << text;
    EXPECT_EQ(khrExtensions(words), 1u) << text;
    EXPECT_EQ(edited(words, {.to = To::Absent}), threeEntries());
}

TEST(MicromapMode, NamedEntryPoints)
{
    const Module one = edited(threeEntries(), {.entryPoints = {"caller"}});
    EXPECT_EQ(modeOf(one), MicromapMode{});
    EXPECT_EQ(modeOf(one, "caller"), MicromapMode{When::Always});
    const Module plain = edited(threeEntries(), {.entryPoints = {"plain"}});
    EXPECT_EQ(modeOf(plain, "plain"), MicromapMode{When::Always});
    const Module both = edited(one, {.entryPoints = {"main"}});
    EXPECT_EQ(modeOf(edited(both, {.to = To::Absent, .entryPoints = {"caller"}}), "main"), MicromapMode{When::Always});
    EXPECT_EQ(rejection(one, {.entryPoints = {"main", "missing"}}),
              "there is no entry point missing; the module has main, caller, plain");
}

TEST(MicromapMode, SpecializationConstants)
{
    for (const bool initial : {false, true}) {
        const Module words = edited(threeEntries(), {.to = To::Specialized, .constantId = 7, .initial = initial});
        EXPECT_EQ(modeOf(words), (MicromapMode{When::Specialized, 7, initial}));
        EXPECT_EQ(modeOf(words, "caller"), (MicromapMode{When::Specialized, 7, initial}));
        const Module always = edited(words, {});
        EXPECT_EQ(modeOf(always), MicromapMode{When::Always}) << "replaces the other";
        EXPECT_EQ(count(textOf(always), " DenormPreserve 32"), 2u);
    }
}

TEST(MicromapMode, SpecializationConstantsOfTheModule)
{
    const std::string text = with(moduleText("", "%spec = OpSpecConstantTrue %bool\n%size = OpSpecConstant %uint 3\n"),
                                  "%void =", "OpDecorate %spec SpecId 4\nOpDecorate %size SpecId 5\n");
    const Module words = edited(assemble(text), {.to = To::Specialized, .constantId = 4, .initial = true});
    EXPECT_EQ(count(textOf(words), "OpSpecConstantTrue"), 1u);
    EXPECT_EQ(rejection(assemble(text), {.to = To::Specialized, .constantId = 4}),
              "the specialization constant 4 of the module has the default true");
    EXPECT_EQ(rejection(assemble(text), {.to = To::Specialized, .constantId = 5}),
              "the specialization constant 5 of the module is not of type bool");
}

// A module without the type, decorations, names or extensions, and with a line before its function.
TEST(MicromapMode, AddsMissingDeclarations)
{
    const Module words = assemble(R"(
               OpCapability Shader
               OpMemoryModel Logical GLSL450
               OpEntryPoint GLCompute %main "main"
               OpExecutionMode %main LocalSize 1 1 1
       %file = OpString "file"
       %void = OpTypeVoid
    %voidfun = OpTypeFunction %void
               OpLine %file 1 1
       %main = OpFunction %void None %voidfun
      %entry = OpLabel
               OpReturn
               OpFunctionEnd
)");
    for (const To to : {To::Always, To::Specialized}) {
        const Module result = edited(words, {.to = to, .entryPoints = {"main"}});
        const std::string text = textOf(result);
        EXPECT_EQ(count(text, "OpTypeBool"), 1u) << text;
        EXPECT_LT(text.find("OpTypeBool"), text.find("OpLine")) << text;
    }
}

// The extension also has the capability of a ray flag.
TEST(MicromapMode, OtherDeclarationsStay)
{
    const std::string text = with(moduleText(""), "OpExtension", "OpCapability !5381\n");
    const Module khr = assemble(with(text, "OpExtension", "OpExtension \"SPV_KHR_opacity_micromap\"\n"));
    const Module ext = assemble(with(text, "OpExtension", "OpExtension \"SPV_EXT_opacity_micromap\"\n"));
    for (const Module &words : {khr, ext}) {
        const Module result = edited(words, {});
        EXPECT_EQ(khrExtensions(result), 1u);
        EXPECT_EQ(edited(result, {.to = To::Absent}), words);
    }
}

TEST(MicromapMode, RejectsMalformedModules)
{
    const Module words = assemble(moduleText(""));
    EXPECT_EQ(rejection({}, {}), "not a SPIR-V module of this machine's byte order");
    Module old = words;
    old[1] = 0x10300;
    EXPECT_EQ(rejection(old, {}), "SPV_KHR_opacity_micromap needs SPIR-V 1.4; the module has 1.3");
    Module bound = words;
    bound[3] = 4'194'303;
    EXPECT_EQ(rejection(bound, {}), "the bound of its ids is 4194303");
    Module cut = words;
    cut.push_back(2u << 16);
    EXPECT_EQ(rejection(cut, {}),
              "word " + std::to_string(words.size()) + ", opcode 0: instruction runs past the end of the module");
}

// The scan never reads beyond the words.
TEST(MicromapMode, ShortenedModules)
{
    const Module words = edited(threeEntries(), {.to = To::Specialized, .constantId = 7});
    for (size_t size = 0; size < words.size(); ++size) {
        const Module shortened(words.begin(), words.begin() + static_cast<ptrdiff_t>(size));
        for (const To to : {To::Always, To::Specialized, To::Absent})
            static_cast<void>(spirv::editMicromapMode(shortened, {.to = to, .constantId = 3}));
    }
}

// The shaders of this folder, as compiled: the mode comes and goes.
TEST(MicromapMode, CompiledShaders)
{
    for (const char *name : {"while_loop.comp", "any_hit.rahit"})
        for (const char *variant : {"v14", "v15", "v16", "debug"}) {
            SCOPED_TRACE(std::string(name) + " " + variant);
            const Module words = loadShader(name, variant);
            const Module specialized =
                edited(words, {.to = To::Specialized, .constantId = 100, .entryPoints = {"main"}});
            EXPECT_EQ(modeOf(specialized), (MicromapMode{When::Specialized, 100, false}));
            EXPECT_EQ(modeOf(edited(specialized, {.to = To::Absent})), MicromapMode{});
        }
}

} // namespace
} // namespace vellum::test
