// SPDX-License-Identifier: Apache-2.0
// std::bit_cast, which the library of clang 14 does not have.
#pragma once

#include <cstring>
#include <type_traits>

namespace vellum
{

template <typename To, typename From>
To bitCast(const From &from)
{
    static_assert(sizeof(To) == sizeof(From));
    static_assert(std::is_trivially_copyable_v<To> && std::is_trivially_copyable_v<From>);
    To to;
    std::memcpy(&to, &from, sizeof to);
    return to;
}

} // namespace vellum
