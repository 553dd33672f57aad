// SPDX-License-Identifier: Apache-2.0
// The content of a structure belongs to its memory range, not to a handle, and a handle's size says nothing: GENERIC
// structures that are larger than their content, and several of them in one range.
#include <array>

#include "structures/constants.h"
#include "structures/copy_test.h"

namespace
{

using namespace vt;

constexpr uint8_t kUntouched = 0x5a;

// Bytes that structures are placed in, all of them known.
class StructureLocations : public Copies
{
protected:
    static constexpr VkDeviceSize kBytes = 1 << 20;

    explicit StructureLocations(const Options &options = {.shared = true})
        : Copies(options),
          memory_(gpu(), kBytes, 256,
                  VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT)
    {
        std::memset(memory_.bytes(), kUntouched, kBytes);
    }
    std::unique_ptr<Structure> placed(VkDeviceSize offset, VkDeviceSize size,
                                      VkAccelerationStructureTypeKHR type = kGeneric)
    {
        auto structure = std::make_unique<Structure>(gpu(), type);
        structure->placeIn(memory_.buffer(), memory_.offset() + offset);
        structure->create(size);
        return structure;
    }
    std::unique_ptr<Structure> toTheEnd(VkDeviceSize offset) { return placed(offset, kBytes - offset); }
    void expectUntouchedFrom(VkDeviceSize offset) const
    {
        for (VkDeviceSize i = offset; i < kBytes; ++i)
            ASSERT_EQ(memory_.bytes()[i], kUntouched) << "byte " << i << ", " << i - offset << " behind the structure";
    }
    std::vector<std::string> seenIn(const Structure &scene)
    {
        const auto rays = Patchwork::rays();
        return seen(gpu(), scene, rays);
    }

    Guarded memory_;
};

// The size no longer identifies the kind of structure.
TEST_F(StructureLocations, DataOfEitherLevelIntoHandlesOfAnySize)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const Tlas tlas(gpu(), {instance(blas, {}, 77)});
    const auto expected = seenIn(tlas);
    ASSERT_EQ(expected, seenOf(gpu(), blas));
    for (const bool top : {false, true}) {
        const Serialized data = serialize(gpu(), top ? static_cast<const Structure &>(tlas) : blas);
        const VkDeviceSize least = data.deserializedSize();
        for (const VkDeviceSize more : {0u, 16u, 64u, 128u, 192u, 65536u}) {
            SCOPED_TRACE(std::to_string(top) + " + " + std::to_string(more));
            std::memset(memory_.bytes(), kUntouched, kBytes);
            const auto loaded = placed(256, least + more);
            deserialize(gpu(), data, *loaded);
            EXPECT_EQ(top ? seenIn(*loaded) : seenOf(gpu(), *loaded), expected);
            expectUntouchedFrom(256 + least);
            // Copies know by now what it is.
            const auto clone = toTheEnd(kBytes / 2);
            copy(gpu(), *loaded, *clone);
            EXPECT_EQ(top ? seenIn(*clone) : seenOf(gpu(), *clone), expected);
            expectUntouchedFrom(kBytes / 2 + least);
        }
    }
}

// Whatever the data is rejected for, what lies behind the structure stays.
TEST_F(StructureLocations, DamagedDataIntoALargeHandle)
{
    const Blas blas(gpu(), plain());
    Serialized data = serialize(gpu(), blas);
    data.bytes()[data.bytes().size() / 2] ^= 1; // of the driver's part, which the checksum covers
    const auto loaded = toTheEnd(256);
    deserialize(gpu(), data, *loaded);
    EXPECT_EQ(seenOf(gpu(), *loaded), std::vector<std::string>(Patchwork::rays().size()));
    gpu().submit([](VkCommandBuffer) {}); // findings of shaders are reported with the next commands
    const auto messages = gpu().takeUnexpectedMessages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(messages[0].id, "VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-04960");
    expectUntouchedFrom(256 + data.deserializedSize());
}

TEST_F(StructureLocations, SeveralHandlesForOneContent)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries());
    const auto expected = seenOf(gpu(), source);
    auto first = toTheEnd(256);
    const auto second = placed(256, source.size());
    copy(gpu(), source, *first);
    // The content does not depend on the handles by which it was written and read.
    EXPECT_EQ(seenOf(gpu(), *second), expected);
    first.reset();
    EXPECT_EQ(seenOf(gpu(), *second), expected);
    const auto third = toTheEnd(256);
    const auto clone = toTheEnd(kBytes / 2);
    copy(gpu(), *third, *clone);
    EXPECT_EQ(seenOf(gpu(), *clone), expected);
    EXPECT_EQ(queried(gpu(), *third, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR),
              queried(gpu(), source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR));
}

// As in an engine that compacts structures which it updates later: the copies are adjacent in memory.
TEST_F(StructureLocations, UpdatesOfPackedCompactedStructures)
{
    constexpr VkBuildAccelerationStructureFlagsKHR kFlags =
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR | VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    const Patchwork patchwork(gpu(), 1);
    Blas blas(gpu(), patchwork.geometries(), kFlags);
    const auto expected = seenOf(gpu(), blas);
    const VkDeviceSize size =
        (queried(gpu(), blas, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR) + 255) / 256 * 256;
    std::array<std::unique_ptr<Structure>, 3> packed;
    for (size_t i = 0; i < packed.size(); ++i) {
        packed[i] = toTheEnd(256 + i * size);
        copy(gpu(), blas, *packed[i], VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    }
    for (const size_t updated : {1u, 0u, 2u}) {
        SCOPED_TRACE(updated);
        blas.prepare(patchwork.geometries(), kFlags, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
        VkAccelerationStructureBuildGeometryInfoKHR info = blas.buildInfo();
        info.srcAccelerationStructure = info.dstAccelerationStructure = packed[updated]->handle();
        gpu().submit([&](VkCommandBuffer commands) {
            const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
            gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
        });
        for (const auto &structure : packed)
            EXPECT_EQ(seenOf(gpu(), *structure), expected);
    }
    expectUntouchedFrom(256 + packed.size() * size);
}

// Builds and updates of one structure whose commands state other maximum counts. Validation 1.3.239 does not know of
// indirect builds.
class LocationsOfOtherCounts : public StructureLocations
{
protected:
    static constexpr uint32_t kSpare = 50;

    LocationsOfOtherCounts() : StructureLocations({.oldValidation = false, .quirks = "capable"}) {}

    // A build of the patchwork; `spare`: as many more triangles of each geometry are possible.
    std::unique_ptr<Blas> prepared(VkBuildAccelerationStructureModeKHR mode, uint32_t spare)
    {
        auto geometries = patchwork_.geometries();
        for (Geometry &geometry : geometries) {
            const auto more = triangleRow(spare);
            geometry.vertices.insert(geometry.vertices.end(), more.begin(), more.end());
            geometry.spareTriangles = spare;
        }
        auto blas = std::make_unique<Blas>(gpu());
        blas->prepare(std::move(geometries), kUpdatable, mode);
        return blas;
    }
    // Carries out what is prepared, indirectly.
    void build(const Blas &prepared, const Structure *source, const Structure &target)
    {
        VkAccelerationStructureBuildGeometryInfoKHR info = prepared.buildInfo();
        info.srcAccelerationStructure = source ? source->handle() : VK_NULL_HANDLE;
        info.dstAccelerationStructure = target.handle();
        std::vector<uint32_t> most;
        for (uint32_t g = 0; g < info.geometryCount; ++g)
            most.push_back(prepared.maxPrimitives(g));
        const Buffer ranges = gpu().upload(std::span(prepared.ranges(), info.geometryCount),
                                           VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
        const VkDeviceAddress address = ranges.address();
        const uint32_t stride = sizeof(VkAccelerationStructureBuildRangeInfoKHR);
        const uint32_t *counts = most.data();
        gpu().submit([&](VkCommandBuffer commands) {
            gpu().vk().CmdBuildAccelerationStructuresIndirectKHR(commands, 1, &info, &address, &stride, &counts);
        });
    }
    static constexpr auto kBuild = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;

    const Patchwork patchwork_{gpu()};
};

// The records of the source begin where those of the target may not.
TEST_F(LocationsOfOtherCounts, UpdateIntoLessMemory)
{
    const auto source = prepared(kBuild, kSpare), update = prepared(kUpdate, 0);
    build(*source, nullptr, *source);
    const auto expected = seenOf(gpu(), *source);
    const auto target = toTheEnd(256);
    build(*update, source.get(), *target);
    EXPECT_EQ(seenOf(gpu(), *target), expected);
    expectUntouchedFrom(256 + prepared(kBuild, 0)->size());
    EXPECT_EQ(seenOf(gpu(), *source), expected);
}

TEST_F(LocationsOfOtherCounts, UpdatesInPlace)
{
    const Blas fresh(gpu(), patchwork_.geometries());
    const auto expected = seenOf(gpu(), fresh);
    for (const bool growing : {false, true}) {
        SCOPED_TRACE(growing);
        std::memset(memory_.bytes(), kUntouched, kBytes);
        const auto first = prepared(kBuild, growing ? 0 : kSpare), update = prepared(kUpdate, growing ? kSpare : 0);
        const VkDeviceSize size = prepared(kBuild, kSpare)->size();
        const auto target = placed(256, size);
        build(*first, nullptr, *target);
        EXPECT_EQ(seenOf(gpu(), *target), expected);
        for (int round = 0; round < 2; ++round) {
            build(*update, target.get(), *target);
            EXPECT_EQ(seenOf(gpu(), *target), expected) << round;
        }
        expectUntouchedFrom(256 + size);
    }
}

TEST_F(StructureLocations, TopLevelsSideBySide)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const Tlas source(gpu(), {instance(blas, {}, 77)});
    const auto expected = seenIn(source);
    std::array<std::unique_ptr<Structure>, 4> packed;
    const VkDeviceSize size = (source.size() + 255) / 256 * 256;
    for (size_t i = packed.size(); i-- > 0;) { // each one's handle reaches over those before it
        packed[i] = toTheEnd(256 + i * size);
        const Structure &from = i + 1 < packed.size() ? *packed[i + 1] : static_cast<const Structure &>(source);
        copy(gpu(), from, *packed[i]);
    }
    for (const auto &structure : packed)
        EXPECT_EQ(seenIn(*structure), expected);
    expectUntouchedFrom(256 + packed.size() * size);
}

// As much memory as a buffer of lavapipe can have, of which tests touch little.
class LargeMemory
{
public:
    static constexpr VkDeviceSize kBytes = (VkDeviceSize{1} << 32) - 65536;

    explicit LargeMemory(Gpu &gpu) : gpu_(gpu)
    {
        const auto info = vkInit<VkBufferCreateInfo>({.size = kBytes,
                                                      .usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                                                               VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
        VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer_));
        memory_ = gpu.bindMemory(buffer_, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, true);
    }
    ~LargeMemory()
    {
        vkDestroyBuffer(gpu_.device(), buffer_, nullptr);
        vkFreeMemory(gpu_.device(), memory_, nullptr);
    }
    LargeMemory(const LargeMemory &) = delete;
    LargeMemory &operator=(const LargeMemory &) = delete;

    // A GENERIC structure from a multiple of 64 KiB to the end.
    std::unique_ptr<Structure> structure(VkDeviceSize offset)
    {
        auto structure = std::make_unique<Structure>(gpu_, kGeneric);
        structure->placeIn(buffer_, offset);
        structure->create(kBytes - offset);
        return structure;
    }

private:
    Gpu &gpu_;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
};

void buildInto(Gpu &gpu, const Blas &blas, const Structure &target)
{
    VkAccelerationStructureBuildGeometryInfoKHR info = blas.buildInfo();
    info.dstAccelerationStructure = target.handle();
    gpu.submit([&](VkCommandBuffer commands) {
        const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    });
}

// Serialization needs memory for the data, and not for the handle. On lavapipe, and on a driver that
// writes no more of a handle than the structure needs.
class LargeLocations : public Copies, public testing::WithParamInterface<const char *>
{
protected:
    LargeLocations() : Copies({.quirks = GetParam()}) {}
};

TEST_P(LargeLocations, AreSerialized)
{
    const Patchwork patchwork(gpu());
    LargeMemory memory(gpu());
    for (const bool isPlain : {false, true}) {
        SCOPED_TRACE(isPlain);
        const std::vector<Geometry> geometries = isPlain ? plain() : patchwork.geometries();
        Blas blas(gpu(), geometries, kUpdatable);
        const auto expected = seenOf(gpu(), blas);
        const auto built = memory.structure(0), clone = memory.structure(1 << 16);
        buildInto(gpu(), blas, *built);
        EXPECT_EQ(seenOf(gpu(), *deserialized(gpu(), serialize(gpu(), *built), kBottom)), expected);
        copy(gpu(), *built, *clone);
        EXPECT_EQ(seenOf(gpu(), *deserialized(gpu(), serialize(gpu(), *clone), kBottom)), expected);
        blas.prepare(geometries, kUpdatable, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
        buildInto(gpu(), blas, *clone); // an update of `blas`, written there
        EXPECT_EQ(seenOf(gpu(), *deserialized(gpu(), serialize(gpu(), *clone), kBottom)), expected);
    }
}

INSTANTIATE_TEST_SUITE_P(Drivers, LargeLocations, testing::Values("", "structures"),
                         [](const auto &parameter) { return *parameter.param ? parameter.param : "lavapipe"; });

// The descriptor then holds what it held before.
TEST_F(StructureLocations, TheSameDataTwice)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const Tlas tlas(gpu(), {instance(blas, {}, 77)});
    const auto expected = seenIn(tlas);
    const Serialized data = serialize(gpu(), tlas);
    const auto loaded = toTheEnd(256);
    for (int round = 0; round < 2; ++round) {
        SCOPED_TRACE(round);
        deserialize(gpu(), data, *loaded);
        const auto clone = toTheEnd(kBytes / 2);
        copy(gpu(), *loaded, *clone);
        EXPECT_EQ(seenIn(*clone), expected);
    }
}

// As with a structure that is no longer used but not yet destroyed.
TEST_F(StructureLocations, TopLevelDataWhereAnotherHandleBegins)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const Tlas tlas(gpu(), {instance(blas, {}, 77)});
    const Serialized data = serialize(gpu(), tlas);
    const auto old = placed(512, 256);
    const auto loaded = placed(256, data.deserializedSize(), VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
    deserialize(gpu(), data, *loaded);
    EXPECT_EQ(seenIn(*loaded), seenIn(tlas));
}

// Every count has another size, and another handle of the driver.
TEST_F(StructureLocations, ManySizesNextToANeighbour)
{
    constexpr size_t kCounts = 80;
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const Tlas source(gpu(), {instance(blas, {}, 77)});
    const auto expected = seenIn(source);
    const auto changing = toTheEnd(256);
    for (size_t count = 1; count <= kCounts; ++count) {
        SCOPED_TRACE(count);
        Tlas tlas(gpu());
        tlas.prepare(std::vector<VkAccelerationStructureInstanceKHR>(count, instance(blas, {}, 77)));
        // As close behind it as possible.
        const auto neighbour = toTheEnd((256 + tlas.size() + 255) / 256 * 256);
        copy(gpu(), source, *neighbour);
        VkAccelerationStructureBuildGeometryInfoKHR info = tlas.buildInfo();
        info.dstAccelerationStructure = changing->handle();
        gpu().submit([&](VkCommandBuffer commands) {
            const VkAccelerationStructureBuildRangeInfoKHR *ranges = tlas.ranges();
            gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
        });
        EXPECT_EQ(seenIn(*neighbour), expected);
    }
}

} // namespace
