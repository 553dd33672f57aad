// SPDX-License-Identifier: Apache-2.0
// The subset of language that compiles both as C++20 and as GLSL 4.60. Headers that state a rule of the
// specification once, for the library, the oracle and the shaders, are written in it.
#ifndef VELLUM_CORE_SHARED_H
#define VELLUM_CORE_SHARED_H

#ifdef __cplusplus
#include <cstdint>
#define VELLUM_CONST inline constexpr
#define VELLUM_FN constexpr
// GLSL: a `const in` parameter is passed by value, which keeps linked functions free of local variables.
#define VELLUM_IN const
#define VELLUM_SHARED_BEGIN                                                                                            \
    namespace vellum::shared                                                                                           \
    {
#define VELLUM_SHARED_END }
namespace vellum::shared
{
using uint = uint32_t;
// Towards zero. What is below zero by less than 1 is 0; what does not fit is any number.
constexpr uint toUint(float x)
{
    return x > -2147483648.0f && x < 2147483648.0f ? static_cast<uint>(static_cast<int32_t>(x)) : 0;
}
constexpr float toFloat(uint x)
{
    return static_cast<float>(x);
}
} // namespace vellum::shared
#else
#define VELLUM_CONST const
#define VELLUM_FN
#define VELLUM_IN const in
#define VELLUM_SHARED_BEGIN
#define VELLUM_SHARED_END
#define toUint(x) uint(int(x)) // conversions of negative numbers to uint are undefined
#define toFloat(x) float(x)
#endif

#endif
