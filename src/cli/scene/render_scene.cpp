// SPDX-License-Identifier: Apache-2.0
#include "cli/scene/render_scene.h"

#include <algorithm>

#include "cli/base/error.h"
#include "cli/scene/density.h"
#include "cli/scene/merge.h"

namespace vellum::cli
{
namespace
{

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

// How many there are of something in all instances.
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
    const bool leaves = record.kind == static_cast<uint32_t>(Kind::Leaves);
    for (size_t i = 0; i < packed.size(); ++i) {
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

// By geometry: where its first instance stands.
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

} // namespace vellum::cli
