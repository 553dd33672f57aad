// Four floats at once, where the processor can.
#pragma once

#ifdef __SSE2__
#include <emmintrin.h>
#else
#include <algorithm>
#include <cstddef>
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

    friend Float4 operator+(Float4 a, Float4 b) { return _mm_add_ps(a.v, b.v); }
    friend Float4 operator-(Float4 a, Float4 b) { return _mm_sub_ps(a.v, b.v); }
    friend Float4 operator*(Float4 a, Float4 b) { return _mm_mul_ps(a.v, b.v); }
    // As of SSE: the second where one of the two is not a number.
    friend Float4 min(Float4 a, Float4 b) { return _mm_min_ps(a.v, b.v); }
    friend Float4 max(Float4 a, Float4 b) { return _mm_max_ps(a.v, b.v); }
    // Bit k: a[k] >= b[k].
    friend unsigned atLeast(Float4 a, Float4 b)
    {
        return static_cast<unsigned>(_mm_movemask_ps(_mm_cmpge_ps(a.v, b.v)));
    }
    friend unsigned below(Float4 a, Float4 b)
    {
        return static_cast<unsigned>(_mm_movemask_ps(_mm_cmplt_ps(a.v, b.v)));
    }
    void store(float *to) const { _mm_storeu_ps(to, v); }
};

#else

struct Float4 {
    float v[4];

    Float4() = default;
    Float4(float all) : v{all, all, all, all} {}
    Float4(float a, float b, float c, float d) : v{a, b, c, d} {}

    template <typename Function> static Float4 each(const Float4 &a, const Float4 &b, Function &&function)
    {
        return {function(a.v[0], b.v[0]), function(a.v[1], b.v[1]), function(a.v[2], b.v[2]),
                function(a.v[3], b.v[3])};
    }
    friend Float4 operator+(Float4 a, Float4 b) { return each(a, b, [](float x, float y) { return x + y; }); }
    friend Float4 operator-(Float4 a, Float4 b) { return each(a, b, [](float x, float y) { return x - y; }); }
    friend Float4 operator*(Float4 a, Float4 b) { return each(a, b, [](float x, float y) { return x * y; }); }
    friend Float4 min(Float4 a, Float4 b) { return each(a, b, [](float x, float y) { return x < y ? x : y; }); }
    friend Float4 max(Float4 a, Float4 b) { return each(a, b, [](float x, float y) { return x > y ? x : y; }); }
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
    void store(float *to) const { std::copy_n(v, 4, to); }
};

#endif

} // namespace vellum
