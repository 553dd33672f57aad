// SPDX-License-Identifier: Apache-2.0
// SPIR-V with SPV_KHR_opacity_micromap for drivers that know SPV_EXT_opacity_micromap only.
#include "support.h"

#include "spirv/module/khr_to_ext.h"

#include <gtest/gtest.h>

namespace vellum::test
{
namespace
{

std::string moduleDeclaring(const std::string &declarations, const std::string &mode = "")
{
    std::string text = moduleText("");
    text.insert(text.find("OpExtension"), declarations);
    text.insert(text.find("OpName"), mode);
    return text;
}

TEST(Translate, KeepsOtherModules)
{
    const Module plain = assemble(moduleText(""));
    EXPECT_TRUE(spirv::translateToExt(plain).words.empty());
    const Module ext = assemble(moduleDeclaring("OpCapability !5381\nOpExtension \"SPV_EXT_opacity_micromap\"\n"));
    EXPECT_TRUE(spirv::translateToExt(ext).words.empty());
}

TEST(Translate, NamesTheExtensionOnce)
{
    const Module khr = assemble(moduleDeclaring("OpCapability !5381\nOpExtension \"SPV_KHR_opacity_micromap\"\n"));
    const std::string translated = disassemble(spirv::translateToExt(khr).words);
    EXPECT_EQ(count(translated, "SPV_EXT_opacity_micromap"), 1u) << translated;
    EXPECT_EQ(count(translated, "SPV_KHR_opacity_micromap"), 0u) << translated;
    const Module both = assemble(moduleDeclaring("OpCapability !5381\nOpExtension \"SPV_KHR_opacity_micromap\"\n"
                                                 "OpExtension \"SPV_EXT_opacity_micromap\"\n"));
    EXPECT_EQ(spirv::translateToExt(both).words,
              assemble(moduleDeclaring("OpCapability !5381\nOpExtension \"SPV_EXT_opacity_micromap\"\n")));
}

TEST(Translate, RemovesTheMode)
{
    const std::string mode = "OpExecutionModeId %main !6031 %true\n";
    const Module words =
        assemble(moduleDeclaring("OpCapability !6032\nOpExtension \"SPV_KHR_opacity_micromap\"\n", mode));
    const spirv::TranslateResult result = spirv::translateToExt(words);
    EXPECT_FALSE(result.queriesForget);
    const std::string text = disassemble(result.words);
    EXPECT_EQ(count(text, "OpExecutionModeId"), 0u) << text;
    EXPECT_EQ(count(text, "6032"), 0u) << text;
    EXPECT_EQ(validate(result.words), "");
    EXPECT_EQ(spirv::translateToExt(result.words).words, Module{});
}

TEST(Translate, ReportsForgottenModes)
{
    EXPECT_TRUE(spirv::translateToExt(assemble(moduleText(""))).queriesForget);
}

// The scan never reads beyond the words.
TEST(Translate, WordsThatAreCutShort)
{
    const Module words = assemble(moduleDeclaring("OpCapability !6032\nOpExtension \"SPV_KHR_opacity_micromap\"\n",
                                                  "OpExecutionModeId %main !6031 %true\n"));
    for (size_t length = 0; length <= words.size(); ++length) {
        const Module cut(words.begin(), words.begin() + static_cast<ptrdiff_t>(length));
        const Module result = spirv::translateToExt(cut).words;
        EXPECT_LE(result.size(), cut.size());
        if (length < 5) {
            EXPECT_TRUE(result.empty());
        }
    }
    Module endless = words;
    endless[5] = 0; // an instruction of no words
    EXPECT_TRUE(spirv::translateToExt(endless).words.empty());
}

} // namespace
} // namespace vellum::test
