// SPDX-License-Identifier: Apache-2.0
// The faulty driver: each fault changes what an application sees, in a scene that is right without it.
#include "faulty_driver/cases/cases.h"

#include "harness/mock_driver.h"
#include "harness/program/labels.h"

#include <csignal>
#include <map>

#include <unistd.h>

namespace
{

const vt::Labels kFaultLabels{{"FaultyProcess.*", "one_api"}, {"Faults.*", "one_api"}};

using namespace vt;
using faults::Case;

std::vector<Case> allCases()
{
    std::vector<Case> all;
    for (const auto cases : {faults::attachmentCases(), faults::commandCases(), faults::copyCases(),
                             faults::instanceCases(), faults::micromapCases()})
        all.insert(all.end(), cases.begin(), cases.end());
    return all;
}

Options optionsOf(const Case &c, const char *fault)
{
    return {.validation = false,
            .spy = false,
            .quirks = c.quirks,
            .fault = fault,
            .api = c.api.value_or(apiOfTests()),
            .maintenance = true};
}

class Fault : public testing::TestWithParam<Case>
{
};

std::string observed(const Case &c, const char *fault)
{
    Gpu gpu(optionsOf(c, fault));
    setenv("VELLUM_TEST_FAULT", fault, 1); // for a second device (Device::twin)
    std::string seen = c.observe(gpu);
    unsetenv("VELLUM_TEST_FAULT");
    if (*fault != 0)
        gpu.takeMessages(); // a driver with a fault may report messages
    return seen;
}

TEST_P(Fault, Shows)
{
    const Case &c = GetParam();
    EXPECT_EQ(observed(c, ""), c.right);
    EXPECT_EQ(observed(c, c.fault), c.wrong);
}

std::string nameOf(const testing::TestParamInfo<Case> &info)
{
    std::string name = info.param.fault;
    std::replace(name.begin(), name.end(), '-', '_');
    return name;
}

INSTANTIATE_TEST_SUITE_P(All, Fault, testing::ValuesIn(allCases()), nameOf);

// --- whole processes ---

// The process ends with 0 unless the fault ends it before.
void runWith(const char *fault, unsigned secondsAllowed = 0)
{
    Gpu gpu({.validation = false, .spy = false, .fault = fault});
    alarm(secondsAllowed); // 0: none
    for (int i = 0; i < 22; ++i)
        gpu.submit([](VkCommandBuffer) {});
    std::_Exit(0);
}

class FaultyProcess : public testing::Test
{
protected:
    FaultyProcess() { GTEST_FLAG_SET(death_test_style, "threadsafe"); }
};

TEST_F(FaultyProcess, RunsWithoutFault)
{
    EXPECT_EXIT(runWith(""), testing::ExitedWithCode(0), "");
}

TEST_F(FaultyProcess, Hangs)
{
    EXPECT_EXIT(runWith("hangs", 3), testing::KilledBySignal(SIGALRM), "");
}

TEST_F(FaultyProcess, Dies)
{
    EXPECT_EXIT(runWith("dies"), testing::KilledBySignal(SIGABRT), "");
}

// --- the list ---

TEST(Faults, AllHaveCases)
{
    const Gpu gpu({.validation = false, .spy = false, .fault = "hangs"}); // loads the library
    const auto fault =
        testDriverFunction<const char *(*)(unsigned, unsigned)>("vellumFault", "libvellum_test_faulty_driver");
    std::map<std::string, std::string> missing; // and their quirks
    for (unsigned i = 0; fault(i, 0) != nullptr; ++i) {
        EXPECT_STRNE(fault(i, 1), "");
        EXPECT_STRNE(fault(i, 2), "");
        missing.emplace(fault(i, 0), fault(i, 3));
    }
    for (const Case &c : allCases()) {
        EXPECT_EQ(missing[c.fault], c.quirks) << c.fault;
        missing.erase(c.fault);
    }
    EXPECT_EQ(missing, (std::map<std::string, std::string>{{"dies", ""}, {"hangs", ""}})); // FaultyProcess
}

TEST(Faults, UnknownNamesAreRejected)
{
    EXPECT_THROW(Gpu({.validation = false, .spy = false, .fault = "nonsense"}), std::runtime_error);
}

} // namespace
