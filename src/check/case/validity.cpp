// SPDX-License-Identifier: Apache-2.0
#include "check/case/case.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <span>

#include "check/case/address_copies.h"
#include "check/case/names.h"
#include "check/case/queries.h"
#include "check/case/trace.h"
#include "check/oracle/scene_build.h"

namespace vellum::check
{
namespace
{

using oracle::MeshMicromap;
using oracle::Scene;

constexpr uint32_t kMostLevels = 12;
constexpr size_t kMostMeshes = size_t{1} << 17;
// Limits so that no case takes all memory.
constexpr uint64_t kMostBytes = uint64_t{1} << 28; // of a buffer
constexpr uint32_t kMostThreads = 64;
constexpr size_t kMostParts = 16, kMostTables = 8; // of a pipeline
constexpr size_t kMostSteps = 1000, kMostQueryPlans = 64, kMostQueryCommands = 1000;
constexpr size_t kMostAddressCommands = 256;

struct Broken {
    std::string what;
};

template <class... T>
void rule(bool holds, const std::string &where, fmt::format_string<T...> what, T &&...values)
{
    if (!holds)
        throw Broken{where + ": " + fmt::format(what, std::forward<T>(values)...)};
}

bool finite(std::span<const float> values)
{
    return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
}

bool oneAtMost(uint32_t flags, uint32_t of)
{
    const uint32_t some = flags & of;
    return (some & (some - 1)) == 0;
}

void checkMicromapTriangles(const std::vector<oracle::MicromapTriangle> &triangles, const std::string &where,
                            uint64_t &states)
{
    for (size_t i = 0; i < triangles.size(); ++i) {
        const oracle::MicromapTriangle &triangle = triangles[i];
        const std::string here = fmt::format("{}[{}]", where, i);
        rule(isNamed(kFormatNames, triangle.format), here, "no such format");
        rule(triangle.level <= kMostLevels, here, "level {} is above {}", triangle.level, kMostLevels);
        const size_t expected = size_t{1} << (2 * triangle.level);
        rule(triangle.states.size() == expected, here, "level {} has {} micro-triangles, not {}", triangle.level,
             expected, triangle.states.size());
        const uint8_t most = triangle.format == kTwoState ? 1 : 3;
        rule(std::ranges::all_of(triangle.states, [&](uint8_t state) { return state <= most; }), here,
             "the format lacks one of the states");
        states += expected;
        rule(states <= kMostStates, here, "more than {} micro-triangles in all", kMostStates);
    }
}

// VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712 and 11713
void checkLossy(VkBuildMicromapFlagsEXT flags, const std::vector<oracle::MicromapTriangle> &triangles,
                const std::string &where)
{
    rule((flags & kLossy) == 0 ||
             std::ranges::all_of(triangles, [](const auto &triangle) { return triangle.format == kFourState; }),
         where, "a lossy micromap has a triangle of the 2-state format");
}

void checkMicromap(const oracle::SceneMicromap &micromap, const std::string &where, uint64_t &states)
{
    checkMicromapTriangles(micromap.triangles, where + ".triangles", states);
    checkLossy(micromap.flags, micromap.triangles, where);
    rule((micromap.flags & ~allOf(kMicromapFlagNames)) == 0, where, "no such flag");
    rule((micromap.usage & ~allOf(kUsageNames)) == 0 && (micromap.layout & ~allOf(kDataNames)) == 0, where,
         "no such form of usage counts, or of data");
    rule(oneAtMost(micromap.flags,
                   VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT | VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT),
         where, "fast builds and fast traces exclude each other");
    rule(micromap.triangleStride >= sizeof(VkMicromapTriangleEXT), where, "triangleStride {} is below {}",
         micromap.triangleStride, sizeof(VkMicromapTriangleEXT));
    rule(uint64_t{micromap.triangleStride} * micromap.triangles.size() <= kMostBytes, where,
         "triangleStride {} is too large", micromap.triangleStride);
}

uint32_t bytesOf(VkIndexType type)
{
    return type == VK_INDEX_TYPE_UINT32 ? 4 : type == VK_INDEX_TYPE_UINT16 ? 2 : 1;
}

void checkUse(const Scene &scene, const MeshMicromap &use, size_t triangles, const std::string &where)
{
    const bool exists = use.micromap && *use.micromap < scene.micromaps.size();
    const size_t count = exists ? scene.micromaps[*use.micromap].triangles.size() : 0;
    rule(exists || !use.micromap, where, "micromap {} does not exist", use.micromap.value_or(0));
    rule(isNamed(kIndexTypeNames, use.indexType), where, "no such index type");
    rule((use.usage & ~allOf(kUsageNames)) == 0, where, "no such form of usage counts");
    rule(use.indices.size() == triangles, where, "{} indices for {} triangles", use.indices.size(), triangles);
    const bool direct = use.indexType == VK_INDEX_TYPE_NONE_KHR;
    const uint32_t size = bytesOf(use.indexType);
    if (direct) {
        rule(use.micromap.has_value(), where, "neither a micromap nor indices");
        rule(!use.stride && use.indexOffset == 0, where, "a stride or an offset without indices");
    } else {
        const uint32_t stride = use.stride.value_or(size);
        rule(stride % size == 0, where, "stride {} is no multiple of the index size", stride);
        rule(use.indexOffset % size == 0, where, "indexOffset {} is no multiple of the index size", use.indexOffset);
        rule(uint64_t{stride} * triangles + use.indexOffset <= kMostBytes, where, "stride or indexOffset too large");
    }
    // The last four values of a type are special indices.
    const int64_t largest = (int64_t{1} << (8 * size)) - 5;
    for (size_t i = 0; i < use.indices.size(); ++i) {
        const int64_t index = use.indices[i];
        rule(!direct || index == static_cast<int64_t>(i), where, "index {} without an index buffer is not {}", index,
             i);
        rule(index >= -4, where, "{} is no special index", index);
        rule(direct || index <= largest, where, "index {} does not fit its type", index);
        rule(index < 0 || use.micromap, where, "index {} without a micromap", index);
        rule(index < 0 || static_cast<uint64_t>(index) + use.base < count, where,
             "index {} and base {} are beyond the {} triangles of micromap {}", index, use.base, count,
             use.micromap.value_or(0));
    }
}

// VUID-VkTransformMatrixKHR-matrix-03799
bool invertible(const VkTransformMatrixKHR &transform)
{
    const auto m = [&](int row, int column) { return double{transform.matrix[row][column]}; };
    const double determinant = m(0, 0) * (m(1, 1) * m(2, 2) - m(1, 2) * m(2, 1)) -
                               m(0, 1) * (m(1, 0) * m(2, 2) - m(1, 2) * m(2, 0)) +
                               m(0, 2) * (m(1, 0) * m(2, 1) - m(1, 1) * m(2, 0));
    return determinant != 0;
}

void checkTransform(const VkTransformMatrixKHR &transform, const std::string &where)
{
    rule(finite(std::span(&transform.matrix[0][0], 12)), where, "the transform is not finite");
    rule(invertible(transform), where, "the transform cannot be inverted");
}

void checkStride(const oracle::MeshLayout &layout, uint32_t bytes, uint32_t alignment, const std::string &where)
{
    rule(layout.stride == 0 || (layout.stride >= bytes && layout.stride % alignment == 0), where,
         "stride {} is no multiple of {} of at least {}", layout.stride, alignment, bytes);
}

// VUID-VkAccelerationStructureBuildRangeInfoKHR-primitiveOffset-03656, -03657, -03659
void checkOffset(const oracle::MeshLayout &layout, uint32_t alignment, const std::string &where)
{
    rule(layout.primitiveOffset % alignment == 0, where, "primitiveOffset {} is no multiple of {}",
         layout.primitiveOffset, alignment);
}

void checkBoxes(const oracle::Mesh &mesh, const std::string &where)
{
    for (const VkAabbPositionsKHR &box : mesh.boxes) {
        rule((std::isfinite(box.minX) || std::isnan(box.minX)) &&
                 finite(std::array{box.minY, box.minZ, box.maxX, box.maxY, box.maxZ}),
             where, "a box is not finite");
        rule(!(box.minX > box.maxX) && box.minY <= box.maxY && box.minZ <= box.maxZ, where,
             "a box has a minimum above its maximum"); // VUID-VkAabbPositionsKHR-minX-03546
    }
    const oracle::MeshLayout &layout = mesh.layout;
    rule(!mesh.micromap && layout.vertexFormat == VK_FORMAT_R32G32B32_SFLOAT && layout.firstVertex == 0 &&
             !layout.isIndexed() && !layout.transform,
         where, "boxes have neither micromaps nor vertices, indices and a transform");
    checkStride(layout, sizeof(VkAabbPositionsKHR), 8, where);
    checkOffset(layout, 8, where);
}

void checkTriangles(const oracle::Mesh &mesh, const std::string &where)
{
    const oracle::MeshLayout &layout = mesh.layout;
    rule(isNamed(kVertexFormatNames, layout.vertexFormat), where, "no such vertex format");
    rule(mesh.vertices.size() % 3 == 0, where, "{} vertices are no whole triangles", mesh.vertices.size());
    const VertexFormat format = vertexFormat(layout.vertexFormat);
    for (const Vec3 &vertex : mesh.vertices) {
        const bool inactive = format.isFloat() && std::isnan(vertex[0]);
        rule(finite(std::span(vertex).subspan(inactive ? 1 : 0)), where, "a vertex is not finite");
        const Vec3 read = quantized(layout.vertexFormat, vertex);
        rule((inactive || !(read[0] < vertex[0] || read[0] > vertex[0])) &&
                 !(read[1] < vertex[1] || read[1] > vertex[1] || read[2] < vertex[2] || read[2] > vertex[2]),
             where, "a vertex has a value that {} cannot represent", nameOf(kVertexFormatNames, layout.vertexFormat));
    }
    checkStride(layout, format.bytes, format.alignment, where);
    const uint32_t indexBytes = layout.indexType == VK_INDEX_TYPE_UINT16 ? 2 : 4;
    checkOffset(layout, layout.isIndexed() ? indexBytes : format.alignment, where);
    // VUID-VkAccelerationStructureGeometryTrianglesDataKHR-indexType-03798
    rule(!layout.isIndexed() || layout.indexType == VK_INDEX_TYPE_UINT16 || layout.indexType == VK_INDEX_TYPE_UINT32,
         where, "vertex indices have 16 or 32 bits");
    rule(layout.indexType != VK_INDEX_TYPE_UINT16 || layout.firstIndex + mesh.vertices.size() <= 0x10000, where,
         "indices that 16 bits do not have");
    rule(layout.isIndexed() || (layout.firstIndex == 0 && !layout.separate && layout.order == 0), where,
         "an order of vertices without indices");
    if (layout.transform)
        checkTransform(*layout.transform, where + ".layout");
    // VUID-VkAccelerationStructureBuildRangeInfoKHR-transformOffset-03658
    rule(layout.transformOffset % 16 == 0 && (layout.transform || layout.transformOffset == 0), where,
         "transformOffset {} is no multiple of 16 or without a transform", layout.transformOffset);
}

void checkMesh(const oracle::Mesh &mesh, bool boxes, const std::string &where)
{
    // VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03792
    rule(!boxes || mesh.vertices.empty(), where, "triangles and boxes in one object");
    if (boxes)
        checkBoxes(mesh, where);
    else
        checkTriangles(mesh, where);
    const oracle::MeshLayout &layout = mesh.layout;
    const uint64_t vertices =
        uint64_t{layout.firstVertex} + layout.firstIndex + mesh.vertices.size() + mesh.boxes.size();
    rule(vertices * std::max(layout.stride, 24u) <= kMostBytes && layout.primitiveOffset <= kMostBytes &&
             layout.transformOffset <= kMostBytes,
         where, "stride or offsets too large");
}

void checkStructureFlags(VkBuildAccelerationStructureFlagsKHR flags, const std::string &where)
{
    rule((flags & ~allOf(kStructureFlagNames)) == 0, where, "no such flag");
    // VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-03796
    rule(oneAtMost(flags, VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                              VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR),
         where, "fast builds and fast traces exclude each other");
    // VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11558
    rule(oneAtMost(flags, kAllowMicromapUpdate | kAllowDataUpdate), where,
         "updates of micromaps and of their data exclude each other");
}

void checkObject(const Scene &scene, const oracle::Object &object, const std::string &where)
{
    checkStructureFlags(object.flags, where);
    rule(!object.meshes.empty() && object.meshes.size() <= kMostMeshes, where, "has {} meshes, not 1 to {}",
         object.meshes.size(), kMostMeshes);
    const bool boxes = object.hasBoxes();
    for (size_t i = 0; i < object.meshes.size(); ++i) {
        const oracle::Mesh &mesh = object.meshes[i];
        const std::string here = fmt::format("{}.meshes[{}]", where, i);
        checkMesh(mesh, boxes, here);
        if (mesh.micromap)
            checkUse(scene, *mesh.micromap, mesh.triangles(), here + ".micromap");
    }
}

void checkInstance(const Scene &scene, const oracle::Instance &instance, const std::string &where)
{
    rule(instance.object < scene.objects.size(), where, "object {} does not exist", instance.object);
    checkTransform(instance.transform, where);
    rule(instance.customIndex <= 0xffffffu, where, "customIndex {} has more than 24 bits", instance.customIndex);
    rule(instance.mask <= 0xffu, where, "mask {} has more than 8 bits", instance.mask);
    rule((instance.flags & ~allOf(kInstanceFlagNames)) == 0, where, "no such flag");
    rule(instance.record.value_or(0) <= 0xffffffu, where, "record {} has more than 24 bits",
         instance.record.value_or(0));
}

void checkRay(const Ray &ray, const std::string &where)
{
    rule(finite(ray.origin) && finite(ray.direction) && finite(std::array{ray.tMin, ray.tMax, ray.generate}), where,
         "is not finite");
    rule(ray.tMin >= 0 && ray.tMin <= ray.tMax, where, "tMin {} is negative or above tMax {}", ray.tMin, ray.tMax);
    // VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06353; the shaders generate nothing above tMax
    rule(ray.generate == 0 || ray.generate >= ray.tMin, where, "generate {} is below tMin", ray.generate);
    rule((ray.flags & ~allOf(kRayFlagNames)) == 0, where, "no such flag");
    // VUID-RuntimeSpirv-OpRayQueryInitializeKHR-06889 to 06891
    rule(oneAtMost(ray.flags, kRayOpaque | kRayNoOpaque | kRayCullOpaque | kRayCullNoOpaque) &&
             oneAtMost(ray.flags, kRaySkipTriangles | kRayCullBack | kRayCullFront) &&
             oneAtMost(ray.flags, kRaySkipTriangles | kRaySkipBoxes),
         where, "flags that exclude each other");
    rule(ray.cullMask <= 0xffu, where, "cullMask {} has more than 8 bits", ray.cullMask);
    rule(isNamed(kRuleNames, ray.rule), where, "no such rule");
}

void checkUses(const Scene &scene, uint32_t micromap, const std::string &where)
{
    for (const oracle::Object &object : scene.objects)
        for (const oracle::Mesh &mesh : object.meshes)
            if (mesh.micromap && mesh.micromap->micromap == micromap)
                checkUse(scene, *mesh.micromap, mesh.triangles(), where);
}

// The scene is as the steps before have made it.
void checkStep(const Scene &scene, const Step &step, const std::string &where, uint64_t &states)
{
    using Kind = Step::Kind;
    rule(step.kind < Kind::Count, where, "no such step");
    const bool reused = step.kind == Kind::ReloadMicromap && step.inPlace;
    rule(step.kind == Kind::SetStates || step.kind == Kind::CloneMicromap || reused || step.states.empty(), where,
         "has states that it does not use");
    rule(step.kind == Kind::SetIndices || !step.micromapUse, where, "has indices that it does not use");
    rule(step.kind == Kind::UpdateTop || step.kind == Kind::RebuildTop || step.instances.empty(), where,
         "has instances that it does not use");
    rule(step.kind == Kind::UpdateObject || step.kind == Kind::RebuildObject || !step.mirrored, where,
         "has no vertices of its own");
    rule(step.kind == Kind::SetStates || reused || !step.inPlace, where, "is not in place");
    rule(step.update || step.kind == Kind::UpdateObject || step.kind == Kind::UpdateTop || !step.outOfPlace, where,
         "is no update");
    rule(step.kind == Kind::CloneObject || step.kind == Kind::CloneTop || step.outOfPlace || !step.exact, where,
         "is neither a clone nor an update of another structure");
    rule(step.kind == Kind::ReloadObject || step.kind == Kind::ReloadTop || !step.relocated, where,
         "has no addresses of structures or micromaps");
    rule((step.kind == Kind::ReloadObject && step.relocated) || !step.structureFirst, where,
         "has no micromaps that come later");
    const Target target = targetOf(step.kind);
    rule(target == Target::Micromap || !step.host, where, "has no host command");
    rule(step.host || !step.deferred, where, "only host commands are deferred");
    rule(target != Target::Object || step.target < scene.objects.size(), where, "object {} does not exist",
         step.target);
    rule(target != Target::Micromap || step.target < scene.micromaps.size(), where, "micromap {} does not exist",
         step.target);
    if (step.kind == Kind::MoveObject || step.kind == Kind::ReplaceObject) {
        rule(step.other < scene.objects.size(), where, "object {} does not exist", step.other);
        rule(step.kind == Kind::MoveObject ||
                 scene.objects[step.target].hasBoxes() == scene.objects[step.other].hasBoxes(),
             where, "boxes take the place of triangles");
    } else if (step.kind == Kind::CompactMicromap) {
        // VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-07502
        rule((scene.micromaps[step.target].flags & VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT) != 0, where,
             "micromap {} does not allow compaction", step.target);
    } else if (step.kind == Kind::SetStates || !step.states.empty()) {
        checkMicromapTriangles(step.states, where + ".states", states);
        checkLossy(scene.micromaps[step.target].flags, step.states, where);
        // The size is the same, so that they can be built in the same memory.
        rule((step.kind == Kind::SetStates && !step.inPlace) ||
                 std::ranges::equal(
                     step.states, scene.micromaps[step.target].triangles,
                     [](const auto &a, const auto &b) { return a.level == b.level && a.format == b.format; }),
             where, "other levels or formats than the micromap has");
    } else if (step.kind == Kind::UpdateTop) {
        rule(step.instances.size() == scene.instances.size(), where, "{} instances, not {}", step.instances.size(),
             scene.instances.size());
        for (size_t i = 0; i < step.instances.size(); ++i) {
            checkInstance(scene, step.instances[i], fmt::format("{}.instances[{}]", where, i));
            // VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03667 and its neighbours: what an update must not change.
            rule(step.instances[i].inactive == scene.instances[i].inactive, where,
                 "instance {} becomes active or inactive", i);
        }
    } else if (step.kind == Kind::RebuildTop) {
        rule(!step.instances.empty(), where, "has no instances");
        for (size_t i = 0; i < step.instances.size(); ++i)
            checkInstance(scene, step.instances[i], fmt::format("{}.instances[{}]", where, i));
    } else if (step.kind == Kind::SetIndices) {
        const std::vector<oracle::Mesh> &meshes = scene.objects[step.target].meshes;
        rule(step.other < meshes.size(), where, "mesh {} does not exist", step.other);
        rule(!scene.objects[step.target].hasBoxes(), where, "mesh {} is one of boxes", step.other);
        if (step.micromapUse)
            checkUse(scene, *step.micromapUse, meshes[step.other].triangles(), where + ".micromapUse");
    }
}

// Updated structures allow updates since their first build (buildFlagsOf).
void checkUpdates(const Case &c, const Scene &scene, const Step &step, const std::string &where)
{
    const auto has = [](const oracle::Mesh &mesh) { return mesh.micromap.has_value(); };
    const auto uses = [&](const oracle::Mesh &mesh) { return mesh.micromap && mesh.micromap->micromap == step.target; };
    const bool updates = step.update && targetOf(step.kind) == Target::Micromap;
    for (size_t i = 0; updates && i < scene.objects.size(); ++i)
        rule(std::ranges::none_of(scene.objects[i].meshes, uses) || std::ranges::any_of(c.scene.objects[i].meshes, has),
             where, "updates object {}, which had no micromap when it was built", i);
}

// Returns whether an update changes opacity values only: "the application must not [...] change between use of special
// index values and explicit micro-map triangles; change the subdivision level or format of the micromap triangle
// associated with any acceleration-structure triangle" (Acceleration Structure Update Rules).
bool changesDataOnly(const Scene &before, const Scene &after, uint32_t object)
{
    const auto shapeOf = [](const Scene &scene, const MeshMicromap &use, uint32_t triangle) {
        const int32_t index = use.indexOf(triangle);
        if (index < 0)
            return std::pair(index, uint32_t{0});
        const oracle::MicromapTriangle &of =
            scene.micromaps[*use.micromap].triangles[static_cast<size_t>(index) + use.base];
        return std::pair(static_cast<int32_t>(of.level), uint32_t{of.format});
    };
    const auto &from = before.objects[object].meshes, &to = after.objects[object].meshes;
    for (size_t m = 0; m < from.size(); ++m) {
        if (!oracle::isAlike(from[m].micromap, to[m].micromap))
            return false;
        for (uint32_t t = 0; from[m].micromap && t < from[m].micromap->indices.size(); ++t)
            if (shapeOf(before, *from[m].micromap, t) != shapeOf(after, *to[m].micromap, t))
                return false;
    }
    return true;
}

// Objects with ALLOW_OPACITY_MICROMAP_DATA_UPDATE.
void checkDataUpdates(const Case &c)
{
    for (uint32_t o = 0; o < c.scene.objects.size(); ++o) {
        if ((c.scene.objects[o].flags & kAllowDataUpdate) == 0)
            continue;
        Scene scene = c.scene;
        bool deserialized = false;
        for (size_t i = 0; i < c.steps.size(); ++i) {
            const Step &step = c.steps[i];
            const Scene before = scene;
            applyTo(scene, step);
            deserialized |= step.kind == Step::Kind::ReloadObject && step.target == o;
            rule(!isUpdated(step, o, scene) || (!deserialized && changesDataOnly(before, scene, o)),
                 fmt::format("steps[{}]", i), "updates more than the data of micromaps of object {}", o);
        }
    }
}

void checkQueryTarget(const Case &c, const QueryPlan &plan, const QueryTarget &target, const std::string &where)
{
    using Property = QueryPlan::Property;
    rule(isNamed(kQueryTargetNames, target.of), where, "no such target");
    const bool micromap = target.of == QueryTarget::Of::Micromap;
    rule(target.number < (micromap                               ? c.scene.micromaps.size()
                          : target.of == QueryTarget::Of::Object ? c.scene.objects.size()
                                                                 : 1),
         where, "{} {} does not exist", nameOf(kQueryTargetNames, target.of), target.number);
    // VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-07502
    rule(!micromap || plan.property != Property::CompactedSize ||
             (c.scene.micromaps[target.number].flags & VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT) != 0,
         where, "micromap {} does not allow compaction", target.number);
    // VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-12425
    rule(plan.property != Property::BottomLevelPointers || target.of == QueryTarget::Of::Top, where,
         "only the top level has bottom-level pointers");
}

void checkQueries(const Case &c)
{
    constexpr uint32_t kMost = 4096;
    for (size_t p = 0; p < c.queries.size(); ++p) {
        const QueryPlan &plan = c.queries[p];
        const std::string where = fmt::format("queries[{}]", p);
        rule(isNamed(kPropertyNames, plan.property), where, "no such property");
        rule(plan.count >= 1 && plan.count <= kMost, where, "{} queries, not 1 to {}", plan.count, kMost);
        QueryStates states(plan.count);
        for (size_t i = 0; i < plan.commands.size(); ++i) {
            const QueryCommand &command = plan.commands[i];
            const std::string here = fmt::format("{}.commands[{}]", where, i);
            rule(isNamed(kQueryCommandNames, command.kind), here, "no such command");
            rule(command.offset <= kMost && command.padding <= kMost, here, "offset or padding is too large");
            for (const QueryTarget &target : command.targets) {
                checkQueryTarget(c, plan, target, here);
                rule(command.kind != QueryCommand::Kind::WriteOnHost || target.of == QueryTarget::Of::Micromap, here,
                     "the host queries micromaps only");
            }
            const std::string broken = advance(states, command);
            rule(broken.empty(), here, "{}", broken);
        }
    }
}

void checkAddressCopies(const Case &c)
{
    const AddressPlan &plan = c.addressCopies;
    rule(plan.commands.size() <= kMostAddressCommands, "addressCopies", "has {} commands, not at most {}",
         plan.commands.size(), kMostAddressCommands);
    const std::string broken = brokenRule(plan);
    rule(broken.empty(), "addressCopies", "{}", broken);
    for (size_t i = 0; i < plan.commands.size(); ++i) {
        const std::string here = brokenRule(plan, plan.commands[i]);
        rule(here.empty(), fmt::format("addressCopies.commands[{}]", i), "{}", here);
    }
}

void checkSteps(const Case &c, uint64_t &states)
{
    Scene scene = c.scene;
    scene.rays.clear();
    for (size_t i = 0; i < c.steps.size(); ++i) {
        const Step &step = c.steps[i];
        const std::string where = fmt::format("steps[{}]", i);
        checkStep(scene, step, where, states);
        if (step.kind == Step::Kind::SetIndices && step.update)
            rule(oracle::isAlike(scene.objects[step.target].meshes[step.other].micromap, step.micromapUse), where,
                 "an update gives a geometry a micromap that had none, or takes it");
        applyTo(scene, step);
        if (step.kind == Step::Kind::SetStates)
            checkUses(scene, step.target, where);
        checkUpdates(c, scene, step, where);
    }
    checkDataUpdates(c);
}

// Groups of the tracer by the stages that they may name, where flags give each hit group all shaders.
constexpr uint32_t kTracerGroups = kTracerGroupNames.size();
constexpr uint32_t kRelayStage = kTracerStageNames.size() - 1, kRelayGroup = kTracerGroups - 1;

void checkParts(const PipelinePlan &pipeline, bool relay, const std::string &where)
{
    const std::vector<PipelinePart> &parts = pipeline.parts;
    rule(parts.size() <= kMostParts, where, "has {} parts, not at most {}", parts.size(), kMostParts);
    std::vector<uint32_t> users(parts.size()), places(kTracerGroups);
    for (size_t i = 0; i < parts.size(); ++i) {
        const PipelinePart &part = parts[i];
        const std::string here = fmt::format("{}.parts[{}]", where, i);
        const bool last = &part == &parts.back();
        rule(!last || !part.micromapBit, here, "the pipeline itself has micromapBit");
        for (const uint32_t library : part.libraries) {
            rule(library < i, here, "library {} is no part before", library);
            rule(++users[library] == 1, here, "library {} is linked twice", library);
            // VUID-VkRayTracingPipelineCreateInfoKHR-flags-07403
            rule(!part.micromapBit || parts[library].micromapBit, here, "has the micromap bit and library {} lacks it",
                 library);
        }
        // VUID-VkRayTracingPipelineCreateInfoKHR-pLibraryInfo-03600 and 03601, without libraries
        rule(!part.libraries.empty() || !part.stages.empty(), here, "has neither libraries nor stages");
        for (size_t k = 0; k < part.stages.size(); ++k) {
            rule(part.stages[k] < kTracerStageNames.size() && (relay || part.stages[k] != kRelayStage), here,
                 "no such stage");
            rule(std::ranges::count(part.stages, part.stages[k]) == 1, here, "a stage twice");
        }
        const std::vector<uint32_t> stages = stagesOf(parts, part);
        for (const uint32_t group : part.groups) {
            rule(group < kTracerGroups && (relay || group != kRelayGroup), here, "no such group");
            rule(++places[group] == 1, here, "group {} twice", nameOf(kTracerGroupNames, group));
            for (const uint32_t stage : stagesOfGroup(group))
                rule(std::ranges::count(stages, stage) > 0, here, "group {} lacks stage {}",
                     nameOf(kTracerGroupNames, group), nameOf(kTracerStageNames, stage));
        }
    }
    for (size_t i = 0; i + 1 < parts.size(); ++i)
        rule(users[i] == 1, where, "part {} is in no pipeline", i);
    for (uint32_t group = 0; !parts.empty() && group < kTracerGroups; ++group)
        rule(places[group] == 1 || (group == kRelayGroup && !relay), where, "group {} is nowhere",
             nameOf(kTracerGroupNames, group));
}

void checkTable(const oracle::TablePlan &table, const std::string &where)
{
    rule(std::ranges::all_of(table.records, [](oracle::HitRecord record) { return isNamed(kHitRecordNames, record); }),
         where, "no such record");
    rule(table.length.value_or(0) <= 1u << 18 && table.misses >= 1 && table.misses <= 1000, where,
         "has too many records, or no miss records");
    rule(isNamed(kRecordDataNames, table.content), where, "no such content");
    rule(table.layout.before <= 1000 && table.layout.missPadding <= 64 && table.layout.hitPadding <= 64, where,
         "padding is too large");
}

void checkPipeline(const Case &c, const Scene &after, const PipelinePlan &pipeline, const std::string &where)
{
    const bool closestHit = c.trace.from == TracePlan::From::ClosestHit;
    rule((pipeline.flags & ~allOf(kPipelineFlagNames)) == 0, where, "no such flag");
    rule(oneAtMost(pipeline.flags, VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR |
                                       VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR),
         where, "skips triangles and boxes"); // VUID-VkRayTracingPipelineCreateInfoKHR-flags-06546
    checkParts(pipeline, c.trace.from != TracePlan::From::RayGeneration, where);
    rule(pipeline.otherTables.size() <= kMostTables, where, "has {} other tables, not at most {}",
         pipeline.otherTables.size(), kMostTables);
    // Also if the scene is not traced by pipelines.
    const bool traced = c.trace.method == TracePlan::Method::Pipeline;
    for (size_t t = 0; t <= pipeline.otherTables.size(); ++t) {
        const std::string here = t == 0 ? where + ".table" : fmt::format("{}.otherTables[{}]", where, t - 1);
        const oracle::TablePlan &table = t == 0 ? pipeline.table : pipeline.otherTables[t - 1];
        checkTable(table, here);
        if (const std::string broken =
                traced ? tableRule(after, {pipeline.flags, pipeline.parameters, table}, closestHit) : std::string();
            !broken.empty())
            throw Broken{here + ": " + broken};
    }
}

void checkTrace(const Case &c)
{
    const TracePlan &trace = c.trace;
    const bool traced = trace.method == TracePlan::Method::Pipeline;
    rule(isNamed(kMethodNames, trace.method), "trace.method", "no such method");
    rule(isNamed(kStageNames, trace.stage), "trace.stage", "no such stage");
    rule(isNamed(kFlagSourceNames, trace.flags), "trace.flags", "no such source");
    rule(isNamed(kModeNames, trace.mode), "trace.mode", "no such mode");
    rule(isNamed(kQueryNames, trace.query), "trace.query", "no such use");
    rule(isNamed(kFromNames, trace.from), "trace.from", "no such stage");
    rule(isNamed(kLaunchNames, trace.launch.command), "trace.launch", "no such command");
    rule(trace.launch.height >= 1 && trace.launch.height <= 64 && trace.launch.depth >= 1 && trace.launch.depth <= 64 &&
             trace.launch.offset <= 1000,
         "trace.launch", "height and depth are not 1 to 64, or the offset is too large");
    rule((trace.creation & ~allOf(kCreationNames)) == 0, "trace.creation", "no such way");
    rule((trace.chained & ~allOf(kChainedNames)) == 0, "trace.chained", "no such structure");
    rule((trace.tableBarrier & ~allOf(kTableBarrierNames)) == 0, "trace.tableBarrier", "no such barrier");
    rule(!trace.secondary || traced || trace.stage == VK_SHADER_STAGE_COMPUTE_BIT, "trace.secondary",
         "is within a render pass");
    const bool selected = trace.flags == TracePlan::Flags::Selected;
    rule(!trace.callables ||
             (trace.from == TracePlan::From::RayGeneration && !trace.byAddress &&
              (trace.flags == TracePlan::Flags::RunTime || selected) && trace.pipeline.parts.empty() &&
              std::ranges::all_of(trace.otherPipelines, [](const PipelinePlan &plan) { return plan.parts.empty(); })),
         "trace.callables", "need a ray generation shader with flags of run time and a descriptor, and no parts");
    const bool constant = trace.flags == TracePlan::Flags::Specialized || trace.flags == TracePlan::Flags::Literal;
    rule(traced || constant || selected || trace.flags == TracePlan::Flags::RunTime, "trace.flags",
         "are those of pipelines");
    const bool compute = trace.stage == VK_SHADER_STAGE_COMPUTE_BIT && !trace.byAddress;
    rule(trace.query == TracePlan::Query::Plain || compute, "trace.query", "needs the compute stage and a descriptor");
    rule(!trace.optimized || (!traced && compute && !constant), "trace.optimized",
         "needs a ray query in the compute stage, ray flags of run time and a descriptor");
    rule(isNamed(kOtherEntryNames, trace.otherEntry), "trace.otherEntry", "no such entry point");
    rule(trace.otherEntry == OtherEntry::None || trace.otherEntry == OtherEntry::Empty ||
             trace.stage != VK_SHADER_STAGE_TASK_BIT_EXT,
         "trace.otherEntry", "shares a function that ends a task shader");
    rule(!trace.shaderObjects || (trace.stage == VK_SHADER_STAGE_COMPUTE_BIT && !trace.inlineModules),
         "trace.shaderObjects", "needs the compute stage, and is without modules");
    rule(!trace.rebound || trace.stage == VK_SHADER_STAGE_COMPUTE_BIT, "trace.rebound", "needs the compute stage");
    rule(!trace.vertexBuffers || (trace.stage == VK_SHADER_STAGE_VERTEX_BIT && !trace.byAddress && !constant),
         "trace.vertexBuffers", "need the vertex stage, ray flags of run time and a descriptor");
    rule(!trace.dynamicStrides || trace.vertexBuffers, "trace.dynamicStrides", "without vertexBuffers");
    constexpr VkShaderStageFlags kDraws =
        VK_SHADER_STAGE_ALL_GRAPHICS | VK_SHADER_STAGE_TASK_BIT_EXT | VK_SHADER_STAGE_MESH_BIT_EXT;
    rule(!trace.launch.counted || (!traced && (static_cast<VkShaderStageFlags>(trace.stage) & kDraws) != 0 &&
                                   trace.launch.command != Launch::Direct),
         "trace.counted", "needs an indirect draw");
    rule(isNamed(kAttributeNames, trace.attributes), "trace.attributes", "no such type");
    rule(trace.otherPipelines.size() <= 8 && (!trace.firstDestroyed || !trace.otherPipelines.empty()),
         "trace.otherPipelines", "too many, or none although the first is destroyed");
    const Scene after = sceneAfter(c);
    checkPipeline(c, after, trace.pipeline, "trace.pipeline");
    for (size_t i = 0; i < trace.otherPipelines.size(); ++i)
        checkPipeline(c, after, trace.otherPipelines[i], fmt::format("trace.otherPipelines[{}]", i));
}

void checkPlans(const Case &c)
{
    rule(isNamed(kMemoryNames, c.memory), "memory", "no such kind");
    rule(isNamed(kBuildCommandNames, c.build.micromaps) && c.build.micromaps != BuildCommand::Indirect,
         "build.micromaps", "are built on device or host");
    rule(isNamed(kBuildCommandNames, c.build.structures) && c.build.structures != BuildCommand::Host,
         "build.structures", "are built on the device");
    // VkMicromapBuildSizesInfoEXT: sizes are for the build type of the query.
    rule((c.build.micromaps != BuildCommand::Host && std::ranges::none_of(c.steps, &Step::host)) ||
             std::ranges::all_of(c.scene.micromaps, &oracle::SceneMicromap::onHost),
         "scene.micromaps", "lack sizes for builds on the host");
    rule(isNamed(kConditionalNames, c.build.conditional), "build.conditional", "no such predicate");
    rule(c.build.threads >= 1 && c.build.threads <= kMostThreads, "build.threads", "{} is not 1 to {}", c.build.threads,
         kMostThreads);
    const auto haveRecords = [](const std::vector<oracle::Instance> &instances) {
        return std::ranges::all_of(instances, [](const oracle::Instance &i) { return i.record.has_value(); });
    };
    rule(c.trace.method == TracePlan::Method::Query ||
             std::ranges::all_of(c.scene.objects,
                                 [](const oracle::Object &o) { return o.meshes.size() <= oracle::kMostGeometries; }) ||
             (haveRecords(c.scene.instances) &&
              std::ranges::all_of(c.steps, [&](const Step &step) { return haveRecords(step.instances); })),
         "trace.method",
         "an object has more than {} meshes, for which there are no hit records, and an instance has no record of its "
         "own",
         oracle::kMostGeometries);
    rule(c.steps.size() <= kMostSteps, "steps", "are {}, not at most {}", c.steps.size(), kMostSteps);
    rule(c.queries.size() <= kMostQueryPlans, "queries", "are {}, not at most {}", c.queries.size(), kMostQueryPlans);
    for (const QueryPlan &plan : c.queries)
        rule(plan.commands.size() <= kMostQueryCommands, "queries", "have {} commands, not at most {}",
             plan.commands.size(), kMostQueryCommands);
    rule(!c.build.single || c.steps.empty(), "build.single", "has steps");
    rule(!c.build.single || c.queries.empty(), "build.single", "has queries");
    rule(!c.build.single || c.addressCopies.commands.empty(), "build.single", "has copies at addresses");
    rule(!c.build.mixed || c.build.together, "build.mixed", "is not together");
    rule(!c.build.deferred || c.build.micromaps == BuildCommand::Host, "build.deferred", "is no host build");
    rule(c.build.spareTriangles <= 1000, "build.spareTriangles", "{} is too large", c.build.spareTriangles);
    rule(c.build.spareInstances <= 1000, "build.spareInstances", "{} is too large", c.build.spareInstances);
    rule(c.build.skippedInstances <= 1000, "build.skippedInstances", "{} is too large", c.build.skippedInstances);
    rule(!c.build.single || !c.build.otherTop, "build.otherTop", "is in a command buffer with all builds");
    rule(!c.build.lateInputs || c.memory == Memory::Apart, "build.lateInputs", "are written to memory that is watched");
    rule(!c.build.backwards || c.build.single, "build.backwards", "is not single");
    rule(!c.trace.rerecorded || (!c.build.single && !c.trace.besideBuild), "trace.rerecorded",
         "is with builds in the same command buffer");
    rule(!c.build.secondDevice || c.build.threads == 1, "build.secondDevice", "is used by several threads");
}

void check(const Case &c)
{
    const Scene &scene = c.scene;
    rule(!scene.objects.empty() && !scene.instances.empty() && !scene.rays.empty(), "scene",
         "needs an object, an instance and a ray");
    rule(std::isfinite(scene.edge) && scene.edge > 0 && scene.edge < 0.1f, "scene.edge", "is not between 0 and 0.1");
    checkStructureFlags(scene.topFlags, "scene.topFlags");
    uint64_t states = 0;
    for (size_t i = 0; i < scene.micromaps.size(); ++i)
        checkMicromap(scene.micromaps[i], fmt::format("scene.micromaps[{}]", i), states);
    for (size_t i = 0; i < scene.objects.size(); ++i)
        checkObject(scene, scene.objects[i], fmt::format("scene.objects[{}]", i));
    for (size_t i = 0; i < scene.instances.size(); ++i)
        checkInstance(scene, scene.instances[i], fmt::format("scene.instances[{}]", i));
    for (size_t i = 0; i < scene.rays.size(); ++i)
        checkRay(scene.rays[i], fmt::format("scene.rays[{}]", i));
    checkSteps(c, states);
    checkQueries(c);
    checkAddressCopies(c);
    checkPlans(c);
    checkTrace(c);
}

} // namespace

std::string invalid(const Case &c)
{
    try {
        check(c);
    } catch (const Broken &broken) {
        return broken.what;
    }
    return {};
}

} // namespace vellum::check
