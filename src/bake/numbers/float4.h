// SPDX-License-Identifier: Apache-2.0
// Four floats at once, where the processor can.
#pragma once

#ifdef __SSE2__
#include <emmintrin.h>
#else
#include <algorithm>
#include <cstddef>
#include <cstdint>
#endif

namespace vellum
{

#ifdef __SSE2__

struct Float4 {
    __m128 v;

    Float4() = default;
    Float4(__m128 value) : v(value) {}
    Float4(float all) : v(_mm_set1_ps(all)) {}
    Float4(float a, float b, float c, float d) : v(_mm_setr_ps(a, b, c, d)) {}
    static Float4 load(const float *from) { return _mm_loadu_ps(from); }

    friend Float4 operator+(Float4 a, Float4 b) { return _mm_add_ps(a.v, b.v); }
    friend Float4 operator-(Float4 a, Float4 b) { return _mm_sub_ps(a.v, b.v); }
    friend Float4 operator*(Float4 a, Float4 b) { return _mm_mul_ps(a.v, b.v); }
    // Behaves like SSE: returns the second where one of the two is not a number.
    friend Float4 min(Float4 a, Float4 b) { return _mm_min_ps(a.v, b.v); }
    friend Float4 max(Float4 a, Float4 b) { return _mm_max_ps(a.v, b.v); }
    // Bit k: a[k] >= b[k].
    friend unsigned atLeast(Float4 a, Float4 b)
    {
        return static_cast<unsigned>(_mm_movemask_ps(_mm_cmpge_ps(a.v, b.v)));
    }
    friend unsigned below(Float4 a, Float4 b) { return static_cast<unsigned>(_mm_movemask_ps(_mm_cmplt_ps(a.v, b.v))); }
    friend Float4 operator/(Float4 a, Float4 b) { return _mm_div_ps(a.v, b.v); }
    // a[k] where x[k] < y[k], otherwise b[k].
    friend Float4 selectBelow(Float4 x, Float4 y, Float4 a, Float4 b)
    {
        const __m128 mask = _mm_cmplt_ps(x.v, y.v);
        return _mm_or_ps(_mm_and_ps(mask, a.v), _mm_andnot_ps(mask, b.v));
    }
    // Without their fractions; less than 2^31.
    friend Float4 truncated(Float4 a) { return _mm_cvtepi32_ps(_mm_cvttps_epi32(a.v)); }
    // The least and the largest of the four, none of which may be a NaN.
    [[nodiscard]] float least() const
    {
        const __m128 pairs = _mm_min_ps(v, _mm_movehl_ps(v, v));
        return _mm_cvtss_f32(_mm_min_ss(pairs, _mm_shuffle_ps(pairs, pairs, 1)));
    }
    [[nodiscard]] float most() const
    {
        const __m128 pairs = _mm_max_ps(v, _mm_movehl_ps(v, v));
        return _mm_cvtss_f32(_mm_max_ss(pairs, _mm_shuffle_ps(pairs, pairs, 1)));
    }
    void store(float *to) const { _mm_storeu_ps(to, v); }
};

#else

struct Float4 {
    float v[4];

    Float4() = default;
    Float4(float all) : v{all, all, all, all} {}
    Float4(float a, float b, float c, float d) : v{a, b, c, d} {}
    static Float4 load(const float *from) { return {from[0], from[1], from[2], from[3]}; }

    template <typename Function>
    static Float4 each(const Float4 &a, const Float4 &b, Function &&function)
    {
        return {function(a.v[0], b.v[0]), function(a.v[1], b.v[1]), function(a.v[2], b.v[2]), function(a.v[3], b.v[3])};
    }
    friend Float4 operator+(Float4 a, Float4 b)
    {
        return each(a, b, [](float x, float y) { return x + y; });
    }
    friend Float4 operator-(Float4 a, Float4 b)
    {
        return each(a, b, [](float x, float y) { return x - y; });
    }
    friend Float4 operator*(Float4 a, Float4 b)
    {
        return each(a, b, [](float x, float y) { return x * y; });
    }
    friend Float4 min(Float4 a, Float4 b)
    {
        return each(a, b, [](float x, float y) { return x < y ? x : y; });
    }
    friend Float4 max(Float4 a, Float4 b)
    {
        return each(a, b, [](float x, float y) { return x > y ? x : y; });
    }
    friend unsigned atLeast(const Float4 &a, const Float4 &b)
    {
        unsigned bits = 0;
        for (unsigned k = 0; k < 4; ++k)
            bits |= a.v[k] >= b.v[k] ? 1u << k : 0;
        return bits;
    }
    friend unsigned below(const Float4 &a, const Float4 &b)
    {
        unsigned bits = 0;
        for (unsigned k = 0; k < 4; ++k)
            bits |= a.v[k] < b.v[k] ? 1u << k : 0;
        return bits;
    }
    friend Float4 operator/(Float4 a, Float4 b)
    {
        return each(a, b, [](float x, float y) { return x / y; });
    }
    friend Float4 selectBelow(const Float4 &x, const Float4 &y, const Float4 &a, const Float4 &b)
    {
        return {x.v[0] < y.v[0] ? a.v[0] : b.v[0], x.v[1] < y.v[1] ? a.v[1] : b.v[1], x.v[2] < y.v[2] ? a.v[2] : b.v[2],
                x.v[3] < y.v[3] ? a.v[3] : b.v[3]};
    }
    friend Float4 truncated(const Float4 &a)
    {
        Float4 whole;
        for (size_t k = 0; k < 4; ++k)
            whole.v[k] = static_cast<float>(static_cast<int32_t>(a.v[k]));
        return whole;
    }
    [[nodiscard]] float least() const { return std::min(std::min(v[0], v[1]), std::min(v[2], v[3])); }
    [[nodiscard]] float most() const { return std::max(std::max(v[0], v[1]), std::max(v[2], v[3])); }
    void store(float *to) const { std::copy_n(v, 4, to); }
};

#endif

} // namespace vellum
