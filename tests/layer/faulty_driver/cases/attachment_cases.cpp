// SPDX-License-Identifier: Apache-2.0
// Faults of attachments.cpp.
#include "faulty_driver/cases/cases.h"

namespace faults
{
namespace
{

using namespace vt;

// The states of triangles with these micromap indices.
std::string statesBy(Gpu &gpu, MicromapInput input, Attachment attachment)
{
    const auto micromap = built(gpu, std::move(input));
    const auto triangles = static_cast<uint32_t>(attachment.indices.size());
    return RowScene(gpu, micromap.get(), triangles, std::move(attachment)).states();
}

std::string baseWithoutIndices(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({3, 0, 1, 2}));
    return RowScene(gpu, micromap.get(), 3, {.base = 1}).states();
}

std::string baseTwice(Gpu &gpu)
{
    return statesBy(gpu, uniform({3, 0, 1, 2}), {.indexType = VK_INDEX_TYPE_UINT32, .indices = {0, 1}, .base = 1});
}

std::string baseOnSpecial(Gpu &gpu)
{
    return statesBy(gpu, uniform({3, 2}), {.indexType = VK_INDEX_TYPE_UINT16, .indices = {-1, -2}, .base = 2});
}

std::string indexBytes(Gpu &gpu)
{
    return statesBy(gpu, uniform({0, 1, 2}), {.indexType = VK_INDEX_TYPE_UINT8_EXT, .indices = {1, 0, 2, 1}});
}

std::string shortSpecial(Gpu &gpu)
{
    return statesBy(gpu, uniform({0}), {.indexType = VK_INDEX_TYPE_UINT16, .indices = {-1, -2, -3, -4}});
}

std::string lowByte(Gpu &gpu)
{
    MicromapInput input;
    for (int i = 0; i < 256; ++i)
        input.add(0, kFourState, std::array{uint8_t{1}});
    return statesBy(gpu, std::move(input), {.indexType = VK_INDEX_TYPE_UINT32, .indices = {0xfb, 0xfc, 0xfd, 0xff}});
}

std::string indexStride(Gpu &gpu)
{
    return statesBy(gpu, uniform({0, 1, 2}), {.indexType = VK_INDEX_TYPE_UINT32, .indices = {0, 1, 2}, .stride = 8});
}

std::string nullMicromap(Gpu &gpu)
{
    return RowScene(gpu, nullptr, 3, {.indexType = VK_INDEX_TYPE_UINT16, .indices = {-1, -3, -4}}).states();
}

std::string twoGeometries(Gpu &gpu)
{
    const auto first = built(gpu, uniform({0})), second = built(gpu, uniform({1}));
    Geometry left{.vertices = triangleRow(1)}, right{.vertices = triangleRow(1, {1.5f, 0, 0})};
    left.micromap = Attachment{first.get()};
    right.micromap = Attachment{second.get()};
    const Blas blas(gpu, {left, right});
    return statesOf(gpu, Tlas(gpu, {instance(blas, {}, 1)}), 2);
}

std::string opaqueGeometry(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({0, 1, 2, 3}));
    return RowScene(gpu, micromap.get(), 4, {}, VK_GEOMETRY_OPAQUE_BIT_KHR).states();
}

// The states of a row of three triangles, each 0, 1 and 2, in another form.
std::string statesIn(Gpu &gpu, void (*change)(Geometry &))
{
    const auto micromap = built(gpu, uniform({0, 1, 2}));
    Geometry geometry{.vertices = triangleRow(3)};
    geometry.micromap = Attachment{micromap.get()};
    change(geometry);
    const Blas blas(gpu, {geometry});
    return statesOf(gpu, Tlas(gpu, {instance(blas, {}, 1)}), 3);
}

std::string indexed(Gpu &gpu)
{
    return statesIn(gpu, [](Geometry &geometry) {
        geometry.indexType = VK_INDEX_TYPE_UINT16;
        geometry.indices = {0, 1, 2, 3, 4, 5, 6, 7, 8};
    });
}

// The first two triangles are exchanged.
std::string exchanged(Gpu &gpu)
{
    return statesIn(gpu, [](Geometry &geometry) {
        geometry.indexType = VK_INDEX_TYPE_UINT32;
        geometry.indices = {3, 4, 5, 0, 1, 2, 6, 7, 8};
    });
}

std::string transformed(Gpu &gpu)
{
    return statesIn(gpu, [](Geometry &geometry) {
        geometry.transform = VkTransformMatrixKHR{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    });
}

std::string flat(Gpu &gpu)
{
    return statesIn(gpu, [](Geometry &geometry) { geometry.vertexFormat = VK_FORMAT_R32G32_SFLOAT; });
}

std::string noDuplicates(Gpu &gpu)
{
    return statesIn(gpu,
                    [](Geometry &geometry) { geometry.flags = VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR; });
}

// Geometries of one triangle each, and one without in between.
std::string threeGeometries(Gpu &gpu, bool byPointer)
{
    const auto first = built(gpu, uniform({0})), second = built(gpu, uniform({1}));
    Geometry left{.vertices = triangleRow(1), .byPointer = byPointer}, right{.vertices = triangleRow(1, {1.5f, 0, 0})};
    Geometry none;
    left.micromap = none.micromap = Attachment{first.get()};
    right.micromap = Attachment{second.get()};
    const Blas blas(gpu, {left, none, right});
    return statesOf(gpu, Tlas(gpu, {instance(blas, {}, 1)}), 2);
}

std::string byPointers(Gpu &gpu)
{
    return threeGeometries(gpu, true);
}

std::string emptyBetween(Gpu &gpu)
{
    return threeGeometries(gpu, false);
}

std::string skippedTriangle(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({0, 1, 2}));
    Geometry geometry{.vertices = triangleRow(3), .skippedTriangles = 1};
    geometry.micromap = Attachment{.micromap = micromap.get(), .indexType = VK_INDEX_TYPE_UINT32, .indices = {0, 1, 2}};
    const Blas blas(gpu, {geometry});
    return statesOf(gpu, Tlas(gpu, {instance(blas, {}, 1)}), 3).substr(1);
}

std::string unknownSpecial(Gpu &gpu)
{
    return statesBy(gpu, uniform({0}), {.indexType = VK_INDEX_TYPE_UINT32, .indices = {-3, -4}});
}

constexpr VkBuildAccelerationStructureFlagsKHR kUpdate =
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR |
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT;

std::string fastTrace(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({0, 1}));
    return RowScene(gpu, micromap.get(), 2, {}, 0, VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR).states();
}

std::string updatedElsewhere(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({0, 1}));
    Geometry geometry{.vertices = triangleRow(2)};
    geometry.micromap = Attachment{micromap.get()};
    const Blas source(gpu, {geometry}, kUpdate);
    Blas target(gpu);
    target.updateFrom(&source);
    target.build({geometry}, kUpdate, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    return statesOf(gpu, Tlas(gpu, {instance(target, {}, 1)}), 2);
}

// After an update with other indices, or with another micromap.
std::string updated(Gpu &gpu, std::vector<int32_t> indices, MicromapInput other)
{
    const auto first = built(gpu, uniform({0, 1})), second = built(gpu, std::move(other));
    Attachment attachment{.indexType = VK_INDEX_TYPE_UINT32, .indices = {0, 1}};
    RowScene scene(gpu, first.get(), 2, attachment, 0, kUpdate);
    attachment.indices = std::move(indices);
    scene.update(second.get(), attachment);
    return scene.states();
}

std::string updatedSame(Gpu &gpu)
{
    return updated(gpu, {0, 1}, uniform({0, 1}));
}

std::string updatedIndices(Gpu &gpu)
{
    return updated(gpu, {1, 0}, uniform({0, 1}));
}

std::string updatedMicromap(Gpu &gpu)
{
    return updated(gpu, {0, 1}, uniform({2, 3}));
}

std::string lossyClone(Gpu &gpu)
{
    const auto original = built(gpu, uniform({0, 1}), kLossy);
    const Micromap clone(gpu, *original, original->size());
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, original->handle(), clone.handle(), VK_COPY_MICROMAP_MODE_CLONE_EXT);
    });
    return statesOfMicromap(gpu, clone);
}

std::string lossyUpdate(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({0, 1}), kLossy);
    RowScene scene(gpu, micromap.get(), 2, {}, 0, kUpdate);
    scene.update(micromap.get(), {});
    return scene.states();
}

std::string changedOriginal(Gpu &gpu)
{
    const auto original = built(gpu, uniform({0})), other = built(gpu, uniform({1}));
    const Micromap clone(gpu, *original, original->size());
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, original->handle(), clone.handle(), VK_COPY_MICROMAP_MODE_CLONE_EXT);
    });
    buildFrom(gpu, *other, *original);
    return statesOfMicromap(gpu, clone);
}

std::string compacted(Gpu &gpu)
{
    const auto original = built(gpu, uniform({0, 1, 2, 0}), VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    const Micromap target(gpu, *original, original->size());
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, original->handle(), target.handle(), VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    });
    return statesOfMicromap(gpu, target);
}

// The states of the first and the last of many geometries; those before the last are transparent, the last is opaque.
template <uint32_t count>
std::string geometries(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({0, 1}));
    Geometry geometry{.vertices = triangleRow(1)};
    geometry.micromap = Attachment{.micromap = micromap.get(), .indexType = VK_INDEX_TYPE_UINT32, .indices = {0}};
    std::vector<Geometry> all(count, geometry);
    all.back().vertices = triangleRow(1, {1.5f, 0, 0});
    all.back().micromap->indices = {1};
    const Blas blas(gpu, std::move(all));
    return statesOf(gpu, Tlas(gpu, {instance(blas, {}, 1)}), 2);
}

// As above, for the number of triangles of a geometry.
template <uint32_t count>
std::string triangles(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({0, 1}));
    Attachment attachment{.indexType = VK_INDEX_TYPE_UINT32, .indices = std::vector<int32_t>(count, 0)};
    attachment.indices.back() = 1;
    RowScene scene(gpu, micromap.get(), count, std::move(attachment));
    return statesAt(gpu, scene.tlas(), std::array{Vec3{0.3f, 0.3f, 1}, Vec3{1.5f * (count - 1) + 0.3f, 0.3f, 1}});
}

// The state of the last triangle of a micromap that is reached by this index type, index and base.
template <uint32_t count>
std::string lastOf(Gpu &gpu, VkIndexType type, uint32_t base)
{
    MicromapInput input;
    for (uint32_t i = 0; i < count; ++i)
        input.add(0, kFourState, std::array{uint8_t{i + 1 == count}});
    return statesBy(gpu, std::move(input),
                    {.indexType = type, .indices = {0, static_cast<int32_t>(count - 1 - base)}, .base = base});
}

} // namespace

std::span<const Case> attachmentCases()
{
    static const std::array cases{
        Case{"base-without-indices", baseWithoutIndices, "012", "301"},
        Case{"base-twice", baseTwice, "01", "12"},
        Case{"base-on-special-indices", baseOnSpecial, "01", "23"},
        Case{"index-8-as-16", indexBytes, "1021", "1331"},
        Case{"special-index-not-extended", shortSpecial, "0123", "3333"},
        Case{"special-index-by-low-byte", lowByte, "1111", "1320"},
        Case{"index-stride", indexStride, "012", "031"},
        Case{"null-micromap-opaque", nullMicromap, "023", "111"},
        Case{"micromap-of-first-geometry", twoGeometries, "01", "00"},
        Case{"opaque-geometry-without-micromap", opaqueGeometry, "0123", "1111"},
        Case{"indexed-geometry-without-micromap", indexed, "012", "nnn"},
        Case{"transformed-geometry-without-micromap", transformed, "012", "nnn"},
        Case{"other-vertex-format-without-micromap", flat, "012", "nnn"},
        Case{"no-duplicates-without-micromap", noDuplicates, "012", "nnn"},
        Case{"micromap-by-vertex-index", exchanged, "102", "012"},
        Case{"geometry-pointers-as-first", byPointers, "01", "00"},
        Case{"empty-geometry-shifts-micromaps", emptyBetween, "01", "00"},
        Case{"primitive-offset-moves-indices", skippedTriangle, "01", "12"},
        Case{"special-unknown-swapped", unknownSpecial, "23", "32"},
        Case{"update-drops-micromap", updatedSame, "01", "nn"},
        Case{"fast-trace-without-micromap", fastTrace, "01", "nn"},
        Case{"update-elsewhere-drops-micromap", updatedElsewhere, "01", "nn"},
        Case{"update-keeps-indices", updatedIndices, "10", "01"},
        Case{"update-keeps-micromap", updatedMicromap, "23", "01"},
        Case{"lossy-copy-loses-more", lossyClone, "01", "31", Api::Khr},
        Case{"lossy-once-more", lossyUpdate, "01", "31", Api::Khr},
        Case{"clone-is-shallow", changedOriginal, "0", "1"},
        Case{"compaction-loses-last-triangle", compacted, "0120", "0123"},
        Case{"geometry-index-4-bits", geometries<17>, "01", "00"},
        Case{"geometry-index-8-bits", geometries<257>, "01", "00"},
        Case{"geometry-index-16-bits", geometries<65537>, "01", "00"},
        Case{"primitive-index-10-bits", triangles<1025>, "01", "00"},
        Case{"primitive-index-16-bits", triangles<65537>, "01", "00"},
        Case{"micromap-triangles-lost-from-1024", [](Gpu &gpu) { return lastOf<1025>(gpu, VK_INDEX_TYPE_UINT32, 0); },
             "01", "03"},
        Case{"micromap-triangles-lost-from-65536", [](Gpu &gpu) { return lastOf<65537>(gpu, VK_INDEX_TYPE_UINT32, 0); },
             "01", "03"},
        Case{"base-8-bits", [](Gpu &gpu) { return lastOf<257>(gpu, VK_INDEX_TYPE_UINT16, 256); }, "11", "00"},
        Case{"base-16-bits", [](Gpu &gpu) { return lastOf<65537>(gpu, VK_INDEX_TYPE_UINT16, 65536); }, "11", "00"},
        Case{"index-8-sign-extended", [](Gpu &gpu) { return lastOf<129>(gpu, VK_INDEX_TYPE_UINT8_EXT, 0); }, "01",
             "03"},
        Case{"index-16-sign-extended", [](Gpu &gpu) { return lastOf<32769>(gpu, VK_INDEX_TYPE_UINT16, 0); }, "01",
             "03"},
    };
    return cases;
}

} // namespace faults
