// A pinhole camera that sees a whole box.
#pragma once

#include "cli/math.h"

namespace vellum::cli
{

struct View {
    float yaw = 25;   // degrees about the vertical axis; 0 looks along -z
    float pitch = 6;  // degrees down
    float zoom = 1;   // above 1: closer
    float fieldOfView = 32; // degrees, vertical
};

struct Camera {
    Vec3 origin{};
    // The direction of the ray through the picture's point (x, y), both -1..1, y up: forward + x * right + y * up.
    Vec3 right{};
    Vec3 up{};
    Vec3 forward{};
};

// The camera that looks at the middle of `box` from just so far that all of it is in a picture of `aspect` (width by
// height), for a zoom of 1.
Camera fitCamera(const Box &box, const View &view, float aspect);

} // namespace vellum::cli
