// SPDX-License-Identifier: Apache-2.0
// The functions for libraries without std::to_chars of floating point give what that gives.
#include <gtest/gtest.h>

#include <clocale>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>

#include "base/text.h"
#include "core/bit_cast.h"
#include "glb_file.h"

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

#ifndef _WIN32
// As in a program that has called setlocale().
TEST(RealText, TheLocaleOfTheProgramDoesNotMatter)
{
    const test::TemporaryFolder folder;
    const std::string made = "localedef -i de_DE -f UTF-8 " + (folder / "de_DE.UTF-8").string() + " > /dev/null 2>&1";
    if (std::setlocale(LC_NUMERIC, "de_DE.UTF-8") == nullptr && std::system(made.c_str()) == 0)
        setenv("LOCPATH", folder.path().c_str(), 1);
    if (std::setlocale(LC_NUMERIC, "de_DE.UTF-8") == nullptr)
        GTEST_SKIP() << "there is no locale with a decimal comma";
    EXPECT_STREQ(std::localeconv()->decimal_point, ",");
    for (const double number : {0.5, 1.25e-7, -1.25e30, 3e-320, 5e-324})
        expectSame(number);
    for (const char *text : {"0.5", "-1.5e2", "1.5e-400"}) {
        EXPECT_EQ(parseReal(text), std::optional(std::string_view(text) == "0.5" ? 0.5 : *text == '-' ? -150.0 : 0.0));
        EXPECT_EQ(plain::parseReal(text), parseReal(text)) << text;
    }
    EXPECT_EQ(plain::parseReal("0,5"), std::nullopt);
    std::setlocale(LC_NUMERIC, "C");
    unsetenv("LOCPATH");
}
#endif

} // namespace
