// SPDX-License-Identifier: Apache-2.0
// The integers of builds with VELLUM_PORTABLE have the values of the compiler's.
#include "bake/numbers/wide.h"

#include <gtest/gtest.h>
#include <random>
#include <vector>

namespace
{

using vellum::PortableInt128;
__extension__ using Native = __int128;
__extension__ using UnsignedNative = unsigned __int128;

// Of every length, and those at which carries go wrong.
std::vector<int64_t> numbers()
{
    std::mt19937_64 random(1);
    std::vector<int64_t> values = {
        0, 1, -1, 2, INT64_MAX, INT64_MIN, INT64_MIN + 1, INT64_C(0xffffffff), INT64_C(1) << 32};
    for (int bits = 1; bits < 64; ++bits)
        values.push_back(static_cast<int64_t>(random()) >> bits);
    return values;
}

// The same value in both, of two halves.
struct Pair {
    Native native;
    PortableInt128 portable;
};

Pair pairOf(int64_t high, int64_t low)
{
    return {static_cast<Native>(static_cast<UnsignedNative>(high) << 64) + low,
            (PortableInt128(high) << 64) + PortableInt128(low)};
}

void expectSame(Native native, PortableInt128 portable)
{
    EXPECT_EQ(static_cast<int64_t>(native), static_cast<int64_t>(portable));
    const auto high = static_cast<int64_t>(native >> 64);
    // What is above the lower half, by what the class has: the difference to a number with that upper half.
    EXPECT_TRUE(portable - (PortableInt128(high) << 64) >= PortableInt128(0));
    EXPECT_TRUE(portable - (PortableInt128(high) << 64) < PortableInt128(1) << 64);
}

TEST(WideInteger, HasTheValuesOfTheCompilersOwn)
{
    for (const int64_t x : numbers())
        for (const int64_t y : numbers()) {
            const Pair a = pairOf(x, y);
            const Pair b = pairOf(y >> 1, x);
            const auto wrapped = [](UnsignedNative value) { return static_cast<Native>(value); };
            expectSame(a.native, a.portable);
            const auto left = static_cast<UnsignedNative>(a.native);
            const auto right = static_cast<UnsignedNative>(b.native);
            expectSame(wrapped(left + right), a.portable + b.portable);
            expectSame(wrapped(left - right), a.portable - b.portable);
            expectSame(wrapped(left * right), a.portable * b.portable);
            expectSame(static_cast<Native>(x) * y, PortableInt128(x) * PortableInt128(y));
            EXPECT_EQ(a.native < b.native, a.portable < b.portable);
            EXPECT_EQ(a.native >= b.native, a.portable >= b.portable);
            EXPECT_EQ(a.native == b.native, a.portable == b.portable);
        }
    for (const int64_t x : numbers())
        for (unsigned bits = 0; bits < 128; ++bits)
            expectSame(static_cast<Native>(static_cast<UnsignedNative>(x) << bits), PortableInt128(x) << bits);
}

TEST(WideInteger, MultipliesAndAddsWithoutOverflow)
{
    for (const int64_t a : numbers())
        for (const int64_t b : numbers())
            for (const int64_t c : {INT64_C(0), INT64_C(-1), a}) {
                const auto x = static_cast<uint64_t>(a);
                const auto y = static_cast<uint64_t>(b);
                const auto z = static_cast<uint64_t>(c);
                const UnsignedNative expected = static_cast<UnsignedNative>(x) * y + z + UINT64_MAX;
                for (const auto [low, high] :
                     {vellum::portableMultiplyAdd(x, y, z, UINT64_MAX), vellum::multiplyAdd(x, y, z, UINT64_MAX)}) {
                    EXPECT_EQ(low, static_cast<uint64_t>(expected));
                    EXPECT_EQ(high, static_cast<uint64_t>(expected >> 64));
                }
            }
}

} // namespace
