// SPDX-License-Identifier: Apache-2.0
// vellum/spirv.h; what the edits do to modules is tested in tests/spirv.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "vellum/spirv.h"

namespace
{

// "main" initializes a ray query that it never declares: nothing here reads more of it than the opcode.
std::vector<uint32_t> module()
{
    return {0x07230203,
            0x10500,
            0,
            10,
            0, // header
            2u << 16 | 17,
            1,
            3u << 16 | 14,
            0,
            1, // Shader, memory model
            5u << 16 | 15,
            5,
            1,
            0x6e69616d,
            0, // OpEntryPoint "main"
            2u << 16 | 19,
            2,
            3u << 16 | 33,
            3,
            2, // void, its function type
            5u << 16 | 54,
            2,
            1,
            0,
            3,
            2u << 16 | 248,
            4, // OpFunction, OpLabel
            9u << 16 | 4473,
            5,
            5,
            5,
            5,
            5,
            5,
            5,
            5, // OpRayQueryInitializeKHR
            1u << 16 | 253,
            1u << 16 | 56}; // OpReturn, OpFunctionEnd
}

struct Message {
    VellumResult result = VELLUM_SUCCESS;
    std::string text;
};

void keep(void *userData, VellumResult result, const char *text)
{
    *static_cast<Message *>(userData) = {result, text};
}

struct Spirv : testing::Test {
    Spirv()
    {
        vellumInitSpirvOptions(&options, sizeof options);
        options.message = keep;
        options.userData = &message;
    }
    ~Spirv() override { vellumDestroySpirv(spirv); }

    VellumResult edit()
    {
        vellumDestroySpirv(spirv);
        return vellumEditSpirv(words.data(), words.size(), &options, &spirv);
    }
    VellumSpirvInfo info()
    {
        VellumSpirvInfo values{};
        values.structSize = sizeof values;
        EXPECT_EQ(vellumGetSpirvInfo(spirv, &values), VELLUM_SUCCESS);
        return values;
    }
    VellumSpirvEntryPointInfo entry()
    {
        VellumSpirvEntryPointInfo values{};
        values.structSize = sizeof values;
        EXPECT_EQ(vellumGetSpirvEntryPointInfo(spirv, 0, &values), VELLUM_SUCCESS);
        return values;
    }
    void expectError(const std::string &text)
    {
        EXPECT_EQ(edit(), VELLUM_ERROR_INVALID_ARGUMENT);
        EXPECT_EQ(spirv, nullptr);
        EXPECT_EQ(message.result, VELLUM_ERROR_INVALID_ARGUMENT);
        EXPECT_EQ(message.text, text);
    }

    std::vector<uint32_t> words = module();
    VellumSpirvOptions options{};
    VellumSpirv *spirv = nullptr;
    Message message;
};

TEST_F(Spirv, DefaultsEnable)
{
    ASSERT_EQ(vellumEditSpirv(words.data(), words.size(), nullptr, &spirv), VELLUM_SUCCESS);
    EXPECT_EQ(info().changed, 1u);
    EXPECT_EQ(info().entryPointCount, 1u);
    EXPECT_GT(info().wordCount, words.size());
    EXPECT_STREQ(entry().name, "main");
    EXPECT_EQ(entry().executionModel, 5u);
    EXPECT_EQ(entry().rayQueries, 1u);
    EXPECT_EQ(entry().tracesRays, 0u);
    EXPECT_EQ(entry().mode, uint32_t{VELLUM_SPIRV_MODE_TRUE});
}

TEST_F(Spirv, ReadsOnly)
{
    options.edit = VELLUM_SPIRV_EDIT_NONE;
    ASSERT_EQ(edit(), VELLUM_SUCCESS);
    EXPECT_EQ(info().changed, 0u);
    EXPECT_EQ(std::vector(info().words, info().words + info().wordCount), words);
    EXPECT_EQ(entry().mode, uint32_t{VELLUM_SPIRV_MODE_ABSENT});
}

TEST_F(Spirv, EnablesByConstantAndDisables)
{
    options.edit = VELLUM_SPIRV_EDIT_ENABLE_BY_CONSTANT;
    options.constantId = 12;
    options.constantDefault = 1;
    ASSERT_EQ(edit(), VELLUM_SUCCESS);
    EXPECT_EQ(entry().mode, uint32_t{VELLUM_SPIRV_MODE_CONSTANT});
    EXPECT_EQ(entry().constantId, 12u);
    EXPECT_EQ(entry().constantDefault, 1u);
    words.assign(info().words, info().words + info().wordCount);
    options.edit = VELLUM_SPIRV_EDIT_DISABLE;
    ASSERT_EQ(edit(), VELLUM_SUCCESS);
    EXPECT_EQ(info().changed, 1u);
    EXPECT_EQ(entry().mode, uint32_t{VELLUM_SPIRV_MODE_ABSENT});
}

TEST_F(Spirv, NamesEntryPoints)
{
    const char *const names[] = {"main", "other"};
    options.entryPoints = names;
    options.entryPointCount = 1;
    EXPECT_EQ(edit(), VELLUM_SUCCESS);
    options.entryPointCount = 2;
    expectError("the module: there is no entry point other; the module has main");
}

TEST_F(Spirv, RejectsWrongArguments)
{
    options.edit = 9;
    expectError("edit is 9, not a VellumSpirvEdit");
    options.edit = VELLUM_SPIRV_EDIT_ENABLE;
    options.constantDefault = 2;
    expectError("constantDefault is 2, not 0 or 1");
    options.constantDefault = 0;
    options.entryPointCount = 1;
    expectError("entryPoints is null");
    options.entryPointCount = 0;
    options.reserved = 1;
    expectError("reserved is not 0");
    options.reserved = 0;
    words[0] = 0;
    expectError("the module: not a SPIR-V module of this machine's byte order");
    EXPECT_EQ(vellumEditSpirv(nullptr, 0, &options, &spirv), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(message.text, "there are no words");
    EXPECT_EQ(vellumEditSpirv(words.data(), words.size(), &options, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
    VellumSpirvInfo unknown{};
    unknown.structSize = sizeof unknown;
    EXPECT_EQ(vellumGetSpirvInfo(nullptr, &unknown), VELLUM_ERROR_INVALID_ARGUMENT);
    vellumDestroySpirv(nullptr);
}

TEST_F(Spirv, RejectsMissingEntryPoints)
{
    ASSERT_EQ(edit(), VELLUM_SUCCESS);
    VellumSpirvEntryPointInfo values{};
    values.structSize = sizeof values;
    EXPECT_EQ(vellumGetSpirvEntryPointInfo(spirv, 1, &values), VELLUM_ERROR_INVALID_ARGUMENT);
}

} // namespace
