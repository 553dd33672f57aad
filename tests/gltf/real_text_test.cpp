// SPDX-License-Identifier: Apache-2.0
// The functions for libraries without std::to_chars of floating point give what that gives.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/real_text.h"
#include "core/bit_cast.h"

using namespace vellum;

namespace
{

template <typename Real>
void expectSame(Real number)
{
    ASSERT_EQ(plain::shortestText(number), shortestText(number));
}

TEST(RealText, ShortestIsThatOfTheLibrary)
{
    std::mt19937_64 random(1);
    for (int i = 0; i < 20000; ++i) {
        const auto any = bitCast<double>(uint64_t{random()});
        if (std::isfinite(any))
            expectSame(any);
        const auto single = bitCast<float>(static_cast<uint32_t>(random()));
        if (std::isfinite(single))
            expectSame(single);
        expectSame(std::ldexp(static_cast<double>(random() % 100000), static_cast<int>(random() % 80) - 40));
        expectSame(static_cast<double>(static_cast<int64_t>(random())));
        expectSame(static_cast<double>(random() % 100000) / 1000);
        expectSame(static_cast<float>(random() % 100000) / 1000);
    }
    for (const double number : {0.0, -0.0, 1.0, -1.0, 0.1, 1e5, 1e6, 1e21, 1e22, 1e23, 1e-4, 1e-5, 123456789012345680.0,
                                std::numeric_limits<double>::max(), std::numeric_limits<double>::denorm_min()})
        expectSame(number);
    // The numbers below them are closer than those above.
    for (int exponent = -1074; exponent <= 1023; ++exponent) {
        expectSame(std::ldexp(1.0, exponent));
        expectSame(-std::ldexp(1.0, exponent));
        if (exponent >= -149 && exponent <= 127)
            expectSame(std::ldexp(1.0f, exponent));
    }
}

TEST(RealText, ReadsWhatTheLibraryReads)
{
    for (const char *text :
         {"0",  "-0", "1", "-1.5", "1e5",  "1E-5", "1e400", "-1e400", "1e-400", "0e-400", "0.0",
          "+1", "",   "-", "true", "0x10", " 1",   "1 ",    "1.5.2",  "5e-324", "1e",     "4.9e-325"}) {
        const auto expected = parseReal(text);
        const auto found = plain::parseReal(text);
        EXPECT_EQ(found.has_value(), expected.has_value()) << text;
        if (found && expected) {
            EXPECT_EQ(bitCast<uint64_t>(*found), bitCast<uint64_t>(*expected)) << text;
        }
    }
}

} // namespace
