// SPDX-License-Identifier: Apache-2.0
#include "cli/scene/density.h"

#include <algorithm>

namespace vellum::cli
{
namespace
{

constexpr int kDirections = 14;
constexpr uint64_t kEnough = 4'000'000; // triangles

// Directions over the upper hemisphere, evenly by the golden angle.
Vec3 direction(int i)
{
    const float y = (static_cast<float>(i) + 0.5f) / kDirections;
    const float r = std::sqrt(1 - y * y);
    const float angle = 2.39996323f * static_cast<float>(i);
    return {r * std::cos(angle), y, r * std::sin(angle)};
}

} // namespace

Density::Density(const Scene &scene, const Box &box)
{
    uint64_t triangles = 0;
    for (const MeshInstance &instance : scene.instances) {
        const Mesh &mesh = scene.meshes[instance.mesh];
        for (uint32_t i = 0; i < mesh.geometryCount; ++i)
            triangles += scene.geometries[mesh.firstGeometry + i].indices.size() / 3;
    }
    box_ = box;
    const Vec3 size = box_.size();
    cell_ = std::max({size[0], size[1], size[2], 1e-6f}) / kCells;
    for (size_t i = 0; i < 3; ++i)
        count_[i] = static_cast<int>(size[i] / cell_) + 1;
    area_.resize(static_cast<size_t>(count_[0] * count_[1] * count_[2]));
    // Each step-th of the triangles of all instances, one behind the other, stands for those after it.
    const uint64_t step = triangles / kEnough + 1;
    uint64_t next = 0;
    for (const MeshInstance &instance : scene.instances) {
        const Mesh &mesh = scene.meshes[instance.mesh];
        for (uint32_t i = 0; i < mesh.geometryCount; ++i) {
            const Geometry &g = scene.geometries[mesh.firstGeometry + i];
            // About half of a leaf card is leaf.
            const float share = (scene.materials[g.material].masked() ? 0.4f : 1.0f) * static_cast<float>(step);
            const uint64_t count = g.indices.size() / 3;
            for (; next < count; next += step)
                addTriangle(g, next, instance.transform, share);
            next -= count;
        }
    }
    blur();
}

void Density::addTriangle(const Geometry &g, uint64_t triangle, const Transform &transform, float share)
{
    const uint32_t *indices = &g.indices[3 * triangle];
    const Vec3 a = transformed(transform, g.positions[indices[0]]);
    const Vec3 b = transformed(transform, g.positions[indices[1]]);
    const Vec3 c = transformed(transform, g.positions[indices[2]]);
    const float area = share * 0.5f * length(cross(b - a, c - a));
    add((a + b + c) * (1.0f / 3), area * 0.25f);
    for (const Vec3 *corner : {&a, &b, &c})
        add(*corner * 0.5f + (a + b + c) * (1.0f / 6), area * 0.25f);
}

void Density::add(const Vec3 &point, float area)
{
    std::array<int, 3> c{};
    for (size_t i = 0; i < 3; ++i)
        c[i] = std::clamp(static_cast<int>((point[i] - box_.low[i]) / cell_), 0, count_[i] - 1);
    area_[static_cast<size_t>((c[2] * count_[1] + c[1]) * count_[0] + c[0])] += area / (cell_ * cell_ * cell_);
}

void Density::blur()
{
    const int strides[3] = {1, count_[0], count_[0] * count_[1]};
    for (size_t axis = 0; axis < 3; ++axis) {
        const std::vector<float> before = area_;
        for (size_t i = 0; i < area_.size(); ++i) {
            const int place = (static_cast<int>(i) / strides[axis]) % count_[axis];
            const auto step = static_cast<size_t>(strides[axis]);
            const float left = place > 0 ? before[i - step] : 0;
            const float right = place + 1 < count_[axis] ? before[i + step] : 0;
            area_[i] = 0.5f * before[i] + 0.25f * (left + right);
        }
    }
}

float Density::at(const Vec3 &point) const
{
    int base[3];
    float part[3];
    for (size_t i = 0; i < 3; ++i) {
        const float x = (point[i] - box_.low[i]) / cell_ - 0.5f;
        if (!(x > -1) || !(x < static_cast<float>(count_[i])))
            return 0;
        base[i] = static_cast<int>(std::floor(x));
        part[i] = x - static_cast<float>(base[i]);
    }
    float sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const int x = base[0] + (corner & 1);
        const int y = base[1] + ((corner >> 1) & 1);
        const int z = base[2] + (corner >> 2);
        if (x < 0 || y < 0 || z < 0 || x >= count_[0] || y >= count_[1] || z >= count_[2])
            continue;
        const float weight = ((corner & 1) != 0 ? part[0] : 1 - part[0]) *
                             (((corner >> 1) & 1) != 0 ? part[1] : 1 - part[1]) *
                             ((corner >> 2) != 0 ? part[2] : 1 - part[2]);
        sum += weight * area_[static_cast<size_t>((z * count_[1] + y) * count_[0] + x)];
    }
    return sum;
}

float Density::skyVisibility(const Vec3 &point) const
{
    float seen = 0;
    for (int i = 0; i < kDirections; ++i) {
        const Vec3 along = direction(i);
        float depth = 0;
        // The first cell is the surface's own.
        for (float t = 1.5f; t < 1.8f * kCells; t += 1.25f)
            depth += at(point + along * (t * cell_));
        // Randomly turned leaves cover half of their area.
        seen += std::exp(-0.5f * depth * 1.25f * cell_);
    }
    return seen / kDirections;
}

Vec3 Density::outward(const Vec3 &point) const
{
    Vec3 gradient{};
    for (size_t i = 0; i < 3; ++i) {
        Vec3 step{};
        step[i] = 1.5f * cell_;
        gradient[i] = at(point - step) - at(point + step);
    }
    return gradient;
}

} // namespace vellum::cli
