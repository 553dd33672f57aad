// SPDX-License-Identifier: Apache-2.0
#include "render/camera.h"

#include <algorithm>

namespace vellum::render
{

Camera fitCamera(std::span<const Vec3> points, const View &view, float aspect)
{
    const float yaw = view.yaw * kPi / 180;
    const float pitch = view.pitch * kPi / 180;
    const Vec3 forward = {-std::sin(yaw) * std::cos(pitch), -std::sin(pitch), -std::cos(yaw) * std::cos(pitch)};
    const Vec3 right = normalize(cross(forward, {0, 1, 0}));
    const Vec3 up = cross(right, forward);
    constexpr float kBorder = 0.92f;
    const float tall = std::tan(view.fieldOfView * 0.5f * kPi / 180);
    const float wide = tall * aspect;

    // A point stays in the picture's left half-plane border while x >= -wide * (z + distance), and so on: for each
    // border the camera's place along it is bounded by one point, and two opposite borders give distance and middle.
    const auto extent = [&](const Vec3 &axis, float slope) {
        float low = 1e30f;
        float high = -1e30f;
        for (const Vec3 &p : points) {
            const float away = dot(p, forward) * slope * kBorder;
            low = std::min(low, dot(p, axis) + away);
            high = std::max(high, dot(p, axis) - away);
        }
        // middle and distance from the plane through the world's origin
        return std::array<float, 2>{0.5f * (low + high), 0.5f * (high - low) / (slope * kBorder)};
    };
    const auto across = extent(right, wide);
    const auto upward = extent(up, tall);
    const float distance = std::max(across[1], upward[1]);
    float depth = 0;
    for (const Vec3 &p : points)
        depth += dot(p, forward) / static_cast<float>(points.size());

    Camera camera;
    const float kept = (distance + depth) / view.zoom - depth;
    camera.origin = right * across[0] + up * upward[0] - forward * kept;
    camera.forward = forward;
    camera.right = right * wide;
    camera.up = up * tall;
    return camera;
}

} // namespace vellum::render
