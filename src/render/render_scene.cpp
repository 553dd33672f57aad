// SPDX-License-Identifier: Apache-2.0
#include "render/render_scene.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace vellum::render
{
namespace
{

bool flattens(const Transform &m)
{
    double volume = 1; // if the axes were at right angles
    for (size_t column = 0; column < 3; ++column)
        volume *= std::hypot(static_cast<double>(m[0][column]), static_cast<double>(m[1][column]),
                             static_cast<double>(m[2][column]));
    return !(std::abs(determinant(m)) > 1e-9 * volume);
}

// A transform that flattens, with so little thickness that nobody sees it, as those of instances must have an inverse
// (VUID-VkTransformMatrixKHR-matrix-03799). One that flattens into a line or a point stays: nothing can be seen of it.
Transform thickened(Transform m)
{
    const auto column = [&](size_t i) { return Vec3{m[0][i], m[1][i], m[2][i]}; };
    const auto row = [&](size_t i) { return Vec3{m[i][0], m[i][1], m[i][2]}; };
    Vec3 normal{}; // of the plane
    Vec3 lost{};   // the direction that becomes nothing
    float longest = 0;
    for (size_t i = 0; i < 3; ++i) {
        const size_t j = (i + 1) % 3;
        longest = std::max(longest, length(column(i)));
        if (const Vec3 c = cross(column(i), column(j)); length(c) > length(normal))
            normal = c;
        if (const Vec3 c = cross(row(i), row(j)); length(c) > length(lost))
            lost = c;
    }
    if (!(length(normal) > 1e-4f * longest * longest))
        return m;
    normal = normalize(normal);
    lost = normalize(lost);
    for (size_t i = 0; i < 3; ++i)
        for (size_t k = 0; k < 3; ++k)
            m[i][k] += 1e-4f * longest * normal[i] * lost[k];
    return m;
}

// Mirrored meshes stay apart: their triangles wind the other way round in the world.
bool merges(const MeshInstance &instance, const std::vector<uint32_t> &counts)
{
    return counts[instance.mesh] == 1 && (determinant(instance.transform) > 0 || flattens(instance.transform));
}

std::vector<uint32_t> countInstances(const Scene &scene)
{
    std::vector<uint32_t> counts(scene.meshes.size());
    for (const MeshInstance &instance : scene.instances)
        ++counts[instance.mesh];
    return counts;
}

// Merges all meshes that have one instance and are not mirrored into the first mesh, in the world's space, so that rays
// visit one structure and not many that overlap. Of meshes with several, removes instances of which nothing can be
// seen.
void mergeSingleMeshes(Scene &scene)
{
    std::vector<uint32_t> counts = countInstances(scene);
    for (MeshInstance &i : scene.instances)
        if (counts[i.mesh] > 1 && flattens(i.transform))
            i.transform = thickened(i.transform);
    std::erase_if(scene.instances, [&](const MeshInstance &i) { return counts[i.mesh] > 1 && flattens(i.transform); });
    counts = countInstances(scene);

    std::vector<Geometry> geometries;
    const auto take = [&](const Mesh &mesh) {
        for (uint32_t i = 0; i < mesh.geometryCount; ++i)
            geometries.push_back(std::move(scene.geometries[mesh.firstGeometry + i]));
    };
    std::vector<MeshInstance> instances;
    for (const MeshInstance &instance : scene.instances) {
        if (!merges(instance, counts))
            continue;
        counts[instance.mesh] = 0; // has gone
        const size_t first = geometries.size();
        take(scene.meshes[instance.mesh]);
        for (size_t i = first; i < geometries.size() && instance.transform != kInPlace; ++i)
            for (Vec3 &position : geometries[i].positions)
                position = transformed(instance.transform, position);
    }
    std::vector<Mesh> meshes;
    if (!geometries.empty()) {
        meshes.push_back({0, static_cast<uint32_t>(geometries.size())});
        instances.push_back({0, kInPlace});
    }
    std::vector<uint32_t> moved(scene.meshes.size());
    for (size_t i = 0; i < scene.meshes.size(); ++i) {
        if (counts[i] == 0)
            continue;
        moved[i] = static_cast<uint32_t>(meshes.size());
        meshes.push_back({static_cast<uint32_t>(geometries.size()), scene.meshes[i].geometryCount});
        take(scene.meshes[i]);
    }
    for (const MeshInstance &instance : scene.instances)
        if (counts[instance.mesh] != 0)
            instances.push_back({moved[instance.mesh], instance.transform});
    scene.geometries = std::move(geometries);
    scene.meshes = std::move(meshes);
    scene.instances = std::move(instances);
}

constexpr int kDirections = 14;
constexpr uint64_t kEnoughTriangles = 4'000'000; // triangles

// Directions over the upper hemisphere, evenly by the golden angle.
Vec3 direction(int i)
{
    const float y = (static_cast<float>(i) + 0.5f) / kDirections;
    const float r = std::sqrt(1 - y * y);
    const float angle = 2.39996323f * static_cast<float>(i);
    return {r * std::cos(angle), y, r * std::sin(angle)};
}

// A coarse grid of the amount of geometry, for soft ambient light, and normals that make a crown look round.
class Density
{
public:
    // `box`: around all instances.
    Density(const Scene &scene, const Box &box);

    // The share of the sky that is visible from a point, 0..1, by marching through the grid in some directions.
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
    const uint64_t step = triangles / kEnoughTriangles + 1;
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

constexpr size_t kMostInstances = size_t{1} << 22;

uint32_t packNormal(const Vec3 &normal, float visibility)
{
    const float sum = std::abs(normal[0]) + std::abs(normal[1]) + std::abs(normal[2]);
    float x = normal[0] / sum;
    float y = normal[1] / sum;
    if (normal[2] < 0) {
        const float old = x;
        x = (1 - std::abs(y)) * (x >= 0 ? 1.0f : -1.0f);
        y = (1 - std::abs(old)) * (y >= 0 ? 1.0f : -1.0f);
    }
    const auto twelve = [](float f) { return static_cast<uint32_t>(std::lround((f * 0.5f + 0.5f) * 4095)); };
    const auto eight = static_cast<uint32_t>(std::lround(std::clamp(visibility, 0.0f, 1.0f) * 255));
    return twelve(x) | twelve(y) << 12 | eight << 24;
}

// A direction of the world, as a normal, in the space of what stands there: by the inverse of how the shader takes
// normals the other way.
Vec3 turnedBack(const Transform &place, const Vec3 &normal)
{
    Vec3 result{};
    for (size_t column = 0; column < 3; ++column)
        for (size_t row = 0; row < 3; ++row)
            result[column] += place[row][column] * normal[row];
    return result;
}

// The sum of a count over all instances.
template <typename Count>
uint64_t drawn(const Scene &scene, Count &&count)
{
    std::vector<uint64_t> ofMesh;
    for (const Mesh &mesh : scene.meshes) {
        ofMesh.push_back(0);
        for (uint32_t i = 0; i < mesh.geometryCount; ++i)
            ofMesh.back() += count(scene.geometries[mesh.firstGeometry + i]);
    }
    uint64_t sum = 0;
    for (const MeshInstance &instance : scene.instances)
        sum += ofMesh[instance.mesh];
    return sum;
}

// Normals by the area-weighted mean of the triangles at each vertex.
std::vector<Vec3> smoothNormals(const Geometry &g)
{
    std::vector<Vec3> normals(g.positions.size(), Vec3{});
    for (size_t i = 0; i + 2 < g.indices.size(); i += 3) {
        const Vec3 &a = g.positions[g.indices[i]];
        const Vec3 normal = cross(g.positions[g.indices[i + 1]] - a, g.positions[g.indices[i + 2]] - a);
        for (size_t k = 0; k < 3; ++k)
            normals[g.indices[i + k]] = normals[g.indices[i + k]] + normal;
    }
    for (Vec3 &n : normals)
        n = normalize(n);
    return normals;
}

// `place`: where an instance of it stands, the one whose surroundings light it.
void addGeometry(RenderScene &result, const Geometry &g, const GeometryRecord &record, const Density &density,
                 const Transform &place)
{
    std::vector<Vec3> normals = smoothNormals(g);
    std::vector<uint32_t> packed(g.positions.size());
    std::vector<bool> done(g.positions.size());
    const bool leaves = record.kind == static_cast<uint32_t>(Kind::Leaves);
    for (const uint32_t i : g.indices) {
        if (done[i])
            continue;
        done[i] = true;
        const Vec3 p = transformed(place, g.positions[i]);
        float visibility = 1;
        if (record.kind == static_cast<uint32_t>(Kind::Ground)) {
            for (const Placement &copy : result.copies)
                visibility *= density.skyVisibility(copy.inverse(p));
        } else {
            visibility = density.skyVisibility(p);
        }
        if (leaves) {
            // The card's own direction only ruffles that of the crown's surface.
            const Vec3 out = normalize(turnedBack(place, density.outward(p)));
            const Vec3 own = dot(normals[i], out) < 0 ? normals[i] * -1.0f : normals[i];
            normals[i] = normalize(out * 0.6f + own * 0.4f);
        }
        packed[i] = packNormal(normals[i], visibility);
    }
    result.records.push_back(record);
    result.records.back().firstTriangle = static_cast<uint32_t>(result.normals.size() / 3);
    if (!g.alphas.empty()) {
        result.records.back().firstAlpha = static_cast<int32_t>(result.alphas.size());
        for (const uint32_t index : g.indices)
            result.alphas.push_back(g.alphas[index]);
    }
    for (const uint32_t index : g.indices) {
        result.normals.push_back(packed[index]);
        result.uvs.push_back(g.uvs[index].u);
        result.uvs.push_back(g.uvs[index].v);
    }
}

Box boxOf(const Geometry &g)
{
    Box box;
    for (const Vec3 &p : g.positions)
        box.include(p);
    return box;
}

std::vector<Box> boxesOf(const Scene &scene)
{
    std::vector<Box> boxes;
    for (const Geometry &g : scene.geometries)
        boxes.push_back(boxOf(g));
    return boxes;
}

// The box around all instances, of the geometries that `wanted` accepts.
template <typename Wanted>
Box boxOfInstances(const Scene &scene, const std::vector<Box> &boxes, Wanted &&wanted)
{
    Box all;
    for (const MeshInstance &instance : scene.instances) {
        const Mesh &mesh = scene.meshes[instance.mesh];
        for (uint32_t i = mesh.firstGeometry; i < mesh.firstGeometry + mesh.geometryCount; ++i)
            if (wanted(scene.geometries[i]))
                for (unsigned corner = 0; corner < 8; ++corner)
                    all.include(transformed(instance.transform, boxes[i].corner(corner)));
    }
    return all;
}

// The height that things stand on: the lowest point of what is solid; leaf cards may hang lower.
float groundHeight(const Scene &scene, const std::vector<Box> &boxes, const Box &all)
{
    const Box solid =
        boxOfInstances(scene, boxes, [&](const Geometry &g) { return !scene.materials[g.material].masked(); });
    return solid.low[1] < 1e29f ? solid.low[1] : all.low[1];
}

std::vector<Placement> placeCopies(uint32_t copies, const Box &box)
{
    std::vector<Placement> placements;
    auto side = static_cast<uint32_t>(std::ceil(std::sqrt(static_cast<double>(copies))));
    const Vec3 center = box.center();
    const float step = 0.9f * std::max(box.size()[0], box.size()[2]);
    for (uint32_t i = 0; i < copies; ++i) {
        Placement p;
        if (copies > 1) {
            const float x = static_cast<float>(i % side) - 0.5f * static_cast<float>(side - 1);
            const float z = static_cast<float>(i / side) - 0.5f * static_cast<float>(side - 1);
            p.angle = 2.39996323f * static_cast<float>(i);
            p.scale = 0.85f + 0.3f * static_cast<float>((i * 7) % 9) / 8.0f;
            // Turned and scaled about the foot of the scene's own axis, which then stands on the grid.
            p.offset = {x * step, box.low[1] * (1 - p.scale), z * step};
            const Vec3 turned = Placement{p.angle, p.scale, {}}.apply({center[0], 0, center[2]});
            p.offset = p.offset - Vec3{turned[0], 0, turned[2]};
        }
        placements.push_back(p);
    }
    return placements;
}

// Fine cells under the scene, where light and shadow change, and long ones out to the horizon.
Geometry makeGround(const Box &bounds, float height)
{
    constexpr int kFine = 72;
    const Vec3 center = bounds.center();
    const float reach = std::max({bounds.size()[0], bounds.size()[2], 0.5f * bounds.size()[1], 1e-3f});
    std::vector<float> steps = {-60, -12, -3.5f};
    for (int i = 0; i <= kFine; ++i)
        steps.push_back(-1.4f + 2.8f * static_cast<float>(i) / kFine);
    steps.insert(steps.end(), {3.5f, 12, 60});
    Geometry ground;
    for (const float z : steps) {
        for (const float x : steps) {
            ground.positions.push_back({center[0] + x * reach, height, center[2] + z * reach});
            ground.uvs.push_back({});
        }
    }
    const auto columns = static_cast<uint32_t>(steps.size());
    for (uint32_t j = 0; j + 1 < columns; ++j) {
        for (uint32_t i = 0; i + 1 < columns; ++i) {
            const uint32_t a = j * columns + i;
            const uint32_t c = a + columns;
            ground.indices.insert(ground.indices.end(), {a, c, a + 1, a + 1, c, c + 1});
        }
    }
    return ground;
}

// Enough points to see how the scene looks from any side.
std::vector<Vec3> findOutline(const RenderScene &scene, float height)
{
    constexpr size_t kEnough = 60000;
    const uint64_t step =
        drawn(scene.scene, [](const Geometry &g) { return g.positions.size(); }) * scene.copies.size() / kEnough + 1;
    std::vector<Vec3> points;
    const auto add = [&](const Vec3 &p) {
        points.push_back(p);
        points.back()[1] = std::max(points.back()[1], height);
    };
    uint64_t next = 0; // of the points of all instances, one behind the other
    for (const Placement &copy : scene.copies) {
        for (const MeshInstance &instance : scene.scene.instances) {
            const Mesh &mesh = scene.scene.meshes[instance.mesh];
            for (uint32_t i = 0; i < mesh.geometryCount; ++i) {
                const std::vector<Vec3> &positions = scene.scene.geometries[mesh.firstGeometry + i].positions;
                for (; next < positions.size(); next += step)
                    add(copy.apply(transformed(instance.transform, positions[next])));
                next -= positions.size();
            }
        }
    }
    return points;
}

// By geometry: the transform of its first instance.
std::vector<Transform> placesOf(const Scene &scene)
{
    std::vector<Transform> places(scene.geometries.size(), kInPlace);
    for (auto instance = scene.instances.rbegin(); instance != scene.instances.rend(); ++instance) {
        const Mesh &mesh = scene.meshes[instance->mesh];
        std::fill_n(places.begin() + mesh.firstGeometry, mesh.geometryCount, instance->transform);
    }
    return places;
}

} // namespace

uint64_t RenderScene::maskedTriangles() const
{
    return drawn(scene,
                 [&](const Geometry &g) { return scene.materials[g.material].masked() ? g.indices.size() / 3 : 0; });
}

uint64_t RenderScene::solidTriangles() const
{
    return drawn(scene,
                 [&](const Geometry &g) { return scene.materials[g.material].masked() ? 0 : g.indices.size() / 3; });
}

RenderScene prepareScene(Scene scene, uint32_t copies)
{
    RenderScene result;
    result.scene = std::move(scene);
    mergeSingleMeshes(result.scene);
    if (result.scene.instances.empty())
        throw Error("there is nothing to see: every mesh is flattened by its transforms");
    if (result.scene.instances.size() * copies > kMostInstances)
        throw Error("there are too many instances: " + std::to_string(result.scene.instances.size()) + " in " +
                    std::to_string(copies) + " copies, more than " + std::to_string(kMostInstances) + " in all");
    const std::vector<Box> boxes = boxesOf(result.scene);
    const Box box = boxOfInstances(result.scene, boxes, [](const Geometry &) { return true; });
    const float height = groundHeight(result.scene, boxes, box);
    Box standing = box;
    standing.low[1] = height;
    result.copies = placeCopies(copies, standing);
    Box above = box;
    above.low[1] = std::max(box.low[1], height);
    for (const Placement &copy : result.copies)
        for (unsigned corner = 0; corner < 8; ++corner)
            result.bounds.include(copy.apply(above.corner(corner)));
    result.ground = makeGround(result.bounds, height);
    result.outline = findOutline(result, height);

    std::vector<int32_t> textureOf;
    for (size_t i = 0; i < result.scene.materials.size(); ++i) {
        const bool textured = result.scene.materials[i].image >= 0;
        textureOf.push_back(textured ? static_cast<int32_t>(result.texturedMaterials.size()) : -1);
        if (textured)
            result.texturedMaterials.push_back(static_cast<uint32_t>(i));
    }
    const Density density(result.scene, box);
    const std::vector<Transform> places = placesOf(result.scene);
    for (size_t i = 0; i < result.scene.geometries.size(); ++i) {
        const Geometry &g = result.scene.geometries[i];
        const Material &m = result.scene.materials[g.material];
        const Kind kind = m.masked() ? Kind::Leaves : Kind::Solid;
        addGeometry(result, g,
                    {0,
                     textureOf[g.material],
                     m.alphaCutoff,
                     static_cast<uint32_t>(kind),
                     {m.baseColor[0], m.baseColor[1], m.baseColor[2], m.baseColor[3]},
                     -1,
                     {}},
                    density, places[i]);
    }
    addGeometry(result, result.ground, {0, -1, 0, static_cast<uint32_t>(Kind::Ground), {1, 1, 1, 1}, -1, {}}, density,
                kInPlace);
    return result;
}

} // namespace vellum::render
