// SPDX-License-Identifier: Apache-2.0
// A pinhole camera that sees all of a scene.
#pragma once

#include <span>

#include "render/math.h"

namespace vellum::render
{

struct View {
    float yaw = 25;         // degrees about the vertical axis; 0 looks along -z
    float pitch = 3;        // degrees down
    float zoom = 1;         // above 1: closer
    float fieldOfView = 32; // degrees, vertical
};

struct Camera {
    Vec3 origin{};
    // The direction of the ray through the picture's point (x, y), both -1..1, y up: forward + x * right + y * up.
    Vec3 right{};
    Vec3 up{};
    Vec3 forward{};
};

// The camera that looks from just so far that all `points` are in a picture of `aspect` (width by height), in the
// middle of it, for a zoom of 1.
Camera fitCamera(std::span<const Vec3> points, const View &view, float aspect);

} // namespace vellum::render
