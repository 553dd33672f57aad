// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/known_surface.h"

#include <algorithm>
#include <cmath>

namespace vellum
{
namespace
{

double areaOf(const Geometry &geometry, size_t triangle, const Transform &transform)
{
    std::array<Vec3, 3> corners;
    for (size_t i = 0; i < 3; ++i)
        corners[i] = transformed(transform, geometry.positions[geometry.indices[3 * triangle + i]]);
    std::array<double, 3> a{};
    std::array<double, 3> b{};
    for (size_t k = 0; k < 3; ++k) {
        a[k] = double{corners[1][k]} - corners[0][k];
        b[k] = double{corners[2][k]} - corners[0][k];
    }
    const std::array<double, 3> normal{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    const double area = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) / 2;
    return std::isfinite(area) ? area : 0;
}

// Instances let a small file have too many triangles in the world to examine; this is the limit.
constexpr size_t kMostKnownTriangles = size_t{1} << 27;

// The areas of each triangle of each alpha-tested geometry, in the world; nothing where there are too many.
std::optional<std::vector<std::vector<double>>> areasOf(const Scene &scene)
{
    std::vector<std::vector<double>> areas(scene.geometries.size());
    for (size_t g = 0; g < areas.size(); ++g)
        if (scene.materials[scene.geometries[g].material].masked())
            areas[g].resize(scene.geometries[g].indices.size() / 3);
    size_t done = 0;
    for (const MeshInstance &instance : scene.instances) {
        const Mesh &mesh = scene.meshes[instance.mesh];
        for (size_t g = mesh.firstGeometry; g < mesh.firstGeometry + mesh.geometryCount; ++g) {
            done += areas[g].size();
            if (done > kMostKnownTriangles)
                return std::nullopt;
            for (size_t t = 0; t < areas[g].size(); ++t)
                areas[g][t] += areaOf(scene.geometries[g], t, instance.transform);
        }
    }
    return areas;
}

// Of the triangles of a micromap.
using Shares = std::vector<std::array<double, 4>>;

// Adds up the surface by state.
class ShareSum
{
public:
    void addWithout(const std::vector<double> &areas)
    {
        for (const double area : areas) {
            all_ += area;
            sum_.withoutMicromap += area;
        }
    }

    // `indices`: of the triangles in a micromap with these shares, less `base`. `approximate`: special ones, too.
    void add(const std::vector<double> &areas, std::span<const int32_t> indices, uint32_t base,
             std::span<const MicromapTriangle> triangles, const Shares &shares, bool approximate)
    {
        for (size_t t = 0; t < areas.size(); ++t) {
            all_ += areas[t];
            if (t >= indices.size()) {
                sum_.withoutMicromap += areas[t];
            } else if (const auto special = specialState(indices[t])) {
                sum_.states[static_cast<size_t>(*special)] += areas[t];
                if (approximate && (*special == State::Opaque || *special == State::Transparent))
                    sum_.twoStates += areas[t];
            } else {
                const auto record = static_cast<uint32_t>(indices[t]) + base;
                for (size_t state = 0; state < 4; ++state)
                    sum_.states[state] += areas[t] * shares[record][state];
                if (triangles[record].format == Format::TwoState)
                    sum_.twoStates += areas[t];
            }
        }
    }

    [[nodiscard]] std::optional<SurfaceShares> shares() const
    {
        if (!(all_ > 0))
            return std::nullopt;
        SurfaceShares result = sum_;
        for (double &state : result.states)
            state /= all_;
        result.withoutMicromap /= all_;
        result.twoStates /= all_;
        return result;
    }

private:
    SurfaceShares sum_;
    double all_ = 0;
};

} // namespace

std::vector<std::array<double, 4>> stateShares(std::span<const MicromapTriangle> triangles,
                                               std::span<const uint8_t> data)
{
    std::vector<std::array<double, 4>> shares;
    shares.reserve(triangles.size());
    const StateCounter counter(data);
    for (const MicromapTriangle &triangle : triangles) {
        const StateCounts counts = counter.count(triangle);
        std::array<double, 4> &share = shares.emplace_back();
        for (size_t s = 0; s < 4; ++s)
            share[s] = static_cast<double>(counts[s]) / microTriangleCount(triangle.subdivisionLevel);
    }
    return shares;
}

std::optional<SurfaceShares> surfaceShares(const Scene &scene,
                                           const std::function<const Micromap *(size_t)> &micromapOf)
{
    const auto areas = areasOf(scene);
    if (!areas)
        return std::nullopt;
    ShareSum sum;
    for (size_t g = 0; g < areas->size(); ++g) {
        const std::vector<double> &its = (*areas)[g];
        if (const Micromap *micromap = its.empty() ? nullptr : micromapOf(g))
            sum.add(its, micromap->indices, micromap->baseTriangle, micromap->triangles,
                    stateShares(micromap->triangles, micromap->data), false);
        else
            sum.addWithout(its);
    }
    return sum.shares();
}

SurfaceAreas surfaceAreas(const Document &document)
{
    SurfaceAreas sums;
    double all = 0;
    try {
        const Scene scene = readScene(document, SceneUse::Measuring);
        const auto areas = areasOf(scene);
        for (size_t g = 0; areas && g < areas->size(); ++g) {
            const std::vector<double> &its = (*areas)[g];
            if (!scene.geometries[g].place || its.empty())
                continue;
            std::vector<double> &sum = sums[*scene.geometries[g].place];
            sum.resize(std::max(sum.size(), its.size()));
            for (size_t t = 0; t < its.size(); ++t) {
                sum[t] += its[t];
                all += its[t];
            }
        }
    } catch (const GltfError &) {
        return {};
    } catch (const std::bad_alloc &) { // of the scene's vertices; what is baked needs less
        return {};
    }
    return all > 0 ? sums : SurfaceAreas();
}

StoredShares::StoredShares(const StoredMicromaps &stored) : stored_(stored)
{
    for (const StoredMicromap &micromap : stored.micromaps)
        counted_.push_back({stateShares(micromap.triangles, micromap.data), micromap.isApproximate()});
}

std::optional<SurfaceShares> StoredShares::of(const SurfaceAreas &areas) const
{
    ShareSum sum;
    for (const auto &[place, its] : areas) {
        const auto found = stored_.primitives.find(place);
        if (found == stored_.primitives.end()) {
            sum.addWithout(its);
            continue;
        }
        const PrimitiveMicromap &primitive = found->second;
        const Counted &counted = counted_[primitive.micromap];
        sum.add(its, primitive.indices, primitive.baseTriangle, stored_.micromaps[primitive.micromap].triangles,
                counted.shares, counted.approximate);
    }
    return sum.shares();
}

} // namespace vellum
