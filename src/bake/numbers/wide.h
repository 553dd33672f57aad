// SPDX-License-Identifier: Apache-2.0
// Integers of 128 bits: the compiler's, or with VELLUM_PORTABLE, for compilers that have none, those of this file. Both
// have the same values.
#pragma once

#include <compare>
#include <cstdint>

namespace vellum
{

// With the operators that the baker uses, in two's complement; results that do not fit wrap around. Half is int64_t for
// signed integers, uint64_t for unsigned ones.
template <typename Half>
class PortableWide
{
public:
    constexpr PortableWide(Half value) : low_(static_cast<uint64_t>(value)), high_(value < 0 ? ~uint64_t{0} : 0) {}
    explicit constexpr operator Half() const { return static_cast<Half>(low_); }

    friend constexpr PortableWide operator+(PortableWide a, PortableWide b)
    {
        const uint64_t low = a.low_ + b.low_;
        return {low, a.high_ + b.high_ + (low < a.low_ ? 1 : 0)};
    }
    friend constexpr PortableWide operator-(PortableWide a, PortableWide b)
    {
        return {a.low_ - b.low_, a.high_ - b.high_ - (a.low_ < b.low_ ? 1 : 0)};
    }
    friend constexpr PortableWide operator*(PortableWide a, PortableWide b)
    {
        constexpr uint64_t kLow = 0xffffffff;
        const uint64_t lowest = (a.low_ & kLow) * (b.low_ & kLow);
        const uint64_t first = (a.low_ >> 32) * (b.low_ & kLow) + (lowest >> 32);
        const uint64_t second = (a.low_ & kLow) * (b.low_ >> 32) + (first & kLow);
        const uint64_t high = (a.low_ >> 32) * (b.low_ >> 32) + (first >> 32) + (second >> 32);
        return {second << 32 | (lowest & kLow), high + a.high_ * b.low_ + a.low_ * b.high_};
    }
    // By 0 to 127 bits.
    friend constexpr PortableWide operator<<(PortableWide a, unsigned bits)
    {
        if (bits >= 64)
            return {0, a.low_ << (bits - 64)};
        return bits == 0 ? a : PortableWide(a.low_ << bits, a.high_ << bits | a.low_ >> (64 - bits));
    }
    friend constexpr PortableWide operator>>(PortableWide a, unsigned bits)
    {
        const auto high = static_cast<Half>(a.high_);
        if (bits >= 64)
            return high >> (bits - 64);
        return bits == 0 ? a
                         : PortableWide(a.low_ >> bits | a.high_ << (64 - bits), static_cast<uint64_t>(high >> bits));
    }
    friend constexpr bool operator==(PortableWide a, PortableWide b) = default;
    friend constexpr std::strong_ordering operator<=>(PortableWide a, PortableWide b)
    {
        if (a.high_ != b.high_)
            return static_cast<Half>(a.high_) <=> static_cast<Half>(b.high_);
        return a.low_ <=> b.low_;
    }

private:
    constexpr PortableWide(uint64_t low, uint64_t high) : low_(low), high_(high) {}

    uint64_t low_;
    uint64_t high_;
};

#ifdef VELLUM_PORTABLE
using Int128 = PortableWide<int64_t>;
using Uint128 = PortableWide<uint64_t>;
#else
__extension__ using Int128 = __int128;
__extension__ using Uint128 = unsigned __int128;
#endif

} // namespace vellum
