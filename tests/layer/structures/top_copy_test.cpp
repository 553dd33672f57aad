// SPDX-License-Identifier: Apache-2.0
// Copies of TLAS with micromaps: shaders see a copy as they saw the original, in whatever order copies were recorded,
// and whatever becomes of the original.
#include "harness/program/labels.h"
#include "structures/constants.h"
#include "structures/copy_test.h"

#include <map>

namespace
{

const vt::Labels kTopCopyLabels{{"TopCopies.*", "quirks stacked forced forcing"}, {"TopCopiesExt.*", "one_api"}};

using namespace vt;

class TopCopies : public Copies
{
protected:
    explicit TopCopies(const Options &options = {}) : Copies(options) {}
    void SetUp() override
    {
        for (uint32_t seed = 1; seed <= 2; ++seed) {
            patchworks_.push_back(std::make_unique<Patchwork>(gpu(), seed));
            blas_.push_back(std::make_unique<Blas>(gpu(), patchworks_.back()->geometries()));
        }
        blas_.push_back(std::make_unique<Blas>(gpu(), plain()));
    }
    static constexpr float kApart = 20;

    // Different custom indices, masks, flags and structures.
    std::vector<VkAccelerationStructureInstanceKHR> instances(uint32_t count, uint32_t seed)
    {
        constexpr std::array<uint32_t, 6> flags{0, 0x10, 0x20, 4, 8, 0x14};
        std::vector<VkAccelerationStructureInstanceKHR> out;
        for (uint32_t i = 0; i < count; ++i) {
            auto one = instance(*blas_[(i + seed) % 3], {kApart * static_cast<float>(i), 0, 0},
                                (i * 7919 + seed * 104729) & 0xffffff, flags[(i + seed) % flags.size()],
                                i % 4 == 3 ? 0x0fu : 0xf0u);
            one.instanceShaderBindingTableRecordOffset = (i * 3 + seed) & 0xffffffu;
            out.push_back(one);
        }
        return out;
    }
    std::vector<std::string> look(const Structure &scene, uint32_t count) { return look(gpu(), scene, count); }
    static std::vector<std::string> look(Gpu &gpu, const Structure &scene, uint32_t count)
    {
        std::vector<Ray> rays;
        for (uint32_t i = 0; i < count; ++i) {
            for (const Ray &ray : Patchwork::rays({kApart * static_cast<float>(i), 0, 0})) {
                rays.push_back(ray);
                rays.back().cullMask = rays.size() % 5 == 0 ? 0x0f : 0xff;
            }
        }
        return seen(gpu, scene, rays);
    }

    std::vector<std::unique_ptr<Patchwork>> patchworks_;
    std::vector<std::unique_ptr<Blas>> blas_;
};

TEST_F(TopCopies, StayWhenTheSourceIsBuiltAgainOrDestroyed)
{
    for (const auto mode : {kClone, kCompact}) {
        SCOPED_TRACE(mode);
        auto source = std::make_unique<Tlas>(gpu());
        source->build(instances(8, 1), kCompactable | kUpdatable);
        const auto expected = look(*source, 8);
        const auto target = made(kTop, source->size());
        copy(gpu(), *source, *target, mode);
        EXPECT_EQ(look(*target, 8), expected);
        source->build(instances(8, 2), kCompactable | kUpdatable);
        EXPECT_EQ(look(*target, 8), expected) << "the source was built again";
        EXPECT_NE(look(*source, 8), expected);
        source->build(instances(8, 3), kCompactable | kUpdatable, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
        EXPECT_EQ(look(*target, 8), expected) << "the source was updated";
        source.reset();
        EXPECT_EQ(look(*target, 8), expected) << "the source was destroyed";
        const Tlas inItsPlace(gpu(), instances(8, 4));
        EXPECT_EQ(look(*target, 8), expected) << "its slots went to another";
        const auto second = made(kTop, target->size());
        copy(gpu(), *target, *second);
        EXPECT_EQ(look(*second, 8), expected) << "copy of a copy";
    }
}

TEST_F(TopCopies, SourceStaysWhenTheCopyIsBuiltAgain)
{
    const Tlas source(gpu(), instances(8, 1));
    const auto expected = look(source, 8);
    Tlas target(gpu());
    target.create(source.size());
    copy(gpu(), source, target);
    target.build(instances(8, 2));
    EXPECT_EQ(look(source, 8), expected);
    EXPECT_NE(look(target, 8), expected);
}

TEST_F(TopCopies, FewerInstancesThanTheCapacity)
{
    Tlas source(gpu(), instances(40, 1));
    const auto target = made(kTop, source.size());
    for (const uint32_t count : {3u, 0u, 17u, 40u, 1u}) {
        source.build(instances(count, count));
        copy(gpu(), source, *target);
        EXPECT_EQ(look(*target, count + 1), look(source, count + 1)) << count;
    }
}

// A structure that is built again and again, each time of another size: the spy below the layer counts its handles.
TEST_F(TopCopies, ManySizesOfOneStructure)
{
    constexpr uint32_t kMost = 3000;
    const auto all = instances(kMost, 1);
    Tlas source(gpu());
    source.build(all);
    // A build takes lavapipe 26 some 10 ms.
    for (uint32_t count = 1; count < kMost; count += gpu().onLavapipe26() ? 20u : 1u)
        source.build(std::span(all).first(count));
    EXPECT_EQ(look(source, 4), look(Tlas(gpu(), instances(kMost, 1)), 4));
}

TEST_F(TopCopies, RecordedBeforeTheBuild)
{
    Tlas source(gpu());
    source.prepare(instances(8, 1));
    const auto target = made(kTop, source.size());
    VkCommandBuffer late = gpu().begin(0);
    recordCopy(gpu(), late, source.handle(), target->handle());
    gpu().end(late);
    gpu().submit([&](VkCommandBuffer commands) { source.record(commands); });
    gpu().execute(late);
    EXPECT_EQ(look(*target, 8), look(source, 8));
    source.build(instances(5, 2));
    const auto before = look(*target, 8);
    gpu().execute(late);
    EXPECT_NE(look(*target, 8), before);
    EXPECT_EQ(look(*target, 8), look(source, 8)) << "the same recording, executed again";
}

TEST_F(TopCopies, OneRecordedBuildExecutedAgainKeepsCopies)
{
    const auto first = instances(6, 1), second = instances(6, 2);
    constexpr VkBufferUsageFlags usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    const Buffer input = gpu().upload(std::span(first), usage);
    Tlas source(gpu());
    source.prepare(first);
    VkAccelerationStructureBuildGeometryInfoKHR info = source.buildInfo();
    VkAccelerationStructureGeometryKHR geometry = info.pGeometries[0];
    geometry.geometry.instances.data.deviceAddress = input.address();
    info.pGeometries = &geometry;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = source.ranges();
    VkCommandBuffer build = gpu().begin(0);
    gpu().vk().CmdBuildAccelerationStructuresKHR(build, 1, &info, &ranges);
    gpu().end(build);
    gpu().execute(build);
    const auto target = made(kTop, source.size());
    copy(gpu(), source, *target);
    const auto expected = look(source, 6);
    std::memcpy(input.bytes(), second.data(), second.size() * sizeof(second[0]));
    gpu().execute(build);
    EXPECT_EQ(look(*target, 6), expected);
    EXPECT_NE(look(source, 6), expected);
}

TEST_F(TopCopies, ManyInstances)
{
    // More than one page of instance records, all of which are checked.
    std::vector<VkAccelerationStructureInstanceKHR> many;
    std::vector<Ray> rays;
    for (uint32_t i = 0; i < 5003; ++i) {
        many.push_back(instance(*blas_[i % 3], {kApart * static_cast<float>(i), 0, 0}, i * 1861 & 0xffffff));
        Ray ray;
        ray.origin = {kApart * static_cast<float>(i) + 0.25f, 0.25f, 1};
        rays.push_back(ray);
    }
    const Tlas source(gpu(), many);
    const auto target = made(kTop, source.size());
    copy(gpu(), source, *target);
    const auto expected = seen(gpu(), source, rays);
    EXPECT_EQ(seen(gpu(), *target, rays), expected);
    EXPECT_EQ(seen(gpu(), *deserialized(gpu(), serialize(gpu(), *target), kTop), rays), expected);
}

TEST_F(TopCopies, SerializedHandles)
{
    const auto given = instances(7, 1);
    const Tlas source(gpu(), given);
    const Serialized data = serialize(gpu(), source);
    std::multiset<uint64_t> handles, references;
    for (size_t i = 0; i < data.handleCount(); ++i)
        handles.insert(data.handle(i));
    for (const auto &one : given)
        references.insert(one.accelerationStructureReference);
    EXPECT_EQ(handles, references);
    EXPECT_EQ(data.deserializedSize() % 256, 128u);
    const auto expected = look(source, 7);
    const auto loaded = deserialized(gpu(), data, kTop);
    EXPECT_EQ(look(*loaded, 7), expected);
    const auto generic = deserialized(gpu(), data, kGeneric);
    EXPECT_EQ(look(*generic, 7), expected);
}

// A structure as large as the source is large enough (VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746), as is one
// of the source's compacted size.
TEST_F(TopCopies, DeserializedIntoTheSizeOfTheSource)
{
    for (uint32_t count = 1; count < 7; ++count) {
        Tlas source(gpu());
        source.build(instances(count, 1), kCompactable);
        const auto compacted =
            made(kTop, queried(gpu(), source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR));
        copy(gpu(), source, *compacted, kCompact);
        for (const Structure *of :
             {static_cast<const Structure *>(&source), static_cast<const Structure *>(compacted.get())}) {
            const Serialized data = serialize(gpu(), *of);
            EXPECT_LE(data.deserializedSize(), of->size()) << count;
            const auto target = made(kTop, of->size());
            deserialize(gpu(), data, *target);
            EXPECT_EQ(look(*target, count), look(source, count)) << count;
        }
    }
}

// Two structures from the same data, each with other bottom-level structures.
TEST_F(TopCopies, SerializedTwiceWithOtherHandles)
{
    auto source = std::make_unique<Tlas>(gpu(), instances(6, 1));
    const auto original = look(*source, 6);
    Serialized data = serialize(gpu(), *source);
    source.reset();
    const auto same = deserialized(gpu(), data, kTop);
    data.relocate([this](uint64_t handle) {
        return handle == blas_[0]->address()   ? blas_[1]->address()
               : handle == blas_[1]->address() ? blas_[0]->address()
                                               : handle;
    });
    const auto exchanged = deserialized(gpu(), data, kTop);
    EXPECT_EQ(look(*same, 6), original);
    std::swap(blas_[0], blas_[1]);
    const Tlas expected(gpu(), instances(6, 1));
    EXPECT_EQ(look(*exchanged, 6), look(expected, 6));
    EXPECT_NE(look(*exchanged, 6), original);
}

class TopCopiesExt : public TopCopies
{
protected:
    TopCopiesExt() : TopCopies({.api = Api::Ext}) {}
};

TEST_F(TopCopiesExt, SerializedToAnotherDevice)
{
    const Tlas source(gpu(), instances(6, 1));
    Serialized data = serialize(gpu(), source);
    Gpu other({.api = Api::Ext});
    // Other slots are in use on this device.
    const Blas filler(other, plain());
    const Tlas occupied(other, std::vector(100, instance(filler, {}, 1)));
    std::vector<std::unique_ptr<Structure>> loaded;
    std::map<uint64_t, uint64_t> places;
    for (const auto &blas : blas_) {
        loaded.push_back(deserialized(other, serialize(gpu(), *blas), kBottom));
        places[blas->address()] = loaded.back()->address();
    }
    data.relocate([&](uint64_t handle) { return places.at(handle); });
    const auto scene = deserialized(other, data, kTop);
    EXPECT_EQ(look(other, *scene, 6), look(gpu(), source, 6));
}

TEST_F(TopCopies, UpdatesOfCopies)
{
    Tlas source(gpu());
    source.build(instances(6, 1), kUpdatable);
    const auto original = look(source, 6);
    // A clone is updated in place, a deserialized one into the clone.
    Tlas clone(gpu());
    clone.create(source.size());
    copy(gpu(), source, clone);
    clone.build(instances(6, 2), kUpdatable, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    Tlas expected(gpu(), instances(6, 2));
    EXPECT_EQ(look(clone, 6), look(expected, 6));
    EXPECT_EQ(look(source, 6), original);
    const auto loaded = deserialized(gpu(), serialize(gpu(), source), kTop);
    clone.prepare(instances(6, 3), kUpdatable, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    VkAccelerationStructureBuildGeometryInfoKHR info = clone.buildInfo();
    info.srcAccelerationStructure = loaded->handle();
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = clone.ranges();
    gpu().submit(
        [&](VkCommandBuffer commands) { gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges); });
    expected.build(instances(6, 3));
    EXPECT_EQ(look(clone, 6), look(expected, 6));
    EXPECT_EQ(look(*loaded, 6), original);
}

TEST_F(TopCopies, GenericStructures)
{
    const Tlas source(gpu(), instances(6, 1));
    const auto generic = made(kGeneric, source.size());
    copy(gpu(), source, *generic);
    EXPECT_EQ(look(*generic, 6), look(source, 6));
    const auto second = made(kGeneric, source.size());
    copy(gpu(), *generic, *second);
    EXPECT_EQ(look(*second, 6), look(source, 6));
}

} // namespace
