// SPDX-License-Identifier: Apache-2.0
// The integers of builds with VELLUM_PORTABLE have the values of the compiler's.
#include "bake/numbers/wide.h"

#include <gtest/gtest.h>
#include <random>
#include <vector>

namespace
{

__extension__ using Signed = __int128;
__extension__ using Unsigned = unsigned __int128;

// Of every length, and those at which carries go wrong.
std::vector<uint64_t> halves()
{
    std::mt19937_64 random(1);
    std::vector<uint64_t> values = {0, 1, 2, UINT64_MAX, uint64_t{1} << 63, 0xffffffff, uint64_t{1} << 32};
    for (int bits = 1; bits < 64; ++bits)
        for (const uint64_t value : {random() >> bits, ~(random() >> bits)})
            values.push_back(value);
    return values;
}

// The same number in both.
template <typename Half>
struct Both {
    using Native = std::conditional_t<std::is_signed_v<Half>, Signed, Unsigned>;
    using Portable = vellum::PortableWide<Half>;
    Native native;
    Portable portable;

    Both(uint64_t high, uint64_t low)
        : native(static_cast<Native>(static_cast<Unsigned>(high) << 64 | low)),
          portable((Portable(static_cast<Half>(high)) << 64) + (Portable(static_cast<Half>(low >> 1)) << 1) +
                   Portable(static_cast<Half>(low & 1)))
    {
    }
};

template <typename Half>
void expectSame(Unsigned native, vellum::PortableWide<Half> portable)
{
    ASSERT_EQ(static_cast<uint64_t>(native), static_cast<uint64_t>(static_cast<Half>(portable)));
    ASSERT_EQ(static_cast<uint64_t>(native >> 64), static_cast<uint64_t>(static_cast<Half>(portable >> 64)));
}

template <typename Half>
void testAll()
{
    using Native = typename Both<Half>::Native;
    const auto bits = [](Native value) { return static_cast<Unsigned>(value); };
    for (const uint64_t x : halves())
        for (const uint64_t y : halves()) {
            const Both<Half> a(x, y);
            const Both<Half> b(y >> 1, x);
            ASSERT_NO_FATAL_FAILURE(expectSame(bits(a.native), a.portable));
            ASSERT_NO_FATAL_FAILURE(expectSame(bits(a.native) + bits(b.native), a.portable + b.portable));
            ASSERT_NO_FATAL_FAILURE(expectSame(bits(a.native) - bits(b.native), a.portable - b.portable));
            ASSERT_NO_FATAL_FAILURE(expectSame(bits(a.native) * bits(b.native), a.portable * b.portable));
            ASSERT_EQ(a.native < b.native, a.portable < b.portable);
            ASSERT_EQ(a.native >= b.native, a.portable >= b.portable);
            ASSERT_EQ(a.native == b.native, a.portable == b.portable);
            const auto half = static_cast<Half>(x);
            ASSERT_NO_FATAL_FAILURE(expectSame(bits(half), vellum::PortableWide<Half>(half)));
            for (unsigned shift = 0; shift < 128; shift += 1 + static_cast<unsigned>(x % 31)) {
                ASSERT_NO_FATAL_FAILURE(expectSame(bits(a.native) << shift, a.portable << shift));
                ASSERT_NO_FATAL_FAILURE(expectSame(bits(a.native >> shift), a.portable >> shift));
            }
        }
}

TEST(WideInteger, SignedIsTheCompilers)
{
    testAll<int64_t>();
}

TEST(WideInteger, UnsignedIsTheCompilers)
{
    testAll<uint64_t>();
}

} // namespace
