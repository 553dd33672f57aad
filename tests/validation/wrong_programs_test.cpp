// SPDX-License-Identifier: Apache-2.0
// Each wrong program is reported by its rule, and its right neighbour by none. With VELLUM_TEST_PROGRAM=wrong or right
// only one of them runs, without expectations: bench/validation shows what another layer reports.
#include <algorithm>
#include <cstring>
#include <sstream>

#include "programs.h"

namespace vt
{

// Printed by --gtest_list_tests, which bench/validation reads.
void PrintTo(const WrongProgram &program, std::ostream *out)
{
    *out << program.rule << ' ' << program.variant;
}

} // namespace vt

namespace
{

using namespace vt;

std::vector<WrongProgram> allPrograms()
{
    std::vector<WrongProgram> all;
    for (const auto &programs : {
             creationPrograms(),     buildPrograms(), attachmentPrograms(), copyPrograms(),
             queryPrograms(),        hostPrograms(),  implicitPrograms(),   hostStructurePrograms(),
             lifetimePrograms(),     rangePrograms(), rangeFlagPrograms(),  drawRangePrograms(),
             barrierRangePrograms(), dataPrograms(),  serializedPrograms(), pipelinePrograms(),
             pendingPrograms(),      syncPrograms(),  tracePrograms(),
         })
        all.insert(all.end(), programs.begin(), programs.end());
    return all;
}

Options optionsOf(const WrongProgram &program)
{
    const auto needs = [&program](ProgramNeeds need) { return (program.needs & need) != 0; };
    // With two validation layers, both would report the same.
    const bool another = validationOfTests() == Validation::Above;
    const char *quirks = needs(kNeedsTransferQueue) ? "queues" : needs(kNeedsFewFeatures) ? "few" : "";
    return {.validation = another,
            .quirks = quirks,
            .api = program.api,
            .bothApis = needs(kNeedsBothApis),
            .hostCommands = needs(kNeedsHostCommands),
            .fewFeatures = needs(kNeedsFewFeatures),
            .validate = !another,
            .shaderObject = needs(kNeedsShaderObjects),
            .newer = needs(kNeedsMaintenance5) || needs(kNeedsPlainShaders),
            .addressCommands = needs(kNeedsAddressCommands),
            .micromapFeature = !needs(kNeedsNoFeature),
            .shared = true,
            .declaresMode = !needs(kNeedsPlainShaders)};
}

// Prints the name of a case.
std::string nameOf(const testing::TestParamInfo<WrongProgram> &info)
{
    std::string name = info.param.rule + std::string(info.param.variant);
    std::erase_if(name, [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); });
    return name;
}

class WrongPrograms : public GpuTest, public testing::WithParamInterface<WrongProgram>
{
protected:
    WrongPrograms() : GpuTest(optionsOf(GetParam())) {}
    static void SetUpTestSuite()
    {
        setenv("VELLUM_TEST_SPY_MARKER", "1", 1);
        setenv("VELLUM_TEST_SPY_VENDORS", "1", 1);
    }
    static void TearDownTestSuite()
    {
        unsetenv("VELLUM_TEST_SPY_MARKER");
        unsetenv("VELLUM_TEST_SPY_VENDORS");
    }
    // The ids of the messages of Vellum since the last call, and the texts.
    std::vector<std::string> reported(std::string &texts)
    {
        std::vector<std::string> ids;
        for (const Message &m : gpu().takeMessages()) {
            texts += m.id + ": " + m.text + "\n";
            // The -without-micromaps messages are warnings: the fault matters only if rays hit micromaps.
            if (m.fromVellum() && !m.id.ends_with("-without-micromaps"))
                ids.push_back(m.id);
        }
        return ids;
    }
};

std::vector<std::string> expectedOf(const WrongProgram &program)
{
    std::vector<std::string> rules{program.rule};
    std::istringstream also(program.also);
    for (std::string rule; also >> rule;)
        rules.push_back(rule);
    for (std::string &rule : rules)
        rule.insert(0, "VELLUM-");
    std::ranges::sort(rules);
    return rules;
}

TEST_P(WrongPrograms, AreReported)
{
    const WrongProgram &program = GetParam();
    if ((program.needs & kNeedsPipelines) != 0 && !gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    if ((program.needs & kNeedsShaderObjects) != 0 && !gpu().has("VK_EXT_shader_object"))
        GTEST_SKIP() << "no shader objects";
    if ((program.needs & kNeedsMarkers) != 0 && gpu().vk().CmdWriteMarkerToMemoryAMD == nullptr)
        GTEST_SKIP() << "no buffer markers";
    if ((program.needs & kNeedsVendorCommands) != 0 &&
        vkGetDeviceProcAddr(gpu().device(), "vkCmdDispatchTileQCOM") == nullptr)
        GTEST_SKIP() << "no commands of other vendors";
    if (const char *one = std::getenv("VELLUM_TEST_PROGRAM")) {
        program.run(gpu(), std::strcmp(one, "wrong") == 0);
        VT_CHECK(vkDeviceWaitIdle(gpu().device()));
        gpu().takeMessages();
        return;
    }
    const char *quirks = std::getenv("VELLUM_TEST_QUIRKS");
    if ((program.needs & kNeedsEmulation) != 0 && quirks && *quirks)
        GTEST_SKIP() << "the driver's own micromaps";
    if (program.notWith && quirks && std::strcmp(quirks, program.notWith) == 0)
        GTEST_SKIP() << "not with this quirk of the mock driver";
    std::string texts;
    const auto run = [&](bool wrong) {
        program.run(gpu(), wrong);
        VT_CHECK(vkDeviceWaitIdle(gpu().device()));
        texts.clear();
        std::vector<std::string> ids = reported(texts);
        if (program.mayBeUnavailable)
            std::erase(ids, "VELLUM-not-available");
        return ids;
    };
    const std::vector<std::string> right = run(false);
    if (IsSkipped())
        return;
    EXPECT_EQ(right, std::vector<std::string>()) << "the right program: " << texts;
    std::vector<std::string> ids = run(true);
    if (program.perhaps)
        std::erase(ids, program.perhaps);
    std::ranges::sort(ids);
    EXPECT_EQ(ids, expectedOf(program)) << texts;
}

INSTANTIATE_TEST_SUITE_P(All, WrongPrograms, testing::ValuesIn(allPrograms()), nameOf);

} // namespace
