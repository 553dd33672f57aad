// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/random_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "check/oracle/scene_build.h"

namespace vellum::check::oracle
{
namespace
{

float between(Random &random, float low, float high)
{
    return low + (high - low) * static_cast<float>(random() >> 8) / 16777216.0f;
}

Vec3 point(Random &random, float size)
{
    return {between(random, -size, size), between(random, -size, size), between(random, -size, size)};
}

SceneMicromap randomMicromap(Random &random, uint32_t triangles, const Limits &limits)
{
    SceneMicromap micromap;
    for (uint32_t i = 0; i < triangles; ++i)
        micromap.triangles.push_back(randomTriangle(random, limits.maxLevel));
    // A triangle has the first states of another of a higher level: both may have the same dataOffset.
    if (chance(random, 30)) {
        const MicromapTriangle &fine = micromap.triangles[below(random, triangles)];
        MicromapTriangle &coarse = micromap.triangles[below(random, triangles)];
        if (coarse.level < fine.level)
            coarse = {.level = coarse.level,
                      .format = fine.format,
                      .states = {fine.states.begin(), fine.states.begin() + std::ssize(coarse.states)}};
    }
    constexpr std::array<uint32_t, 3> flags{0, VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT,
                                            VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT};
    micromap.flags = flags[below(random, flags.size())];
    if (chance(random, 30))
        micromap.flags |= VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
    // VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712
    if (limits.lossy && chance(random, 70)) {
        for (MicromapTriangle &triangle : micromap.triangles) {
            while (triangle.format != kFourState)
                triangle = randomTriangle(random, limits.maxLevel);
        }
        micromap.flags |= kLossy;
    }
    if (chance(random, 25))
        micromap.triangleStride = randomTriangleStride(random, limits.oddStrides);
    micromap.usagePointers = chance(random, 30);
    return micromap;
}

// Turned, stretched, sometimes mirrored, moved.
VkTransformMatrixKHR randomTransform(Random &random)
{
    double x = 1, y = 0, z = 0, w = 0, length = 0;
    do {
        const Vec3 q = point(random, 1);
        x = double{q[0]}, y = double{q[1]}, z = double{q[2]}, w = double{between(random, -1, 1)};
        length = std::sqrt(x * x + y * y + z * z + w * w);
    } while (length < 0.1);
    x /= length, y /= length, z /= length, w /= length;
    const double rotation[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                                   {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                                   {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    const Vec3 place = point(random, 2);
    VkTransformMatrixKHR out{};
    for (size_t c = 0; c < 3; ++c) {
        double scale = double{between(random, 0.5f, 1.8f)};
        if (chance(random, 20))
            scale = -scale;
        for (size_t r = 0; r < 3; ++r)
            out.matrix[r][c] = static_cast<float>(rotation[r][c] * scale);
    }
    for (size_t r = 0; r < 3; ++r)
        out.matrix[r][3] = place[r];
    return out;
}

uint32_t multipleOf(Random &random, uint32_t unit, uint32_t least, uint32_t most)
{
    const uint32_t first = (least + unit - 1) / unit;
    return unit * (first + below(random, most / unit - first + 1));
}

MeshLayout boxLayout(Random &random)
{
    MeshLayout layout;
    if (chance(random, 60))
        layout.stride = multipleOf(random, 8, sizeof(VkAabbPositionsKHR), 64);
    if (chance(random, 60))
        layout.primitiveOffset = multipleOf(random, 8, 8, 96);
    return layout;
}

MeshLayout triangleLayout(Random &random, const Limits &limits)
{
    MeshLayout layout;
    if (chance(random, 60))
        layout.vertexFormat = limits.formats[below(random, static_cast<uint32_t>(limits.formats.size()))];
    const VertexFormat format = vertexFormat(layout.vertexFormat);
    if (chance(random, 50))
        layout.stride = multipleOf(random, format.alignment, format.bytes, 64);
    constexpr std::array types{VK_INDEX_TYPE_NONE_KHR, VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32};
    layout.indexType = types[below(random, types.size())];
    layout.firstVertex = chance(random, 30) ? 1 + below(random, 20) : 0;
    const uint32_t stride = layout.stride != 0 ? layout.stride : format.bytes;
    uint32_t unit = format.alignment, triangleBytes = 3 * stride;
    if (layout.isIndexed()) {
        unit = layout.indexType == VK_INDEX_TYPE_UINT32 ? 4 : 2;
        triangleBytes = 3 * unit;
        // Some have all of 16 bits.
        layout.firstIndex = chance(random, 30) ? 1 + below(random, chance(random, 10) ? 50000 : 50) : 0;
        layout.separate = chance(random, 20);
        layout.order = chance(random, 60) ? 1 + below(random, 1000) : 0;
    }
    if (chance(random, 40))
        layout.primitiveOffset =
            chance(random, 60) ? triangleBytes * (1 + below(random, 5)) : multipleOf(random, unit, unit, 100);
    if (chance(random, 40)) {
        layout.transform = randomTransform(random);
        layout.transformOffset = chance(random, 40) ? multipleOf(random, 16, 16, 128) : 0;
    }
    return layout;
}

// The triangles that follow are of all kinds, within -3.5 and 3.5.

// Anywhere; in shared meshes, some corners are those of others.
void addSoup(Random &random, std::vector<Vec3> &vertices, uint32_t triangles, bool shared)
{
    for (uint32_t i = 0; i < triangles; ++i) {
        const Vec3 centre = point(random, 2);
        for (int k = 0; k < 3; ++k) {
            if (shared && !vertices.empty() && chance(random, 30)) {
                vertices.push_back(vertices[below(random, static_cast<uint32_t>(vertices.size()))]);
                continue;
            }
            const Vec3 offset = point(random, 1.5f);
            vertices.push_back({centre[0] + offset[0], centre[1] + offset[1], centre[2] + offset[2]});
        }
    }
}

// A patch of a height field, whose triangles share their corners and come in any order.
void addPatch(Random &random, std::vector<Vec3> &vertices, uint32_t triangles)
{
    uint32_t columns = 1;
    while (2 * columns * columns < triangles)
        ++columns;
    const float step = 6 / static_cast<float>(columns);
    std::vector<Vec3> points;
    for (uint32_t i = 0; i < (columns + 1) * (columns + 1); ++i)
        points.push_back({-3 + step * (static_cast<float>(i % (columns + 1)) + between(random, -0.15f, 0.15f)),
                          -3 + step * (static_cast<float>(i / (columns + 1)) + between(random, -0.15f, 0.15f)),
                          between(random, -1, 1)});
    std::vector<std::array<uint32_t, 3>> all;
    for (uint32_t y = 0; y < columns; ++y)
        for (uint32_t x = 0; x < columns; ++x) {
            const uint32_t at = y * (columns + 1) + x;
            all.push_back({at, at + 1, at + columns + 1});
            all.push_back({at + columns + 2, at + columns + 1, at + 1});
        }
    for (uint32_t i = 0; i < triangles; ++i) {
        std::swap(all[i], all[i + below(random, static_cast<uint32_t>(all.size()) - i)]);
        const uint32_t first = below(random, 3);
        for (uint32_t k = 0; k < 3; ++k)
            vertices.push_back(points[all[i][(first + k) % 3]]);
    }
}

// A solid with shared vertices: an octahedron that is rotated and scaled.
void addSolid(Random &random, std::vector<Vec3> &vertices, uint32_t triangles)
{
    const VkTransformMatrixKHR turn = randomTransform(random);
    std::array<Vec3, 6> points{}; // on the axes
    for (size_t p = 0; p < 6; ++p) {
        const float size = (p % 2 == 0 ? 1.0f : -1.0f) * between(random, 0.7f, 1.2f);
        for (size_t k = 0; k < 3; ++k)
            points[p][k] = turn.matrix[k][p / 2] * size;
    }
    const uint32_t first = below(random, 8);
    for (uint32_t i = 0; i < std::min(triangles, 8u); ++i) {
        const uint32_t octant = (first + i) % 8;
        for (uint32_t axis = 0; axis < 3; ++axis)
            vertices.push_back(points[2 * axis + (octant >> axis & 1)]);
    }
    if (triangles > 8)
        addSoup(random, vertices, triangles - 8, false);
}

// Some triangles become degenerate, or inactive where the format has NaN.
void spoil(Random &random, std::vector<Vec3> &vertices, const MeshLayout &layout, const Limits &limits)
{
    for (size_t t = 0; t + 2 < vertices.size(); t += 3) {
        Vec3 *const corners = &vertices[t];
        const uint32_t corner = below(random, 3);
        switch (below(random, 24)) {
        case 0: corners[corner] = corners[(corner + 1) % 3]; break;
        case 1: corners[0] = corners[1] = corners[2]; break;
        case 2: // a line along an axis, which a transform could turn
            for (size_t k = 0; k < 3 && !layout.transform; ++k)
                for (size_t axis = 0; axis < 2; ++axis)
                    corners[k][(corner + axis) % 3] = corners[0][(corner + axis) % 3];
            break;
        case 3:
        case 4:
            if (limits.inactive && vertexFormat(layout.vertexFormat).isFloat())
                corners[corner][0] = std::numeric_limits<float>::quiet_NaN();
            break;
        default: break;
        }
    }
}

std::vector<Vec3> randomVertices(Random &random, uint32_t triangles, const MeshLayout &layout, bool unusual,
                                 const Limits &limits)
{
    const VertexFormat format = vertexFormat(layout.vertexFormat);
    std::vector<Vec3> vertices;
    // A flat soup would hide what is met: most of its hits are equally far.
    if (format.components == 2 || (layout.isIndexed() && chance(random, 40)))
        addPatch(random, vertices, triangles);
    else if (layout.isIndexed() && chance(random, 40))
        addSolid(random, vertices, triangles);
    else
        addSoup(random, vertices, triangles, layout.isIndexed());
    for (Vec3 &vertex : vertices) {
        for (float &value : vertex) {
            value = format.isFloat() ? value : value / 3.5f;
            value = format.isUnsigned() ? 0.5f + 0.5f * value : value;
        }
        vertex = quantized(layout.vertexFormat, vertex);
    }
    if (unusual)
        spoil(random, vertices, layout, limits);
    return vertices;
}

std::vector<VkAabbPositionsKHR> randomBoxes(Random &random, uint32_t count, bool mayBeInactive)
{
    std::vector<VkAabbPositionsKHR> boxes;
    for (uint32_t i = 0; i < count; ++i) {
        const Vec3 centre = point(random, 2);
        const float size = between(random, 0.1f, 0.7f);
        boxes.push_back({centre[0] - size, centre[1] - size, centre[2] - size, centre[0] + size, centre[1] + size,
                         centre[2] + size});
        if (mayBeInactive && chance(random, 15))
            boxes.back().minX = std::numeric_limits<float>::quiet_NaN();
    }
    return boxes;
}

// most: triangles
Mesh randomMesh(Random &random, Scene &scene, bool boxes, uint32_t most, const Limits &limits)
{
    Mesh mesh{.opaque = chance(random, 50), .noDuplicates = chance(random, 30)};
    const bool unusual = chance(random, limits.unusual);
    const uint32_t count = unusual && chance(random, 12) ? 0 : 1 + below(random, boxes ? 5 : most);
    if (unusual)
        mesh.layout = boxes ? boxLayout(random) : triangleLayout(random, limits);
    if (boxes) {
        mesh.boxes = randomBoxes(random, count, unusual && limits.inactive);
        return mesh;
    }
    mesh.vertices = randomVertices(random, count, mesh.layout, unusual, limits);
    if (limits.micromaps && chance(random, 75)) {
        // A micromap with an entry for each triangle and some more, of which a base may skip some; or one that other
        // meshes use as well.
        if (scene.micromaps.empty() || chance(random, 80))
            scene.micromaps.push_back(randomMicromap(random, std::max(count + below(random, 7), 1u), limits));
        mesh.micromap = randomUse(random, scene, count, limits);
    }
    return mesh;
}

Object randomObject(Random &random, Scene &scene, const Limits &limits)
{
    Object object;
    const bool boxes = chance(random, limits.boxes);
    uint32_t meshes = 1 + below(random, limits.meshes), most = limits.triangles;
    if (chance(random, limits.unusual / 8)) {
        meshes = 4 + below(random, kMostGeometries - 3);
        most = 3;
    }
    for (uint32_t m = 0; m < meshes; ++m)
        object.meshes.push_back(randomMesh(random, scene, boxes, most, limits));
    object.geometryPointers = chance(random, limits.unusual / 2);
    // An object without boxes is one of triangles.
    for (Mesh &mesh : object.meshes)
        mesh.layout = boxes && !object.hasBoxes() ? MeshLayout{} : mesh.layout;
    return object;
}

} // namespace

uint32_t randomTriangleStride(Random &random, bool odd)
{
    return odd ? 8 + below(random, 28) : 8 + 4 * below(random, 7);
}

MicromapTriangle mixedTriangle(Random &random, uint32_t level, uint16_t format)
{
    MicromapTriangle triangle{.level = level, .format = format};
    triangle.states.resize(size_t{1} << (2 * level));
    for (uint8_t &state : triangle.states)
        state = static_cast<uint8_t>(below(random, format == kTwoState ? 2 : 4));
    return triangle;
}

MicromapTriangle randomTriangle(Random &random, uint32_t maxLevel)
{
    MicromapTriangle triangle;
    triangle.level = below(random, maxLevel + 1);
    triangle.format = chance(random, 40) ? kTwoState : kFourState;
    const uint32_t values = triangle.format == kTwoState ? 2 : 4;
    triangle.states.resize(size_t{1} << (2 * triangle.level));
    // Uniform triangles and uniform stretches are what a layer treats specially.
    const uint32_t stretch = 1u << (2 * below(random, 4));
    uint8_t state = 0;
    for (size_t i = 0; i < triangle.states.size(); ++i) {
        if (i % stretch == 0)
            state = static_cast<uint8_t>(below(random, values));
        triangle.states[i] = state;
    }
    if (chance(random, 15))
        std::fill(triangle.states.begin(), triangle.states.end(), state);
    return triangle;
}

MeshMicromap randomUse(Random &random, const Scene &scene, uint32_t triangles, const Limits &limits)
{
    MeshMicromap use;
    const auto number = static_cast<uint32_t>(
        chance(random, 60) ? scene.micromaps.size() - 1 : below(random, static_cast<uint32_t>(scene.micromaps.size())));
    const auto count = static_cast<uint32_t>(scene.micromaps[number].triangles.size());
    constexpr std::array types{VK_INDEX_TYPE_NONE_KHR, VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32,
                               VK_INDEX_TYPE_UINT8_EXT};
    use.indexType = types[below(random, limits.byteIndices ? 4 : 3)];
    const bool direct = use.indexType == VK_INDEX_TYPE_NONE_KHR && count >= triangles;
    if (!direct && use.indexType == VK_INDEX_TYPE_NONE_KHR)
        use.indexType = VK_INDEX_TYPE_UINT32;
    if (direct || !chance(random, 10))
        use.micromap = number;
    const uint32_t spare = direct ? count - triangles : count - 1; // triangles that a base may skip
    use.base = use.micromap && spare > 0 && chance(random, 50) ? below(random, std::min(spare, 6u) + 1) : 0;
    const uint32_t most = use.indexType == VK_INDEX_TYPE_UINT8_EXT ? 252 : 65532; // the rest is special
    for (uint32_t i = 0; i < triangles; ++i) {
        if (direct)
            use.indices.push_back(static_cast<int32_t>(i));
        else if (!use.micromap || chance(random, 20))
            use.indices.push_back(-1 - static_cast<int32_t>(below(random, 4)));
        else
            use.indices.push_back(static_cast<int32_t>(below(random, std::min(count - use.base, most))));
    }
    if (!direct && chance(random, 25)) {
        const uint32_t size = use.indexType == VK_INDEX_TYPE_UINT32 ? 4 : use.indexType == VK_INDEX_TYPE_UINT16 ? 2 : 1;
        // 0: all triangles read the first. Indices may be members of larger records.
        use.stride = size * (chance(random, 30) && triangles < 100 ? below(random, 1200) : below(random, 5));
        use.indexOffset = size * below(random, 4);
    }
    return use;
}

Instance randomInstance(Random &random, uint32_t objects, const Limits &limits)
{
    Instance instance{};
    instance.object = below(random, objects);
    instance.transform = randomTransform(random);
    instance.customIndex = static_cast<uint32_t>(random()) & 0xffffffu;
    instance.mask = chance(random, 70) ? 0xff : below(random, 256);
    if (chance(random, 15))
        instance.flags |= VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR;
    if (chance(random, 15))
        instance.flags |= VK_GEOMETRY_INSTANCE_TRIANGLE_FLIP_FACING_BIT_KHR;
    if (chance(random, 20))
        instance.flags |= VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR;
    else if (chance(random, 20))
        instance.flags |= VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR;
    if (limits.micromaps && chance(random, 25))
        instance.flags |= kFlagTwoState;
    if (limits.micromaps && chance(random, 15))
        instance.flags |= kFlagDisable;
    instance.inactive = chance(random, 4);
    return instance;
}

Ray randomRay(Random &random, const Limits &limits)
{
    Ray ray;
    ray.origin = point(random, 9);
    const Vec3 target = point(random, 2.5f);
    for (size_t i = 0; i < 3; ++i)
        ray.direction[i] = (target[i] - ray.origin[i]) * 0.2f;
    ray.tMin = chance(random, 50) ? 0 : between(random, 0, 5);
    ray.tMax = chance(random, 60) ? 1000 : between(random, std::max(3.0f, ray.tMin + 1), 12);
    constexpr std::array opacity{0u, 0u, kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque};
    ray.flags = opacity[below(random, opacity.size())];
    if (chance(random, 15))
        ray.flags |= kRayTerminateOnFirstHit;
    switch (below(random, 12)) {
    case 0: ray.flags |= kRayCullBack; break;
    case 1: ray.flags |= kRayCullFront; break;
    case 2: ray.flags |= kRaySkipBoxes; break;
    case 3:
        if (chance(random, 30))
            ray.flags |= kRaySkipTriangles;
        break;
    default: break;
    }
    if (limits.micromaps && chance(random, 25))
        ray.flags |= kRayForceTwoState;
    ray.cullMask = chance(random, 70) ? 0xff : below(random, 256);
    ray.rule = below(random, 3);
    ray.generate = chance(random, 60) ? 0 : between(random, ray.tMin + 0.001f, ray.tMax);
    return ray;
}

Scene randomScene(Random &random, const Limits &limits)
{
    Scene scene;
    const uint32_t objects = 1 + below(random, limits.objects);
    for (uint32_t i = 0; i < objects; ++i) {
        Object object = randomObject(random, scene, limits);
        scene.objects.push_back(std::move(object));
    }
    const uint32_t instances = 1 + below(random, limits.instances);
    for (uint32_t i = 0; i < instances; ++i)
        scene.instances.push_back(randomInstance(random, objects, limits));
    for (uint32_t i = 0; i < limits.rays; ++i)
        scene.rays.push_back(randomRay(random, limits));
    return scene;
}

} // namespace vellum::check::oracle
