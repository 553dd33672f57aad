// SPDX-License-Identifier: Apache-2.0
// Programs that end, or destroy their instance, without destroying their device: the layer must not do more than a
// driver would. Each program is a process of its own (end_program.cpp).
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <tuple>

#include <gtest/gtest.h>
#include <sys/wait.h>

namespace
{

using Case = std::tuple<const char *, int, const char *>;

class End : public testing::TestWithParam<Case>
{
};

TEST_P(End, ObjectsThatAreNotDestroyed)
{
    const auto &[way, threads, layers] = GetParam();
#if defined(__SANITIZE_ADDRESS__)
    if (threads > 0 && way == std::string_view("fork"))
        GTEST_SKIP() << "the sanitizer's allocator may be locked by another thread when a process forks";
#endif
    // Leaks are what the program is about, and not of interest.
    const std::string command = std::string("ASAN_OPTIONS=detect_leaks=0 VELLUM_TEST_MOCK_DRIVER=failures '") +
                                VELLUM_END_PROGRAM + "' " + way + ' ' + std::to_string(threads) + ' ' + layers;
    const int status = std::system(command.c_str());
    EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 77)
        GTEST_SKIP() << "the driver alone hangs when a forked process ends";
    EXPECT_EQ(WEXITSTATUS(status), 0);
}

// Wrong settings are reported once by a program, whatever number of instances it creates.
TEST(Settings, AreReportedOncePerProcess)
{
    const std::string command = std::string("VELLUM_NONSENSE=1 VELLUM_STRICT=perhaps '") + VELLUM_END_PROGRAM +
                                "' instances 3 VK_LAYER_VELLUM_opacity_micromap 2>&1";
    FILE *program = popen(command.c_str(), "r");
    ASSERT_NE(program, nullptr);
    std::string printed;
    for (int c = std::fgetc(program); c != EOF; c = std::fgetc(program))
        printed += static_cast<char>(c);
    EXPECT_EQ(pclose(program), 0) << printed;
    EXPECT_NE(printed.find("there is no setting VELLUM_NONSENSE"), std::string::npos) << printed;
    EXPECT_NE(printed.find("strict is \"perhaps\""), std::string::npos) << printed;
    EXPECT_EQ(std::ranges::count(printed, '\n'), 2) << printed;
}

// The driver is gone when the layer's exit handlers would run: layers/failure_quirk.cpp.
constexpr const char *kAboveADriver = "VK_LAYER_VELLUM_opacity_micromap VK_LAYER_VELLUM_test_mock_driver";
constexpr const char *kAlone = "VK_LAYER_VELLUM_opacity_micromap";
constexpr const char *kAboveValidation = "VK_LAYER_VELLUM_opacity_micromap VK_LAYER_KHRONOS_validation";

std::string nameOf(const testing::TestParamInfo<Case> &info)
{
    std::string name;
    bool capital = true;
    for (const char *c = std::get<0>(info.param); *c != 0; ++c) {
        if (*c != '_' && *c != '-')
            name += static_cast<char>(capital ? std::toupper(*c) : *c);
        else if (*c == '_')
            name += "Immediate";
        capital = *c == '-' || *c == '_';
    }
    return name + (std::get<1>(info.param) > 0 ? "WithThreads" : "") +
           (std::get<2>(info.param) == kAboveValidation ? "AboveValidation" : "") +
           (std::get<2>(info.param) == kAboveADriver ? "AboveADriver" : "");
}

INSTANTIATE_TEST_SUITE_P(
    Programs, End,
    testing::Combine(testing::Values("exit", "_exit", "fork", "instance", "dlclose", "dlclose-after-instance"),
                     testing::Values(0, 3), testing::Values(kAlone, kAboveValidation, kAboveADriver)),
    nameOf);
// Excluded above a validation layer: that of Debian 12 confuses the device with an earlier one of the same dispatch
// key.
INSTANTIATE_TEST_SUITE_P(SecondInstance, End,
                         testing::Combine(testing::Values("second-instance"), testing::Values(0, 3),
                                          testing::Values(kAlone)),
                         nameOf);

} // namespace
