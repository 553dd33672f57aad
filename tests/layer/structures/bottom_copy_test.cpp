// SPDX-License-Identifier: Apache-2.0
// Copies of BLAS with micromaps: shaders see a copy as they saw the original, in whatever order copies were recorded,
// and whatever becomes of the original.
#include "structures/constants.h"
#include "structures/copy_test.h"

#include <set>

#include "harness/mock_driver.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kBottomCopyLabels{{"BottomCopies.*", "quirks stacked forcing"},
                                   {"BottomCopies.GenericStructures", "serialized"},
                                   {"BottomCopies.ManyGeometriesAndTriangles", "serialized"},
                                   {"BottomCopies.QueriedSizes", "serialized"},
                                   {"BottomCopies.StateOfTheCommandBuffer", "serialized"},
                                   {"BottomCopiesExt.*", "one_api"}};

using namespace vt;

using BottomCopies = Copies;

// With VK_EXT_opacity_micromap serialized data contains the data of the micromaps; with VK_KHR_opacity_micromap it
// names them (structure_blocks_test.cpp).
class BottomCopiesExt : public Copies
{
protected:
    BottomCopiesExt() : Copies({.api = Api::Ext}) {}
};

TEST_F(BottomCopies, PatchworkShowsEverything)
{
    // The scene that the other tests compare must show differences.
    const Patchwork patchwork(gpu()), other(gpu(), 2);
    const auto first = seenOf(gpu(), Blas(gpu(), patchwork.geometries()));
    const std::set<std::string> kinds(first.begin(), first.end());
    EXPECT_GT(kinds.size(), 100u);
    EXPECT_EQ(kinds.count(""), 1u) << "some place is transparent";
    EXPECT_NE(first, seenOf(gpu(), Blas(gpu(), other.geometries())));
    EXPECT_NE(first, seenOf(gpu(), Blas(gpu(), patchwork.geometries()), kFlagDisable));
    EXPECT_NE(first, seenOf(gpu(), Blas(gpu(), patchwork.geometries()), kFlagTwoState));
}

TEST_F(BottomCopies, CloneAndCompact)
{
    const Patchwork patchwork(gpu());
    for (const auto mode : {kClone, kCompact}) {
        SCOPED_TRACE(mode);
        auto source = std::make_unique<Blas>(gpu(), patchwork.geometries(), kCompactable);
        const auto expected = seenOf(gpu(), *source);
        const auto target = made(kBottom, source->size());
        copy(gpu(), *source, *target, mode);
        EXPECT_EQ(seenOf(gpu(), *target), expected);
        EXPECT_EQ(seenOf(gpu(), *source), expected);
        source.reset();
        EXPECT_EQ(seenOf(gpu(), *target), expected);
        const auto third = made(kBottom, target->size());
        copy(gpu(), *target, *third);
        EXPECT_EQ(seenOf(gpu(), *third), expected);
        EXPECT_EQ(seenOf(gpu(), *third, kFlagTwoState), seenOf(gpu(), *target, kFlagTwoState));
    }
}

TEST_F(BottomCopies, IntoALargerStructure)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries(), kCompactable);
    const auto target = made(kBottom, 3 * source.size() + 512);
    copy(gpu(), source, *target);
    EXPECT_EQ(seenOf(gpu(), *target), seenOf(gpu(), source));
    const auto second = made(kBottom, 5 * source.size());
    copy(gpu(), *target, *second, kCompact);
    EXPECT_EQ(seenOf(gpu(), *second), seenOf(gpu(), source));
}

// The order of execution decides.
TEST_F(BottomCopies, RecordedBeforeTheBuild)
{
    const Patchwork patchwork(gpu());
    Blas source(gpu());
    source.prepare(patchwork.geometries());
    const auto target = made(kBottom, source.size());
    VkCommandBuffer late = gpu().begin();
    recordCopy(gpu(), late, source.handle(), target->handle());
    gpu().end(late);
    gpu().submit([&](VkCommandBuffer commands) { source.record(commands); });
    gpu().execute(late);
    EXPECT_EQ(seenOf(gpu(), *target), seenOf(gpu(), source));
}

TEST_F(BottomCopies, OneRecordingFollowsRebuilds)
{
    const Patchwork patchwork(gpu()), other(gpu(), 2);
    Blas source(gpu(), patchwork.geometries());
    const auto target = made(kBottom, source.size());
    VkCommandBuffer again = gpu().begin(0);
    recordCopy(gpu(), again, source.handle(), target->handle());
    gpu().end(again);
    std::set<std::vector<std::string>> different;
    for (int round = 0; round < 6; ++round) {
        source.build(round % 3 == 0 ? patchwork.geometries() : round % 3 == 1 ? other.geometries() : plain());
        gpu().execute(again);
        const auto expected = seenOf(gpu(), source);
        EXPECT_EQ(seenOf(gpu(), *target), expected) << "round " << round;
        different.insert(expected);
    }
    EXPECT_EQ(different.size(), 3u);
}

TEST_F(BottomCopies, BuildAndCopyInOneCommandBuffer)
{
    const Patchwork patchwork(gpu());
    Blas source(gpu());
    source.prepare(patchwork.geometries(), kCompactable);
    const auto first = made(kBottom, source.size()), second = made(kBottom, source.size());
    gpu().submit([&](VkCommandBuffer commands) {
        source.record(commands);
        barrier(commands);
        recordCopy(gpu(), commands, source.handle(), first->handle());
        barrier(commands);
        recordCopy(gpu(), commands, first->handle(), second->handle(), kCompact);
    });
    EXPECT_EQ(seenOf(gpu(), *second), seenOf(gpu(), source));
}

TEST_F(BottomCopiesExt, SerializedHeader)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries());
    const Serialized data = serialize(gpu(), source);
    auto ids = vkInit<VkPhysicalDeviceIDProperties>();
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &ids});
    vkGetPhysicalDeviceProperties2(gpu().physical(), &properties);
    EXPECT_EQ(data.handleCount(), 0u);
    EXPECT_GE(data.deserializedSize(), 256u);
    EXPECT_LE(data.deserializedSize(), 2 * source.size());
    auto version = vkInit<VkAccelerationStructureVersionInfoKHR>({.pVersionData = data.bytes().data()});
    const auto compatibility = [&] {
        VkAccelerationStructureCompatibilityKHR result{};
        gpu().vk().GetDeviceAccelerationStructureCompatibilityKHR(gpu().device(), &version, &result);
        return result;
    };
    EXPECT_EQ(compatibility(), VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR);
    for (size_t byte = 0; byte < 2 * VK_UUID_SIZE; ++byte) {
        std::vector<uint8_t> changed(data.bytes().begin(), data.bytes().begin() + 2 * VK_UUID_SIZE);
        changed[byte] ^= 1;
        version.pVersionData = changed.data();
        EXPECT_EQ(compatibility(), VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR) << "byte " << byte;
    }
}

TEST_F(BottomCopies, DataOfAPlainDriverIsIncompatible)
{
    Gpu without({.vellum = false, .micromaps = false});
    const Blas source(without, plain());
    const Serialized data = serialize(without, source);
    auto version = vkInit<VkAccelerationStructureVersionInfoKHR>({.pVersionData = data.bytes().data()});
    VkAccelerationStructureCompatibilityKHR result{};
    without.vk().GetDeviceAccelerationStructureCompatibilityKHR(without.device(), &version, &result);
    EXPECT_EQ(result, VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR);
    gpu().vk().GetDeviceAccelerationStructureCompatibilityKHR(gpu().device(), &version, &result);
    EXPECT_EQ(result, VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR);
}

// Micromaps need not exist where the data is loaded: nothing could name them to the structure.
TEST_F(BottomCopiesExt, SerializedDataCarriesTheMicromaps)
{
    std::vector<std::string> expected;
    Serialized data;
    {
        Patchwork patchwork(gpu());
        const Blas source(gpu(), patchwork.geometries());
        expected = seenOf(gpu(), source);
        data = serialize(gpu(), source);
    }
    const Buffer memory(gpu(), data.deserializedSize(), gpu().structureUsage());
    auto first = std::make_unique<Structure>(gpu(), kBottom);
    first->placeIn(memory.handle(), 0);
    first->create(data.deserializedSize());
    deserialize(gpu(), data, *first);
    EXPECT_EQ(seenOf(gpu(), *first), expected);
    // Clones of it, and its serialized data.
    const auto second = made(kBottom, first->size());
    copy(gpu(), *first, *second);
    const auto third = made(kBottom, first->size());
    copy(gpu(), *second, *third);
    const Serialized again = serialize(gpu(), *second);
    if (!chosenQuirk("structures")) { // it does not know what deserialized structures hold
        EXPECT_EQ(again.total(), data.total());
        EXPECT_EQ(again.deserializedSize(), data.deserializedSize());
    }
    auto fourth = deserialized(gpu(), again, kBottom);
    first.reset();
    std::memset(memory.bytes(), 0x77, static_cast<size_t>(memory.size()));
    EXPECT_EQ(seenOf(gpu(), *second), expected) << "its data is its own";
    EXPECT_EQ(seenOf(gpu(), *third), expected);
    EXPECT_EQ(seenOf(gpu(), *fourth), expected);
}

// The value of vkCmdWriteAccelerationStructuresPropertiesKHR is exactly the size that is needed.
TEST_F(BottomCopies, QueriedSizes)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries(), kCompactable), none(gpu(), plain(), kCompactable);
    const auto loaded = deserialized(gpu(), serialize(gpu(), source), kBottom);
    const Tlas scene(gpu(), {instance(source, {}, 77), instance(none, {20, 0, 0}, 7)});
    constexpr auto kSerialized = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR;
    for (const Structure *one : std::initializer_list<const Structure *>{&source, &none, loaded.get(), &scene})
        EXPECT_EQ(queried(gpu(), *one, kSerialized), serialize(gpu(), *one).total());
    const VkDeviceSize size = queried(gpu(), source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR);
    EXPECT_LE(size, source.size());
    const auto compacted = made(kBottom, size);
    copy(gpu(), source, *compacted, kCompact);
    EXPECT_EQ(seenOf(gpu(), *compacted), seenOf(gpu(), source));
    EXPECT_LE(queried(gpu(), *compacted, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR), size);
}

// With VK_KHR_ray_tracing_maintenance1 a clone may be as small as the size that a query returns, and that of a driver
// may be less than what the build needed.
class BottomClones : public Copies
{
protected:
    BottomClones() : Copies({.quirks = "structures", .maintenance = true}) {}
};

TEST_F(BottomClones, OfTheQueriedSize)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME))
        GTEST_SKIP() << "no query of sizes";
    const Patchwork patchwork(gpu());
    for (const std::vector<Geometry> &geometries : {patchwork.geometries(), plain()}) {
        Blas source(gpu());
        source.build(geometries, kCompactable);
        const auto compacted =
            made(kBottom, queried(gpu(), source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR));
        copy(gpu(), source, *compacted, kCompact);
        for (const Structure *of :
             {static_cast<const Structure *>(&source), static_cast<const Structure *>(compacted.get())}) {
            const auto clone = made(kBottom, queried(gpu(), *of, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR));
            copy(gpu(), *of, *clone, kClone);
            EXPECT_EQ(seenOf(gpu(), *clone), seenOf(gpu(), source));
        }
    }
}

TEST_F(BottomCopiesExt, SerializedToAnotherDevice)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries());
    const Serialized data = serialize(gpu(), source);
    Gpu other({.api = Api::Ext});
    const auto loaded = deserialized(other, data, kBottom);
    EXPECT_EQ(seenOf(other, *loaded), seenOf(gpu(), source));
    EXPECT_EQ(seenOf(other, *loaded, kFlagDisable), seenOf(gpu(), source, kFlagDisable));
}

// A structure as large as the source is large enough (VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746), as is one
// of the source's compacted size.
TEST_F(BottomCopies, DeserializedIntoTheSizeOfTheSource)
{
    const Patchwork patchwork(gpu());
    if (!gpu().khr())
        GTEST_SKIP() << "serialized structures contain micromaps of VK_EXT_opacity_micromap, which makes them larger";
    std::vector<std::vector<Geometry>> all;
    // Translated micromaps are not serialized, and a driver that emulates micromaps has VK_EXT_opacity_micromap's.
    if (!chosenQuirk("ext") && !chosenQuirk("emulating"))
        all.push_back(patchwork.geometries());
    for (uint32_t triangles = 1; triangles < 9; ++triangles)
        all.push_back({Geometry{.vertices = triangleRow(triangles)}});
    for (const std::vector<Geometry> &geometries : all) {
        Blas source(gpu());
        source.build(geometries, kCompactable);
        const auto compacted =
            made(kBottom, queried(gpu(), source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR));
        copy(gpu(), source, *compacted, kCompact);
        for (const Structure *of :
             {static_cast<const Structure *>(&source), static_cast<const Structure *>(compacted.get())}) {
            const Serialized data = serialize(gpu(), *of);
            EXPECT_LE(data.deserializedSize(), of->size());
            const auto target = made(kBottom, of->size());
            deserialize(gpu(), data, *target);
            EXPECT_EQ(seenOf(gpu(), *target), seenOf(gpu(), source));
        }
    }
}

TEST_F(BottomCopies, SerializedPlainStructures)
{
    const Blas source(gpu(), plain());
    const Serialized data = serialize(gpu(), source);
    // Over a structure with micromaps, which must not be used afterwards.
    const Patchwork patchwork(gpu());
    Blas target(gpu(), patchwork.geometries());
    ASSERT_GE(target.size(), data.deserializedSize());
    deserialize(gpu(), data, target);
    EXPECT_EQ(seenOf(gpu(), target), seenOf(gpu(), source));
    Geometry boxes;
    boxes.boxes = {{0, 0, -1, 1, 1, 1}, {1.5f, 0, -1, 2.5f, 1, 1}};
    const Blas procedural(gpu(), {boxes});
    EXPECT_EQ(seenOf(gpu(), *deserialized(gpu(), serialize(gpu(), procedural), kBottom)), seenOf(gpu(), procedural));
}

TEST_F(BottomCopies, SerializedWithoutPrimitives)
{
    const Patchwork patchwork(gpu());
    Geometry none{.vertices = triangleRow(1)};
    none.skippedTriangles = 1;
    const Blas source(gpu(), {none});
    const auto loaded = deserialized(gpu(), serialize(gpu(), source), kBottom);
    EXPECT_EQ(seenOf(gpu(), *loaded), seenOf(gpu(), source));
}

TEST_F(BottomCopiesExt, SerializedDataHoldsAMicromapOnce)
{
    MicromapInput input;
    input.add(8, kFourState, std::vector<uint8_t>(65536, 3));
    input.add(8, kFourState, [] {
        std::vector<uint8_t> states(65536);
        for (size_t i = 0; i < states.size(); ++i)
            states[i] = static_cast<uint8_t>(i * 7 % 4);
        return states;
    }());
    Micromap micromap(gpu(), std::move(input));
    micromap.build();
    Geometry geometry{.vertices = triangleRow(1)};
    geometry.micromap = Attachment{&micromap, VK_INDEX_TYPE_UINT32, {1}};
    const uint64_t one = serialize(gpu(), Blas(gpu(), {geometry})).total();
    const uint64_t three = serialize(gpu(), Blas(gpu(), {geometry, geometry, geometry})).total();
    EXPECT_GE(one, 16384u);
    EXPECT_LT(three, one + 8192);
}

TEST_F(BottomCopies, ManyGeometriesAndTriangles)
{
    std::vector<std::unique_ptr<Micromap>> micromaps;
    std::vector<Geometry> geometries;
    std::vector<Ray> rays;
    for (uint32_t g = 0; g < 60; ++g) {
        MicromapInput input;
        for (uint32_t t = 0; t < 97; ++t)
            input.add(3, kFourState, std::vector<uint8_t>(64, static_cast<uint8_t>((t + g) * 5 / 3 % 4)));
        micromaps.push_back(std::make_unique<Micromap>(gpu(), std::move(input)));
        micromaps.back()->build();
        Geometry geometry{.vertices = triangleRow(97, {0, 2 * static_cast<float>(g), 0})};
        if (g % 4 != 3)
            geometry.micromap = Attachment{micromaps.back().get()};
        geometries.push_back(geometry);
        for (uint32_t t = 0; t < 97; t += 3) {
            Ray ray;
            ray.origin = {1.5f * static_cast<float>(t) + 0.3f, 2 * static_cast<float>(g) + 0.3f, 1};
            rays.push_back(ray);
        }
    }
    const auto look = [&](const Structure &blas) { return seen(gpu(), Tlas(gpu(), {instance(blas, {}, 5)}), rays); };
    const Blas source(gpu(), geometries);
    const auto expected = look(source);
    const auto clone = made(kBottom, source.size());
    copy(gpu(), source, *clone);
    EXPECT_EQ(look(*clone), expected);
    const Serialized data = serialize(gpu(), *clone);
    if (!gpu().khr()) // the data names them
        micromaps.clear();
    EXPECT_EQ(look(*deserialized(gpu(), data, kBottom)), expected);
}

TEST_F(BottomCopies, GenericStructures)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries());
    const auto expected = seenOf(gpu(), source);
    const auto clone = made(kGeneric, source.size());
    copy(gpu(), source, *clone);
    EXPECT_EQ(seenOf(gpu(), *clone), expected);
    const Serialized data = serialize(gpu(), *clone);
    const auto loaded = deserialized(gpu(), data, kGeneric);
    EXPECT_EQ(seenOf(gpu(), *loaded), expected);
    if (gpu().khr())
        return;
    // A larger structure is valid: without micromaps of VK_KHR_opacity_micromap, the size does not mean a micromap.
    const auto larger = made(kGeneric, data.deserializedSize() + 64);
    deserialize(gpu(), data, *larger);
    EXPECT_EQ(seenOf(gpu(), *larger), expected);
}

// Copies disturb nothing that the application has bound.
TEST_F(BottomCopies, StateOfTheCommandBuffer)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries(), kCompactable);
    const Tlas scene(gpu(), {instance(source, {}, 77)});
    const auto bottom = made(kBottom, source.size()), loaded = made(kBottom, 4 * source.size());
    const auto top = made(kTop, scene.size()), loadedTop = made(kTop, 4 * scene.size());
    const Guarded memory(gpu(), 4 * source.size() + 65536, 256,
                         VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const auto load = [&](VkCommandBuffer commands, VkAccelerationStructureKHR to) {
        auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        info.src.deviceAddress = memory.address();
        info.dst = to;
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        gpu().vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
    };
    Tracer tracer(gpu());
    const auto rays = Patchwork::rays();
    const std::vector<Result> expected = tracer.trace(scene, rays);
    tracer.prepare(scene, rays);
    for (int which = 0; which < 6; ++which) {
        tracer.clearResults();
        gpu().submit([&](VkCommandBuffer commands) {
            tracer.bind(commands);
            switch (which) {
            case 0: recordCopy(gpu(), commands, source.handle(), bottom->handle()); break;
            case 1: recordCopy(gpu(), commands, scene.handle(), top->handle()); break;
            case 2: recordSerialize(gpu(), commands, source, memory.address()); break;
            case 3: load(commands, loaded->handle()); break;
            case 4: recordSerialize(gpu(), commands, scene, memory.address()); break;
            default: load(commands, loadedTop->handle()); break;
            }
            tracer.dispatch(commands);
            barrier(commands);
        });
        const std::vector<Result> results = tracer.results();
        for (size_t i = 0; i < results.size(); ++i) {
            ASSERT_EQ(results[i].committed, expected[i].committed) << "command " << which;
            ASSERT_EQ(results[i].candidateCount, expected[i].candidateCount) << "command " << which;
        }
    }
    EXPECT_EQ(seenOf(gpu(), *bottom), seenOf(gpu(), source));
    EXPECT_EQ(seenOf(gpu(), *loaded), seenOf(gpu(), source));
    EXPECT_EQ(seen(gpu(), *loadedTop, rays), seen(gpu(), scene, rays));
    EXPECT_EQ(seen(gpu(), *top, rays), seen(gpu(), scene, rays));
}

} // namespace
