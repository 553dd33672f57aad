// SPDX-License-Identifier: Apache-2.0
// Updates of acceleration structures with micromaps: VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR with each of the
// extension's flags, in place and into another structure, and of copies.
#include "check/oracle/outcome.h"
#include "gpu/copies.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "structures/constants.h"

namespace
{

const vt::Labels kStructureUpdateLabels{{"Updates.*", "forcing"}};

using namespace vt;

constexpr VkBuildAccelerationStructureFlagsKHR kMicromapUpdate =
    kUpdatable | VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT;
constexpr VkBuildAccelerationStructureFlagsKHR kDisable =
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT;

class Updates : public GpuTest
{
protected:
    Updates() : GpuTest({.shared = true}) {}

    // VK_KHR_opacity_micromap has no flag for updates of the data alone.
    VkBuildAccelerationStructureFlagsKHR dataUpdate()
    {
        return gpu().khr() ? kMicromapUpdate
                           : kUpdatable | VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT;
    }

    std::vector<std::string> fresh(const std::vector<Geometry> &geometries)
    {
        return seenOf(gpu(), Blas(gpu(), geometries));
    }

    // Updates `to` from what `from` holds.
    void update(const Structure &from, Blas &to, const std::vector<Geometry> &geometries,
                VkBuildAccelerationStructureFlagsKHR flags)
    {
        to.prepare(geometries, flags, kUpdate);
        VkAccelerationStructureBuildGeometryInfoKHR info = to.buildInfo();
        info.srcAccelerationStructure = from.handle();
        const VkAccelerationStructureBuildRangeInfoKHR *ranges = to.ranges();
        gpu().submit([&](VkCommandBuffer commands) {
            gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
        });
    }

    // Validation 1.3.239 does not know how a structure was built that was deserialized. So it is without the layer.
    void forgiveUnknownBuilds()
    {
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            if (m.fromVellum() ||
                (m.id.find("pInfos-03667") == std::string::npos && m.id.find("pInfos-03758") == std::string::npos &&
                 m.id.find("pInfos-03759") == std::string::npos && m.id.find("pInfos-03760") == std::string::npos))
                ADD_FAILURE() << m.id << ": " << m.text;
        }
    }

    static std::vector<Geometry> moved(std::vector<Geometry> geometries)
    {
        // Moves each row to the position of another one.
        for (size_t g = 0; g < geometries.size(); ++g) {
            for (Vec3 &vertex : geometries[g].vertices)
                vertex[1] += g % 2 == 0 ? 2.0f : -2.0f;
        }
        return geometries;
    }
};

TEST_F(Updates, VerticesWithTheOriginalMicromaps)
{
    const Patchwork patchwork(gpu());
    Blas blas(gpu(), patchwork.geometries(), kUpdatable);
    const auto still = seenOf(gpu(), blas);
    blas.build(moved(patchwork.geometries()), kUpdatable, kUpdate);
    const auto expected = fresh(moved(patchwork.geometries()));
    EXPECT_EQ(seenOf(gpu(), blas), expected);
    EXPECT_NE(still, expected);
    blas.build(patchwork.geometries(), kUpdatable, kUpdate);
    EXPECT_EQ(seenOf(gpu(), blas), still);
}

TEST_F(Updates, OtherMicromaps)
{
    const Patchwork patchwork(gpu()), other(gpu(), 2);
    Blas blas(gpu(), patchwork.geometries(), kMicromapUpdate);
    blas.build(other.geometries(), kMicromapUpdate, kUpdate);
    EXPECT_EQ(seenOf(gpu(), blas), fresh(other.geometries()));
    EXPECT_NE(seenOf(gpu(), blas), fresh(patchwork.geometries()));
    // Other indices, another micromap of another size, and a base triangle.
    auto changed = patchwork.geometries();
    changed[0].micromap = Attachment{&other.micromap(1), VK_INDEX_TYPE_UINT32, {-1, 2, 3, -4, 5, 0}, {}, 4};
    changed[2].micromap = Attachment{&other.micromap(0)};
    blas.build(changed, kMicromapUpdate, kUpdate);
    EXPECT_EQ(seenOf(gpu(), blas), fresh(changed));
}

// Every geometry with micromaps gets special indices only, then its own ones again.
TEST_F(Updates, SpecialIndicesAndBack)
{
    const Patchwork patchwork(gpu());
    auto special = patchwork.geometries();
    for (Geometry &geometry : special) {
        if (geometry.micromap)
            geometry.micromap = Attachment{nullptr, VK_INDEX_TYPE_UINT16, {-1, -2, -3, -4, -2, -1}};
    }
    Blas blas(gpu(), patchwork.geometries(), kMicromapUpdate);
    blas.build(special, kMicromapUpdate, kUpdate);
    EXPECT_EQ(seenOf(gpu(), blas), fresh(special));
    blas.build(patchwork.geometries(), kMicromapUpdate, kUpdate);
    EXPECT_EQ(seenOf(gpu(), blas), fresh(patchwork.geometries()));
}

// The micromap is built again with other states; levels and formats stay.
TEST_F(Updates, DataOfTheMicromap)
{
    for (const uint32_t level : {1u, 2u, 3u, 6u}) {
        const auto input = [&](uint32_t seed) {
            MicromapInput out;
            for (uint32_t t = 0; t < 6; ++t) {
                std::vector<uint8_t> states(size_t{1} << (2 * level));
                for (size_t i = 0; i < states.size(); ++i)
                    states[i] = static_cast<uint8_t>((i / 3 + t * seed + seed) % 4);
                out.add(level, kFourState, states);
            }
            return out;
        };
        Micromap micromap(gpu(), input(1)), second(gpu(), input(2));
        micromap.build();
        second.build();
        Geometry geometry{.vertices = triangleRow(6)}, with = geometry;
        geometry.micromap = Attachment{&micromap};
        with.micromap = Attachment{&second};
        Blas blas(gpu(), {geometry}, dataUpdate());
        const auto before = fresh({geometry}), expected = fresh({with});
        EXPECT_EQ(seenOf(gpu(), blas), before);
        EXPECT_NE(before, expected);
        // Into the same object: the other's input, this one's destination.
        gpu().submit([&](VkCommandBuffer commands) {
            recordMicromapBuilds(gpu(), commands, std::array{MicromapBuild{second.buildInfo(), micromap.handle()}});
            barrier(commands);
        });
        blas.build({geometry}, dataUpdate(), kUpdate);
        EXPECT_EQ(seenOf(gpu(), blas), expected) << "level " << level;
    }
}

TEST_F(Updates, IntoAnotherStructure)
{
    const Patchwork patchwork(gpu()), other(gpu(), 2);
    const Blas source(gpu(), patchwork.geometries(), kMicromapUpdate);
    const auto still = seenOf(gpu(), source);
    Blas target(gpu());
    target.create(source.size());
    update(source, target, moved(other.geometries()), kMicromapUpdate);
    EXPECT_EQ(seenOf(gpu(), target), fresh(moved(other.geometries())));
    EXPECT_EQ(seenOf(gpu(), source), still);
    // Then updated in place.
    target.build(patchwork.geometries(), kMicromapUpdate, kUpdate);
    EXPECT_EQ(seenOf(gpu(), target), still);
}

TEST_F(Updates, Clone)
{
    const Patchwork patchwork(gpu()), other(gpu(), 2);
    const Blas source(gpu(), patchwork.geometries(), kMicromapUpdate);
    Blas clone(gpu());
    clone.create(source.size());
    copy(gpu(), source, clone);
    clone.build(other.geometries(), kMicromapUpdate, kUpdate);
    EXPECT_EQ(seenOf(gpu(), clone), fresh(other.geometries()));
    EXPECT_EQ(seenOf(gpu(), source), fresh(patchwork.geometries()));
}

// "or the deserialized micromap ... if the original acceleration structure was deserialized prior"
TEST_F(Updates, DeserializedStructure)
{
    const Patchwork patchwork(gpu()), other(gpu(), 2);
    Serialized data;
    {
        const Blas source(gpu(), patchwork.geometries(), kMicromapUpdate);
        data = serialize(gpu(), source);
    }
    Blas sizes(gpu());
    sizes.prepare(patchwork.geometries(), kMicromapUpdate);
    Blas loaded(gpu());
    loaded.create(std::max<VkDeviceSize>(sizes.size(), data.deserializedSize()));
    deserialize(gpu(), data, loaded);
    EXPECT_EQ(seenOf(gpu(), loaded), fresh(patchwork.geometries()));
    loaded.build(moved(patchwork.geometries()), kMicromapUpdate, kUpdate);
    EXPECT_EQ(seenOf(gpu(), loaded), fresh(moved(patchwork.geometries())));
    loaded.build(other.geometries(), kMicromapUpdate, kUpdate);
    EXPECT_EQ(seenOf(gpu(), loaded), fresh(other.geometries()));
    EXPECT_EQ(seenOf(gpu(), *deserialized(gpu(), serialize(gpu(), loaded), kBottom)), fresh(other.geometries()));
    forgiveUnknownBuilds();
}

TEST_F(Updates, DisabledMicromaps)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries(), kDisable);
    auto without = patchwork.geometries();
    for (Geometry &geometry : without)
        geometry.micromap.reset();
    EXPECT_EQ(seenOf(gpu(), blas, kFlagDisable), fresh(without));
    EXPECT_EQ(seenOf(gpu(), blas, 0), fresh(patchwork.geometries()));
    const auto clone = std::make_unique<Structure>(gpu(), kBottom);
    clone->create(blas.size());
    copy(gpu(), blas, *clone);
    EXPECT_EQ(seenOf(gpu(), *clone, kFlagDisable), fresh(without));
    EXPECT_EQ(seenOf(gpu(), *deserialized(gpu(), serialize(gpu(), blas), kBottom), kFlagDisable), fresh(without));
}

// One recording of an update, executed repeatedly while its micromap changes.
TEST_F(Updates, RecordedOnce)
{
    const Patchwork first(gpu()), second(gpu(), 2);
    Blas blas(gpu(), first.geometries(), dataUpdate());
    blas.prepare(first.geometries(), dataUpdate(), kUpdate);
    VkCommandBuffer commands = gpu().begin(0);
    blas.record(commands);
    gpu().end(commands);
    for (int round = 0; round < 4; ++round) {
        const Patchwork &now = round % 2 == 0 ? second : first;
        for (size_t m = 0; m < 2; ++m) {
            const MicromapBuild build{now.micromap(m).buildInfo(), first.micromap(m).handle()};
            gpu().submit([&](VkCommandBuffer c) { recordMicromapBuilds(gpu(), c, std::span(&build, 1)); });
        }
        gpu().execute(commands);
        const Patchwork built(gpu(), round % 2 == 0 ? 2 : 1);
        EXPECT_EQ(seenOf(gpu(), blas), fresh(built.geometries())) << "round " << round;
    }
}

} // namespace
