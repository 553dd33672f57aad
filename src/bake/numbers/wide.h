// SPDX-License-Identifier: Apache-2.0
// Integers of 128 bits: the compiler's, or with VELLUM_PORTABLE, for compilers that have none, those of this file. Both
// have the same values.
#pragma once

#include <compare>
#include <cstdint>

namespace vellum
{

struct WideProduct {
    uint64_t low;
    uint64_t high;
};

// a * b + c + d, which always fits.
constexpr WideProduct portableMultiplyAdd(uint64_t a, uint64_t b, uint64_t c, uint64_t d)
{
    constexpr uint64_t kLow = 0xffffffff;
    const uint64_t lowest = (a & kLow) * (b & kLow) + (c & kLow) + (d & kLow);
    const uint64_t first = (a >> 32) * (b & kLow) + (c >> 32) + (lowest >> 32);
    const uint64_t second = (a & kLow) * (b >> 32) + (d >> 32) + (first & kLow);
    return {second << 32 | (lowest & kLow), (a >> 32) * (b >> 32) + (first >> 32) + (second >> 32)};
}

// In two's complement, with the operators that the baker uses. Results that do not fit wrap around.
class PortableInt128
{
public:
    constexpr PortableInt128(int64_t value)
        : low_(static_cast<uint64_t>(value)), high_(value < 0 ? ~uint64_t{0} : uint64_t{0})
    {
    }
    explicit constexpr operator int64_t() const { return static_cast<int64_t>(low_); }

    friend constexpr PortableInt128 operator+(PortableInt128 a, PortableInt128 b)
    {
        const uint64_t low = a.low_ + b.low_;
        return {low, a.high_ + b.high_ + (low < a.low_ ? 1 : 0)};
    }
    friend constexpr PortableInt128 operator-(PortableInt128 a, PortableInt128 b)
    {
        return {a.low_ - b.low_, a.high_ - b.high_ - (a.low_ < b.low_ ? 1 : 0)};
    }
    friend constexpr PortableInt128 operator*(PortableInt128 a, PortableInt128 b)
    {
        const WideProduct low = portableMultiplyAdd(a.low_, b.low_, 0, 0);
        return {low.low, low.high + a.high_ * b.low_ + a.low_ * b.high_};
    }
    // By 0 to 127 bits.
    friend constexpr PortableInt128 operator<<(PortableInt128 a, unsigned bits)
    {
        if (bits >= 64)
            return {0, a.low_ << (bits - 64)};
        return bits == 0 ? a : PortableInt128(a.low_ << bits, a.high_ << bits | a.low_ >> (64 - bits));
    }
    friend constexpr bool operator==(PortableInt128 a, PortableInt128 b) = default;
    friend constexpr std::strong_ordering operator<=>(PortableInt128 a, PortableInt128 b)
    {
        if (a.high_ != b.high_)
            return static_cast<int64_t>(a.high_) <=> static_cast<int64_t>(b.high_);
        return a.low_ <=> b.low_;
    }

private:
    constexpr PortableInt128(uint64_t low, uint64_t high) : low_(low), high_(high) {}

    uint64_t low_;
    uint64_t high_;
};

#ifdef VELLUM_PORTABLE
using Int128 = PortableInt128;
constexpr WideProduct multiplyAdd(uint64_t a, uint64_t b, uint64_t c, uint64_t d)
{
    return portableMultiplyAdd(a, b, c, d);
}
#else
__extension__ using Int128 = __int128;
constexpr WideProduct multiplyAdd(uint64_t a, uint64_t b, uint64_t c, uint64_t d)
{
    __extension__ using Wide = unsigned __int128;
    const Wide sum = static_cast<Wide>(a) * b + c + d;
    return {static_cast<uint64_t>(sum), static_cast<uint64_t>(sum >> 64)};
}
#endif

} // namespace vellum
