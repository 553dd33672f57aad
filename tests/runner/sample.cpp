// SPDX-License-Identifier: Apache-2.0
// Cases of every kind, for the test of run_cases.py.
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <string_view>
#include <thread>

#include <gtest/gtest.h>

namespace
{

bool atExitFails = false;

TEST(Good, Passes) {}

TEST(Good, PrintsWithoutNewLine)
{
    std::cout << "no new line" << std::flush;
}

TEST(Bad, Fails)
{
    EXPECT_EQ(1 + 1, 3) << "what the failing case says";
}

TEST(Bad, PassesAfterTheFailure) {}

TEST(Bad, Crashes)
{
    std::cout << "last words" << std::endl;
    std::signal(SIGSEGV, SIG_DFL); // a sanitizer handles it
    std::raise(SIGSEGV);
}

TEST(Bad, PassesAfterTheCrash) {}

TEST(Bad, Hangs)
{
    for (;;) {
        std::cout << "still here" << std::endl;
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
}

TEST(Bad, Leaves)
{
    std::exit(0);
}

TEST(Bad, Skips)
{
    GTEST_SKIP() << "why it skips";
}

TEST(Bad, PassesInTheEnd) {}

TEST(Late, Passes) {}

// Like a leak that a sanitizer finds when the program ends.
TEST(Late, FailsAtTheEndOfTheProgram)
{
    atExitFails = true;
}

TEST(Skipped, Always)
{
    GTEST_SKIP() << "why it skips";
}

class WithParameter : public testing::TestWithParam<int>
{
};

TEST_P(WithParameter, IsTwo)
{
    EXPECT_EQ(GetParam(), 2);
}

INSTANTIATE_TEST_SUITE_P(Some, WithParameter, testing::Values(1, 2));

} // namespace

int main(int argc, char **argv)
{
    if (argc == 2 && std::string_view(argv[1]) == "--labels") {
        const char *labels = std::getenv("VELLUM_SAMPLE_LABELS");
        std::cout << (labels != nullptr
                          ? labels
                          : "Good.* fine\nBad.* odd\nBad.[!P]* broken\nBad.PassesInTheEnd broken\nLate.* slow\n");
        return 0;
    }
    testing::InitGoogleTest(&argc, argv);
    const int result = RUN_ALL_TESTS();
    return atExitFails ? 23 : result;
}
