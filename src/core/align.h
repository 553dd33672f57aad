// SPDX-License-Identifier: Apache-2.0
// Rounding up to multiples.
#pragma once

#include <concepts>
#include <type_traits>

namespace vellum
{

// The least multiple of `alignment`, which need not be a power of two, that is not below `value`.
template <std::unsigned_integral T>
constexpr T alignUp(T value, std::type_identity_t<T> alignment)
{
    return (value + alignment - 1) / alignment * alignment;
}

} // namespace vellum
