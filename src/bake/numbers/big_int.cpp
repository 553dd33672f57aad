// SPDX-License-Identifier: Apache-2.0
#include "bake/numbers/big_int.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "bake/numbers/wide.h"

namespace vellum
{
namespace
{

[[noreturn]] void tooLarge()
{
    throw std::overflow_error("an exact predicate of the baker needs more digits than it has");
}

} // namespace

BigInt::BigInt(int64_t value) : size_(value != 0 ? 1 : 0), negative_(value < 0)
{
    limbs_[0] = value < 0 ? 0 - static_cast<uint64_t>(value) : static_cast<uint64_t>(value);
}

BigInt &BigInt::operator=(const BigInt &other)
{
    size_ = other.size_;
    negative_ = other.negative_;
    std::copy_n(other.limbs_.begin(), size_, limbs_.begin());
    return *this;
}

BigInt BigInt::scaled(double value, int exponent)
{
    int valueExponent = 0;
    const double fraction = std::frexp(value, &valueExponent); // |fraction| in [0.5, 1): 53 bits after the point
    auto mantissa = static_cast<int64_t>(std::ldexp(fraction, 53));
    int shift = valueExponent - 53 + exponent;
    for (; shift < 0 && mantissa % 2 == 0 && mantissa != 0; ++shift)
        mantissa /= 2;
    if (mantissa == 0)
        return {};
    if (shift < 0)
        throw std::invalid_argument("a number of an exact predicate of the baker has too many digits");
    return BigInt(mantissa) << static_cast<unsigned>(shift);
}

BigInt BigInt::operator-() const
{
    BigInt result = *this;
    result.negative_ = !negative_;
    return result;
}

BigInt BigInt::operator<<(unsigned bits) const
{
    BigInt result;
    if (size_ == 0)
        return result;
    const unsigned limbs = bits / 64;
    const unsigned rest = bits % 64;
    if (size_ + limbs + 1 > kLimbs)
        tooLarge();
    std::fill_n(result.limbs_.begin(), limbs, 0u);
    uint64_t carry = 0;
    for (unsigned i = 0; i < size_; ++i) {
        result.limbs_[limbs + i] = limbs_[i] << rest | carry;
        carry = rest != 0 ? limbs_[i] >> (64 - rest) : 0;
    }
    result.limbs_[limbs + size_] = carry;
    result.size_ = limbs + size_ + 1;
    result.negative_ = negative_;
    result.trim();
    return result;
}

int64_t BigInt::floorShift(unsigned bits) const
{
    const unsigned limbs = bits / 64;
    const unsigned rest = bits % 64;
    const auto limb = [this](unsigned i) { return i < size_ ? limbs_[i] : 0; };
    const uint64_t high = rest != 0 ? limb(limbs + 1) << (64 - rest) : 0;
    const auto whole = static_cast<int64_t>(limb(limbs) >> rest | high);
    if (!negative_)
        return whole;
    bool remainder = limbs < size_ && (limbs_[limbs] & ((uint64_t{1} << rest) - 1)) != 0;
    for (unsigned i = 0; i < std::min(limbs, size_); ++i)
        remainder = remainder || limbs_[i] != 0;
    return -whole - (remainder ? 1 : 0);
}

int BigInt::compareMagnitudes(const BigInt &a, const BigInt &b)
{
    if (a.size_ != b.size_)
        return a.size_ < b.size_ ? -1 : 1;
    for (unsigned i = a.size_; i-- > 0;)
        if (a.limbs_[i] != b.limbs_[i])
            return a.limbs_[i] < b.limbs_[i] ? -1 : 1;
    return 0;
}

void BigInt::trim()
{
    while (size_ > 0 && limbs_[size_ - 1] == 0)
        --size_;
}

BigInt operator+(const BigInt &a, const BigInt &b)
{
    const bool aLarger = BigInt::compareMagnitudes(a, b) >= 0;
    const BigInt &large = aLarger ? a : b;
    const BigInt &small = aLarger ? b : a;
    BigInt result;
    result.negative_ = large.negative_;
    const bool add = a.negative_ == b.negative_;
    uint64_t carry = 0; // or borrow
    for (unsigned i = 0; i < large.size_; ++i) {
        const uint64_t x = large.limbs_[i];
        const uint64_t y = i < small.size_ ? small.limbs_[i] : 0;
        if (add) {
            const Uint128 sum = static_cast<Uint128>(x) + y + carry;
            result.limbs_[i] = static_cast<uint64_t>(sum);
            carry = static_cast<uint64_t>(sum >> 64);
        } else {
            const Uint128 difference = static_cast<Uint128>(x) - y - carry;
            result.limbs_[i] = static_cast<uint64_t>(difference);
            carry = (difference >> 64) != 0 ? 1 : 0;
        }
    }
    result.size_ = large.size_;
    if (add && carry != 0) {
        if (result.size_ == BigInt::kLimbs)
            tooLarge();
        result.limbs_[result.size_++] = carry;
    }
    result.trim();
    return result;
}

BigInt operator*(const BigInt &a, const BigInt &b)
{
    BigInt result;
    if (a.size_ == 0 || b.size_ == 0)
        return result;
    if (a.size_ + b.size_ > BigInt::kLimbs)
        tooLarge();
    result.size_ = a.size_ + b.size_;
    result.negative_ = a.negative_ != b.negative_;
    std::fill_n(result.limbs_.begin(), result.size_, 0u);
    for (unsigned i = 0; i < a.size_; ++i) {
        uint64_t carry = 0;
        for (unsigned k = 0; k < b.size_; ++k) {
            const Uint128 sum = static_cast<Uint128>(a.limbs_[i]) * b.limbs_[k] + result.limbs_[i + k] + carry;
            result.limbs_[i + k] = static_cast<uint64_t>(sum);
            carry = static_cast<uint64_t>(sum >> 64);
        }
        result.limbs_[i + b.size_] = carry;
    }
    result.trim();
    return result;
}

int compare(const BigInt &a, const BigInt &b)
{
    return (a - b).sign();
}

} // namespace vellum
