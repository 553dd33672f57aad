#include "cli/camera.h"

#include <algorithm>

namespace vellum::cli
{

Camera fitCamera(const Box &box, const View &view, float aspect)
{
    const float yaw = view.yaw * kPi / 180;
    const float pitch = view.pitch * kPi / 180;
    const Vec3 forward = {-std::sin(yaw) * std::cos(pitch), -std::sin(pitch), -std::cos(yaw) * std::cos(pitch)};
    const Vec3 right = normalize(cross(forward, {0, 1, 0}));
    const Vec3 up = cross(right, forward);
    const float tall = std::tan(view.fieldOfView * 0.5f * kPi / 180);
    const float wide = tall * aspect;
    constexpr float kBorder = 0.94f;
    const Vec3 center = box.center();
    float distance = 0;
    for (unsigned corner = 0; corner < 8; ++corner) {
        const Vec3 p = Vec3{(corner & 1) != 0 ? box.high[0] : box.low[0], (corner & 2) != 0 ? box.high[1] : box.low[1],
                            (corner & 4) != 0 ? box.high[2] : box.low[2]} -
                       center;
        const float across = std::max(std::abs(dot(p, right)) / wide, std::abs(dot(p, up)) / tall) / kBorder;
        distance = std::max(distance, across - dot(p, forward));
    }
    Camera camera;
    camera.origin = center - forward * (distance / view.zoom);
    camera.forward = forward;
    camera.right = right * wide;
    camera.up = up * tall;
    return camera;
}

} // namespace vellum::cli
