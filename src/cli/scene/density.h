// SPDX-License-Identifier: Apache-2.0
// How much geometry there is where, coarsely: for soft ambient light, and normals that make a crown look round.
#pragma once

#include <vector>

#include "cli/scene/math.h"

namespace vellum::cli
{

class Density
{
public:
    // `box`: around all instances.
    Density(const Scene &scene, const Box &box);

    // How much of the sky is seen from a point, 0..1, by marching through the grid in some directions.
    [[nodiscard]] float skyVisibility(const Vec3 &point) const;
    // Away from where there is more geometry; not normalised.
    [[nodiscard]] Vec3 outward(const Vec3 &point) const;

private:
    static constexpr int kCells = 40; // along the longest side

    [[nodiscard]] float at(const Vec3 &point) const;
    void addTriangle(const Geometry &g, uint64_t triangle, const Transform &transform, float share);
    void add(const Vec3 &point, float area);
    void blur();

    Box box_;
    float cell_ = 1;
    std::array<int, 3> count_{};
    std::vector<float> area_; // per volume, in 1 / length
};

} // namespace vellum::cli
