// SPDX-License-Identifier: Apache-2.0
// The output of `vellum render --mode compare` about times; the times themselves are not checked.
#include <cstdio>

#include "rendering.h"

using namespace vellum::test;

namespace
{

// The values in the line that states a ratio.
struct Ratio {
    char median[16] = {};
    char low[16] = {};
    char high[16] = {};
    unsigned pairs = 0;
};

class Comparing : public Rendering
{
protected:
    Ratio compare(std::vector<std::string> options)
    {
        options.insert(options.end(), {"--mode", "compare", "--level", "2", "--output", (folder / "a.png").string()});
        outcome = render(std::move(options));
        Ratio r;
        const int read =
            std::sscanf(lineOf(outcome, "time ratio").c_str(),
                        "time ratio %15[0-9.] (omm/alpha), the median of %u pairs of frames; half of the pairs lie "
                        "between %15[0-9.] and %15[0-9.]",
                        r.median, &r.pairs, r.low, r.high);
        EXPECT_EQ(read, 4) << outcome.output;
        return r;
    }

    Outcome outcome;
};

} // namespace

TEST_F(Comparing, RequestedNumberOfPairs)
{
    const Ratio r = compare({"--frames", "4"});
    EXPECT_EQ(r.pairs, 4u);
    EXPECT_GT(std::atof(r.median), 0);
    EXPECT_LE(std::atof(r.low), std::atof(r.median));
    EXPECT_GE(std::atof(r.high), std::atof(r.median));
    // The table has no ratio of times: that of its medians may contradict this one.
    EXPECT_TRUE(lineOf(outcome, "| frame, ms").ends_with("|           |")) << outcome.output;
    const size_t wrote = outcome.output.find("\nwrote ");
    ASSERT_NE(wrote, std::string::npos) << outcome.output;
    EXPECT_LT(wrote, outcome.output.find("time ratio"));
    EXPECT_TRUE(std::filesystem::exists(folder / "a.png"));
    EXPECT_TRUE(std::filesystem::exists(folder / "a-alpha.png"));
}

TEST_F(Comparing, DefaultNumberOfPairs)
{
    const Ratio r = compare({});
    EXPECT_GE(r.pairs, 9u);
    EXPECT_LE(r.pairs, 99u);
}
