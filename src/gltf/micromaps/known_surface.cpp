// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/known_surface.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "gltf/micromaps/state_counter.h"

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

// Adds up the surface by state.
class ShareSum
{
public:
    // `micromap` may be null.
    void add(const std::vector<double> &areas, const Micromap *micromap)
    {
        std::vector<std::array<double, 4>> shares;
        if (micromap != nullptr)
            shares = stateShares(micromap->triangles, micromap->data);
        for (size_t t = 0; t < areas.size(); ++t) {
            all_ += areas[t];
            if (micromap == nullptr || t >= micromap->indices.size()) {
                sum_.withoutMicromap += areas[t];
            } else if (const auto special = specialState(micromap->indices[t])) {
                sum_.states[static_cast<size_t>(*special)] += areas[t];
            } else {
                const auto record = static_cast<uint32_t>(micromap->indices[t]) + micromap->baseTriangle;
                for (size_t state = 0; state < 4; ++state)
                    sum_.states[state] += areas[t] * shares[record][state];
                if (micromap->triangles[record].format == Format::TwoState)
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
    for (size_t g = 0; g < areas->size(); ++g)
        sum.add((*areas)[g], (*areas)[g].empty() ? nullptr : micromapOf(g));
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

std::optional<SurfaceShares> surfaceShares(const SurfaceAreas &areas, const StoredMicromaps &stored)
{
    ShareSum sum;
    for (const auto &[place, its] : areas) {
        const std::optional<Micromap> micromap = stored.of(place);
        sum.add(its, micromap ? &*micromap : nullptr);
    }
    return sum.shares();
}

} // namespace vellum
