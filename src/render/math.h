// SPDX-License-Identifier: Apache-2.0
// The vector arithmetic that the renderer needs, and random numbers that are the same on every machine.
#pragma once

#include <cmath>
#include <cstdint>

#include "gltf/scene.h"

namespace vellum::render
{

constexpr float kPi = 3.14159265f;

inline Vec3 operator+(const Vec3 &a, const Vec3 &b)
{
    return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}

inline Vec3 operator-(const Vec3 &a, const Vec3 &b)
{
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

inline Vec3 operator*(const Vec3 &a, float s)
{
    return {a[0] * s, a[1] * s, a[2] * s};
}

inline float dot(const Vec3 &a, const Vec3 &b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

inline Vec3 cross(const Vec3 &a, const Vec3 &b)
{
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline float length(const Vec3 &a)
{
    return std::sqrt(dot(a, a));
}

// The direction of a vector; up for one of length 0.
inline Vec3 normalize(const Vec3 &a)
{
    const float l = length(a);
    return l > 1e-20f ? a * (1 / l) : Vec3{0, 1, 0};
}

struct Box {
    Vec3 low{1e30f, 1e30f, 1e30f};
    Vec3 high{-1e30f, -1e30f, -1e30f};

    void include(const Vec3 &p)
    {
        for (size_t i = 0; i < 3; ++i) {
            low[i] = std::fmin(low[i], p[i]);
            high[i] = std::fmax(high[i], p[i]);
        }
    }
    // One of the 8 corners.
    [[nodiscard]] Vec3 corner(unsigned i) const
    {
        return {(i & 1) != 0 ? high[0] : low[0], (i & 2) != 0 ? high[1] : low[1], (i & 4) != 0 ? high[2] : low[2]};
    }
    [[nodiscard]] Vec3 center() const { return (low + high) * 0.5f; }
    [[nodiscard]] Vec3 size() const { return high - low; }
};

// A turn about the vertical axis, a scale and a move: how copies of the scene are placed.
struct Placement {
    float angle = 0;
    float scale = 1;
    Vec3 offset{};

    [[nodiscard]] Vec3 apply(const Vec3 &p) const
    {
        const float c = std::cos(angle) * scale;
        const float s = std::sin(angle) * scale;
        return Vec3{c * p[0] + s * p[2], scale * p[1], c * p[2] - s * p[0]} + offset;
    }
    [[nodiscard]] Vec3 inverse(const Vec3 &p) const
    {
        const Vec3 q = (p - offset) * (1 / scale);
        const float c = std::cos(angle);
        const float s = std::sin(angle);
        return {c * q[0] - s * q[2], q[1], c * q[2] + s * q[0]};
    }
};

class Random
{
public:
    explicit Random(uint64_t seed) : state_(seed * 6364136223846793005u + 1442695040888963407u) { next(); }

    uint32_t next()
    {
        const uint64_t old = state_;
        state_ = old * 6364136223846793005u + 1442695040888963407u;
        const auto mixed = static_cast<uint32_t>(((old >> 18u) ^ old) >> 27u);
        const auto turn = static_cast<uint32_t>(old >> 59u);
        return (mixed >> turn) | (mixed << ((32 - turn) & 31));
    }
    // A value in [low, high).
    float between(float low, float high)
    {
        return low + (high - low) * static_cast<float>(next() >> 8) * (1.0f / 16777216.0f);
    }

private:
    uint64_t state_;
};

} // namespace vellum::render
