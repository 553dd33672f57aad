#include "bake/numbers/big_int.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace vellum
{
namespace
{

__extension__ using Wide = unsigned __int128;

[[noreturn]] void tooLarge()
{
    throw std::overflow_error("an exact predicate of the baker needs more digits than it has");
}

} // namespace

BigInt::BigInt(std::int64_t value) : m_size(value != 0 ? 1 : 0), m_negative(value < 0)
{
    m_limbs[0] = value < 0 ? 0 - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
}

BigInt &BigInt::operator=(const BigInt &other)
{
    m_size = other.m_size;
    m_negative = other.m_negative;
    std::copy_n(other.m_limbs.begin(), m_size, m_limbs.begin());
    return *this;
}

BigInt BigInt::scaled(double value, int exponent)
{
    int valueExponent = 0;
    const double fraction = std::frexp(value, &valueExponent); // |fraction| in [0.5, 1): 53 bits after the point
    auto mantissa = static_cast<std::int64_t>(std::ldexp(fraction, 53));
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
    result.m_negative = !m_negative;
    return result;
}

BigInt BigInt::operator<<(unsigned bits) const
{
    BigInt result;
    if (m_size == 0)
        return result;
    const unsigned limbs = bits / 64;
    const unsigned rest = bits % 64;
    if (m_size + limbs + 1 > kLimbs)
        tooLarge();
    std::fill_n(result.m_limbs.begin(), limbs, 0u);
    std::uint64_t carry = 0;
    for (unsigned i = 0; i < m_size; ++i) {
        result.m_limbs[limbs + i] = m_limbs[i] << rest | carry;
        carry = rest != 0 ? m_limbs[i] >> (64 - rest) : 0;
    }
    result.m_limbs[limbs + m_size] = carry;
    result.m_size = limbs + m_size + 1;
    result.m_negative = m_negative;
    result.trim();
    return result;
}

std::int64_t BigInt::floorShift(unsigned bits) const
{
    const unsigned limbs = bits / 64;
    const unsigned rest = bits % 64;
    const auto limb = [this](unsigned i) { return i < m_size ? m_limbs[i] : 0; };
    const std::uint64_t high = rest != 0 ? limb(limbs + 1) << (64 - rest) : 0;
    const auto whole = static_cast<std::int64_t>(limb(limbs) >> rest | high);
    if (!m_negative)
        return whole;
    bool remainder = limbs < m_size && (m_limbs[limbs] & ((std::uint64_t{1} << rest) - 1)) != 0;
    for (unsigned i = 0; i < std::min(limbs, m_size); ++i)
        remainder = remainder || m_limbs[i] != 0;
    return -whole - (remainder ? 1 : 0);
}

int BigInt::compareMagnitudes(const BigInt &a, const BigInt &b)
{
    if (a.m_size != b.m_size)
        return a.m_size < b.m_size ? -1 : 1;
    for (unsigned i = a.m_size; i-- > 0;)
        if (a.m_limbs[i] != b.m_limbs[i])
            return a.m_limbs[i] < b.m_limbs[i] ? -1 : 1;
    return 0;
}

void BigInt::trim()
{
    while (m_size > 0 && m_limbs[m_size - 1] == 0)
        --m_size;
}

BigInt operator+(const BigInt &a, const BigInt &b)
{
    const bool aLarger = BigInt::compareMagnitudes(a, b) >= 0;
    const BigInt &large = aLarger ? a : b;
    const BigInt &small = aLarger ? b : a;
    BigInt result;
    result.m_negative = large.m_negative;
    const bool add = a.m_negative == b.m_negative;
    std::uint64_t carry = 0; // or borrow
    for (unsigned i = 0; i < large.m_size; ++i) {
        const std::uint64_t x = large.m_limbs[i];
        const std::uint64_t y = i < small.m_size ? small.m_limbs[i] : 0;
        if (add) {
            const Wide sum = static_cast<Wide>(x) + y + carry;
            result.m_limbs[i] = static_cast<std::uint64_t>(sum);
            carry = static_cast<std::uint64_t>(sum >> 64);
        } else {
            const Wide difference = static_cast<Wide>(x) - y - carry;
            result.m_limbs[i] = static_cast<std::uint64_t>(difference);
            carry = (difference >> 64) != 0 ? 1 : 0;
        }
    }
    result.m_size = large.m_size;
    if (add && carry != 0) {
        if (result.m_size == BigInt::kLimbs)
            tooLarge();
        result.m_limbs[result.m_size++] = carry;
    }
    result.trim();
    return result;
}

BigInt operator*(const BigInt &a, const BigInt &b)
{
    BigInt result;
    if (a.m_size == 0 || b.m_size == 0)
        return result;
    if (a.m_size + b.m_size > BigInt::kLimbs)
        tooLarge();
    result.m_size = a.m_size + b.m_size;
    result.m_negative = a.m_negative != b.m_negative;
    std::fill_n(result.m_limbs.begin(), result.m_size, 0u);
    for (unsigned i = 0; i < a.m_size; ++i) {
        std::uint64_t carry = 0;
        for (unsigned k = 0; k < b.m_size; ++k) {
            const Wide sum = static_cast<Wide>(a.m_limbs[i]) * b.m_limbs[k] + result.m_limbs[i + k] + carry;
            result.m_limbs[i + k] = static_cast<std::uint64_t>(sum);
            carry = static_cast<std::uint64_t>(sum >> 64);
        }
        result.m_limbs[i + b.m_size] = carry;
    }
    result.trim();
    return result;
}

int compare(const BigInt &a, const BigInt &b)
{
    return (a - b).sign();
}

} // namespace vellum
