// SPDX-License-Identifier: Apache-2.0
// The lookup from a triangle of a geometry to its micromap: index buffers, strides, base triangles, special indices,
// null micromaps, geometries of all kinds in one structure, and all forms of a micromap's input.
#include "check/oracle/outcome.h"
#include "harness/harness.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kIndexLabels{{"Index.*", "quirks translated packed forcing"}};

using namespace vt;

using States = std::vector<uint8_t>;

class Index : public GpuTest
{
protected:
    Index() : GpuTest({.shared = true}) {}

    // Each triangle of a row (see triangleRow), in the order of its geometry, has one state all over.
    struct Row {
        uint32_t geometry;
        float y;
        std::vector<int> states; // or kNoMicromap
        bool opaque = false;
    };

    // Shoots at the middle of every triangle, and compares what the shader saw.
    void expectRows(const Blas &blas, const std::vector<Row> &rows, uint32_t instanceFlags = 0, uint32_t rayFlags = 0)
    {
        const Tlas tlas(gpu(), {instance(blas, {}, 77, instanceFlags)});
        std::vector<Ray> rays;
        for (const Row &row : rows) {
            for (size_t i = 0; i < row.states.size(); ++i) {
                Ray ray;
                ray.origin = {1.5f * static_cast<float>(i) + 0.3f, row.y + 0.3f, 1};
                ray.rule = kAlways;
                ray.flags = rayFlags;
                rays.push_back(ray);
            }
        }
        const std::vector<Result> results = Tracer(gpu()).trace(tlas, rays);
        size_t next = 0;
        for (const Row &row : rows) {
            for (size_t i = 0; i < row.states.size(); ++i) {
                const Result &r = results[next++];
                const Outcome outcome = outcomeOf(row.states[i], row.opaque, instanceFlags, rayFlags);
                const bool hit = outcome == Outcome::Opaque || outcome == Outcome::NonOpaque;
                EXPECT_EQ(r.candidateCount, outcome == Outcome::NonOpaque ? 1u : 0u)
                    << "geometry " << row.geometry << " triangle " << i << " state " << row.states[i];
                EXPECT_EQ(r.committed, hit ? kTriangle : kNone)
                    << "geometry " << row.geometry << " triangle " << i << " state " << row.states[i];
                if (hit && r.committed == kTriangle) {
                    EXPECT_EQ(r.geometry, row.geometry);
                    EXPECT_EQ(r.primitive, i);
                    EXPECT_EQ(r.customIndex, 77u);
                }
            }
        }
    }

    // A micromap with one level-0 4-state triangle of each state, then one of level 1 of each state.
    std::unique_ptr<Micromap> eightTriangles()
    {
        MicromapInput input;
        for (const uint32_t level : {0u, 1u}) {
            for (uint8_t state = 0; state < 4; ++state)
                input.add(level, kFourState, States(1u << (2 * level), state));
        }
        auto micromap = std::make_unique<Micromap>(gpu(), std::move(input));
        micromap->build();
        return micromap;
    }

    static Geometry rowOf(uint32_t n, float y = 0)
    {
        Geometry geometry;
        geometry.vertices = triangleRow(n, {0, y, 0});
        return geometry;
    }
};

TEST_F(Index, NoIndexBuffer)
{
    const auto micromap = eightTriangles();
    Geometry geometry = rowOf(8);
    geometry.micromap = Attachment{micromap.get()};
    expectRows(Blas(gpu(), {geometry}), {{0, 0, {0, 1, 2, 3, 0, 1, 2, 3}}});
}

TEST_F(Index, NoIndexBufferBaseTriangle)
{
    const auto micromap = eightTriangles();
    Geometry geometry = rowOf(5);
    geometry.micromap = Attachment{.micromap = micromap.get(), .base = 3};
    expectRows(Blas(gpu(), {geometry}), {{0, 0, {3, 0, 1, 2, 3}}});
}

TEST_F(Index, BufferTypesStridesAndBases)
{
    const auto micromap = eightTriangles();
    for (const VkIndexType type : {VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32}) {
        for (const uint32_t stride : {4u, 8u, 12u, 64u}) {
            for (const uint32_t base : {0u, 2u}) {
                SCOPED_TRACE(testing::Message() << "type " << type << " stride " << stride << " base " << base);
                Geometry geometry = rowOf(8);
                geometry.micromap = Attachment{micromap.get(), type, {3, -1, 1, -2, 0, -3, 5, -4}, stride, base};
                const auto state = [base](uint32_t index) { return static_cast<int>((index + base) % 4); };
                expectRows(Blas(gpu(), {geometry}), {{0, 0, {state(3), 0, state(1), 1, state(0), 2, state(5), 3}}});
            }
        }
    }
}

TEST_F(Index, TightSixteenBits)
{
    const auto micromap = eightTriangles();
    Geometry geometry = rowOf(7);
    geometry.micromap = Attachment{micromap.get(), VK_INDEX_TYPE_UINT16, {7, -4, 6, -3, 5, -2, 4}};
    expectRows(Blas(gpu(), {geometry}), {{0, 0, {3, 3, 2, 2, 1, 1, 0}}});
}

TEST_F(Index, BufferThatStartsInsideItsMemory)
{
    const auto micromap = eightTriangles();
    Geometry geometry = rowOf(4);
    geometry.micromap = Attachment{
        .micromap = micromap.get(), .indexType = VK_INDEX_TYPE_UINT16, .indices = {1, 0, 3, 2}, .indexOffset = 6};
    expectRows(Blas(gpu(), {geometry}), {{0, 0, {1, 0, 3, 2}}});
}

TEST_F(Index, StrideZeroReadsTheFirstIndex)
{
    const auto micromap = eightTriangles();
    for (const VkIndexType type : {VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32}) {
        Geometry geometry = rowOf(4);
        geometry.micromap = Attachment{micromap.get(), type, {1, 1, 1, 1}, 0};
        expectRows(Blas(gpu(), {geometry}), {{0, 0, {1, 1, 1, 1}}});
        geometry.micromap = Attachment{micromap.get(), type, {-4}, 0};
        geometry.vertices = triangleRow(1);
        expectRows(Blas(gpu(), {geometry}), {{0, 0, {3}}});
    }
}

TEST_F(Index, NullMicromapWithSpecialIndices)
{
    for (const VkIndexType type : {VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32}) {
        Geometry geometry = rowOf(6);
        geometry.micromap = Attachment{nullptr, type, {-4, -3, -2, -1, -2, -3}};
        const Blas blas(gpu(), {geometry});
        expectRows(blas, {{0, 0, {3, 2, 1, 0, 1, 2}}});
        expectRows(blas, {{0, 0, {3, 2, 1, 0, 1, 2}}}, kFlagTwoState);
        expectRows(blas, {{0, 0, {3, 2, 1, 0, 1, 2}}}, 0, kRayForceTwoState);
    }
}

TEST_F(Index, MixedGeometries)
{
    const auto micromap = eightTriangles();
    Geometry first = rowOf(4, 0);
    first.micromap = Attachment{micromap.get(), VK_INDEX_TYPE_UINT32, {2, 1, 0, 3}};
    Geometry plain = rowOf(3, 2);
    Geometry opaque = rowOf(3, 4);
    opaque.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
    Geometry last = rowOf(8, 6);
    last.micromap = Attachment{micromap.get()};
    last.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
    const Blas blas(gpu(), {first, plain, opaque, last},
                    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT);
    const std::vector<Row> rows{{0, 0, {2, 1, 0, 3}},
                                {1, 2, {kNoMicromap, kNoMicromap, kNoMicromap}},
                                {2, 4, {kNoMicromap, kNoMicromap, kNoMicromap}, true},
                                {3, 6, {0, 1, 2, 3, 0, 1, 2, 3}, true}};
    for (const uint32_t instanceFlags : {0u, 4u, 8u, 0x10u, 0x14u, 0x18u, 0x20u, 0x24u, 0x28u}) {
        for (const uint32_t rayFlags : {0u, 1u, 2u, 0x40u, 0x80u, 0x400u, 0x480u}) {
            SCOPED_TRACE(testing::Message() << std::hex << "instance " << instanceFlags << " ray " << rayFlags);
            expectRows(blas, rows, instanceFlags, rayFlags);
        }
    }
}

TEST_F(Index, IndexedTrianglesAndPrimitiveOffsets)
{
    const auto micromap = eightTriangles();
    for (const VkIndexType type : {VK_INDEX_TYPE_NONE_KHR, VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32}) {
        SCOPED_TRACE(testing::Message() << "type " << type);
        // The first two triangles are skipped by the build range: triangle numbers start after them.
        Geometry geometry;
        geometry.vertices = triangleRow(7, {-3, 0, 0});
        geometry.skippedTriangles = 2;
        geometry.indexType = type;
        if (type != VK_INDEX_TYPE_NONE_KHR) {
            for (uint32_t i = 0; i < geometry.vertices.size(); ++i)
                geometry.indices.push_back(i);
        }
        geometry.micromap = Attachment{micromap.get(), VK_INDEX_TYPE_UINT16, {1, 0, 3, -1, -2}};
        expectRows(Blas(gpu(), {geometry}), {{0, 0, {1, 0, 3, 0, 1}}});
    }
}

TEST_F(Index, UsagesStridesAndSharedData)
{
    // All formats and some levels in one micromap, records 24 bytes apart, the last three reading the data of the
    // first.
    MicromapInput input;
    std::vector<int> states;
    for (const uint16_t format : {kFourState, kTwoState}) {
        for (uint32_t level = 0; level <= 6; ++level) {
            const auto state = static_cast<uint8_t>(level % (format == kTwoState ? 2 : 4));
            input.add(level, format, States(1u << (2 * level), state));
            states.push_back(state);
        }
    }
    for (uint16_t level = 1; level <= 3; ++level) {
        input.triangles.push_back({input.triangles[6].dataOffset, level, kFourState});
        states.push_back(6 % 4);
    }
    input.stride = 24;
    Micromap micromap(gpu(), std::move(input));
    micromap.build();
    Geometry geometry = rowOf(static_cast<uint32_t>(states.size()));
    geometry.micromap = Attachment{&micromap};
    expectRows(Blas(gpu(), {geometry}), {{0, 0, states}});
}

TEST_F(Index, UsageCountsBehindPointers)
{
    MicromapInput input;
    for (uint8_t state = 0; state < 4; ++state)
        input.add(state, kFourState, States(1u << (2 * state), state));
    Micromap micromap(gpu(), std::move(input));
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    std::vector<const VkMicromapUsageEXT *> pointers;
    for (uint32_t i = 0; i < info.usageCountsCount; ++i)
        pointers.push_back(info.pUsageCounts + i);
    const VkMicromapBuildSizesInfoEXT one = micromapSizes(gpu(), info);
    info.pUsageCounts = nullptr;
    info.ppUsageCounts = pointers.data();
    const VkMicromapBuildSizesInfoEXT two = micromapSizes(gpu(), info);
    EXPECT_EQ(one.micromapSize, two.micromapSize);
    EXPECT_EQ(one.buildScratchSize, two.buildScratchSize);
    EXPECT_GT(one.buildScratchSize, 0u) << "a buffer of this size must be possible";
    gpu().submit([&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu(), commands, std::array{MicromapBuild{info, micromap.handle()}});
    });
    Geometry geometry = rowOf(4);
    geometry.micromap = Attachment{&micromap};
    expectRows(Blas(gpu(), {geometry}), {{0, 0, {0, 1, 2, 3}}});
}

TEST_F(Index, SeveralMicromapsInOneCommand)
{
    std::vector<std::unique_ptr<Micromap>> micromaps;
    std::vector<MicromapBuild> builds;
    for (uint8_t k = 0; k < 5; ++k) {
        MicromapInput input;
        for (uint8_t i = 0; i < 4; ++i)
            input.add(k, kFourState, States(1u << (2 * k), static_cast<uint8_t>((i + k) % 4)));
        micromaps.push_back(std::make_unique<Micromap>(gpu(), std::move(input)));
        builds.push_back({micromaps.back()->buildInfo(), micromaps.back()->handle()});
    }
    gpu().submit([&](VkCommandBuffer commands) { recordMicromapBuilds(gpu(), commands, builds); });
    std::vector<Geometry> geometries;
    std::vector<Row> rows;
    for (uint32_t k = 0; k < micromaps.size(); ++k) {
        const float y = 2.0f * static_cast<float>(k);
        geometries.push_back(rowOf(4, y));
        geometries.back().micromap = Attachment{micromaps[k].get()};
        const int shift = static_cast<int>(k);
        rows.push_back({k, y, {shift % 4, (shift + 1) % 4, (shift + 2) % 4, (shift + 3) % 4}});
    }
    expectRows(Blas(gpu(), geometries), rows);
}

TEST_F(Index, MicromapIsSelfContained)
{
    MicromapInput input;
    for (uint8_t state = 0; state < 4; ++state)
        input.add(5, kFourState, States(1024, state));
    auto micromap = std::make_unique<Micromap>(gpu(), std::move(input));
    micromap->build();
    micromap->scribble();
    Geometry geometry = rowOf(4);
    geometry.micromap = Attachment{micromap.get()};
    const Blas blas(gpu(), {geometry});
    expectRows(blas, {{0, 0, {0, 1, 2, 3}}});
}

TEST_F(Index, RebuildInPlaceAndBlasUpdate)
{
    constexpr VkBuildAccelerationStructureFlagsKHR flags =
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR |
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT;
    const auto micromap = eightTriangles();
    MicromapInput other;
    for (uint8_t state = 0; state < 8; ++state)
        other.add(4, kFourState, States(256, static_cast<uint8_t>(3 - state % 4)));
    Micromap second(gpu(), std::move(other));
    second.build();
    Geometry geometry = rowOf(8);
    geometry.micromap = Attachment{micromap.get()};
    Blas blas(gpu(), {geometry}, flags);
    expectRows(blas, {{0, 0, {0, 1, 2, 3, 0, 1, 2, 3}}});
    geometry.micromap = Attachment{&second};
    blas.build({geometry}, flags, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    expectRows(blas, {{0, 0, {3, 2, 1, 0, 3, 2, 1, 0}}});
}

TEST_F(Index, DestroyingNothingIsAllowed)
{
    destroyMicromap(gpu(), {});
}

TEST_F(Index, EmptyGeometryAndEmptyMicromap)
{
    const auto micromap = eightTriangles();
    Geometry empty = rowOf(1);
    empty.skippedTriangles = 1;
    empty.micromap = Attachment{micromap.get()};
    Geometry full = rowOf(4, 2);
    full.micromap = Attachment{micromap.get()};
    expectRows(Blas(gpu(), {empty, full}), {{1, 2, {0, 1, 2, 3}}});
}

TEST_F(Index, BoxesAndMicromaps)
{
    const auto micromap = eightTriangles();
    Geometry triangles = rowOf(8);
    triangles.micromap = Attachment{micromap.get()};
    const Blas mapped(gpu(), {triangles});
    Geometry boxes, opaqueBoxes;
    boxes.boxes = {{0, 10, -0.1f, 1, 11, 0.1f}};
    opaqueBoxes.boxes = {{2, 10, -0.1f, 3, 11, 0.1f}};
    opaqueBoxes.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
    const Blas boxed(gpu(), {boxes, opaqueBoxes});
    for (const uint32_t instanceFlags : {0u, 4u, 8u}) {
        const Tlas tlas(gpu(), {instance(boxed, {}, 0xfffffe, instanceFlags), instance(mapped, {}, 5, instanceFlags)});
        Tracer tracer(gpu());
        for (const uint32_t rayFlags : {0u, kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque, kRaySkipBoxes,
                                        kRaySkipTriangles, 0x400u, 0x440u, 0x480u}) {
            std::vector<Ray> rays(3);
            for (Ray &ray : rays) {
                ray.flags = rayFlags;
                ray.generate = 1;
                ray.rule = kAlways;
            }
            rays[0].origin = {0.5f, 10.5f, 1}; // a box
            rays[1].origin = {2.5f, 10.5f, 1}; // an opaque box
            rays[2].origin = {1.8f, 0.3f, 1};  // an opaque micromap triangle
            const std::vector<Result> results = tracer.trace(tlas, rays);
            for (uint32_t i = 0; i < 2; ++i) {
                SCOPED_TRACE(testing::Message() << "box " << i << std::hex << " instance flags " << instanceFlags
                                                << " ray flags " << rayFlags);
                const Outcome outcome = outcomeOf(kBox, i == 1, instanceFlags, rayFlags);
                const bool seen = outcome != Outcome::Culled && (rayFlags & kRaySkipBoxes) == 0;
                ASSERT_EQ(results[i].candidateCount, seen ? 1u : 0u);
                EXPECT_EQ(results[i].flags, rayFlags);
                EXPECT_EQ(results[i].committed, seen ? kGenerated : kNone);
                if (!seen)
                    continue;
                EXPECT_EQ(results[i].candidates[0].boxOpaque(), outcome == Outcome::Opaque);
                EXPECT_EQ(results[i].candidates[0].customIndex, 0xfffffeu);
                EXPECT_EQ(results[i].customIndex, 0xfffffeu);
                EXPECT_EQ(results[i].geometry, i);
            }
            const Outcome outcome = outcomeOf(1, false, instanceFlags, rayFlags);
            const bool hit = outcome != Outcome::Culled && (rayFlags & kRaySkipTriangles) == 0;
            EXPECT_EQ(results[2].committed, hit ? kTriangle : kNone);
            EXPECT_EQ(results[2].candidateCount, hit && outcome == Outcome::NonOpaque ? 1u : 0u);
        }
    }
}

} // namespace
