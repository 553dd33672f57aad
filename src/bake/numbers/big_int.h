// SPDX-License-Identifier: Apache-2.0
// Exact integers of any size that the baker's predicates need: for the few decisions that rounding could get wrong.
#pragma once

#include <array>
#include <cstdint>

namespace vellum
{

// At most 64 * kLimbs bits and a sign. Larger results throw std::overflow_error.
class BigInt
{
public:
    // exact.cpp counts what its predicates need: 3,300 bits where every input is as bad as it can be.
    static constexpr unsigned kLimbs = 64;

    BigInt() = default;
    explicit BigInt(int64_t value);
    // value * 2^exponent, which must be an integer.
    static BigInt scaled(double value, int exponent);

    [[nodiscard]] int sign() const { return size_ == 0 ? 0 : negative_ ? -1 : 1; }
    [[nodiscard]] BigInt operator-() const;
    [[nodiscard]] BigInt operator<<(unsigned bits) const;
    // The largest integer that is not above this / 2^bits; it must fit.
    [[nodiscard]] int64_t floorShift(unsigned bits) const;

    friend BigInt operator+(const BigInt &a, const BigInt &b);
    friend BigInt operator-(const BigInt &a, const BigInt &b) { return a + -b; }
    friend BigInt operator*(const BigInt &a, const BigInt &b);

    BigInt(const BigInt &other) { *this = other; }
    BigInt &operator=(const BigInt &other);

private:
    [[nodiscard]] static int compareMagnitudes(const BigInt &a, const BigInt &b);
    void trim();

    unsigned size_ = 0; // limbs in use, the last of which is not 0
    bool negative_ = false;
    std::array<uint64_t, kLimbs> limbs_; // least significant first; undefined from size_ on
};

// The sign of a - b.
int compare(const BigInt &a, const BigInt &b);

} // namespace vellum
