// SPDX-License-Identifier: Apache-2.0
// Features of VK_KHR_opacity_micromap only: micromaps as acceleration structures, together with the driver's structures
// in builds, copies, queries and memory.
#include "harness/mock_driver.h"
#include "harness/program/labels.h"
#include "micromaps/micromap_structures.h"

namespace
{

const vt::Labels kMicromapStructureLabels{{"MicromapStructure.*", "one_api stacked forced"},
                                          {"MicromapStructure.CompatibilityOfEveryKindOfData", "serialized"},
                                          {"MicromapStructureBoth.*", "one_api stacked"},
                                          {"MicromapStructureBoth.SerializedStructuresOfBothExtensions", "serialized"},
                                          {"MicromapStructureDevices.*", "one_api stacked"},
                                          {"MicromapStructureDisabled.*", "one_api stacked strict_ext"},
                                          {"MicromapStructureMaintenance.*", "one_api stacked strict_ext"},
                                          {"MicromapStructureMaintenance.QueriesOfEveryKind", "inside"}};

using namespace vt;

// One command builds micromaps, a bottom-level and a top-level structure, which are independent of each other.
TEST_F(MicromapStructure, BuiltTogetherWithOtherStructures)
{
    Micromap before(gpu(), eightStates());
    before.build();
    Micromap first(gpu(), eightStates(true)), second(gpu(), eightStates(), kAllow);
    const Blas old(gpu(), {mapped(&before)});
    Blas blas(gpu());
    blas.prepare({mapped(&before)});
    Tlas tlas(gpu());
    tlas.prepare(std::array{instance(old, {}, 1)});
    const StructureBuild one(first.buildInfo(), first.handle().khr), two(second.buildInfo(), second.handle().khr);
    const std::array infos{one.info, blas.buildInfo(), two.info, tlas.buildInfo()};
    const std::array<const RangeInfo *, 4> ranges{nullptr, blas.ranges(), nullptr, tlas.ranges()};
    gpu().submit([&](VkCommandBuffer commands) {
        gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 4, infos.data(), ranges.data());
    });
    EXPECT_EQ(traced(tlas), kForwards);
    EXPECT_EQ(tracedBottom(blas.address()), kForwards);
    EXPECT_EQ(tracedMicromap(first), kBackwards);
    EXPECT_EQ(tracedMicromap(second), kForwards);
}

TEST_F(MicromapStructure, UsageCountsAndGeometriesBehindPointers)
{
    MicromapInput input = eightStates();
    input.add(2, kTwoState, std::vector<uint8_t>(16, 1));
    Micromap micromap(gpu(), input);
    micromap.build();
    const std::vector<uint8_t> expected(micromap.memory(), micromap.memory() + 64 + 10 * 8);
    const StructureBuild plain(micromap.buildInfo(), micromap.handle().khr);
    const auto sizes = sizesOf(plain.info);
    EXPECT_EQ(sizes.accelerationStructureSize, micromap.size());
    EXPECT_EQ(sizes.updateScratchSize, 0u);
    for (const bool usages : {false, true}) {
        for (const bool geometries : {false, true}) {
            SCOPED_TRACE(testing::Message() << usages << geometries);
            const Micromap target(gpu(), micromap, micromap.size());
            StructureBuild build(micromap.buildInfo(), target.handle().khr);
            const VkAccelerationStructureGeometryKHR *geometry = &build.geometry;
            if (usages) {
                build.data.ppUsageCounts = build.usagePointers.data();
                build.data.pUsageCounts = nullptr;
            }
            if (geometries) {
                build.info.ppGeometries = &geometry;
                build.info.pGeometries = nullptr;
            }
            EXPECT_EQ(sizesOf(build.info).accelerationStructureSize, sizes.accelerationStructureSize);
            EXPECT_EQ(sizesOf(build.info).buildScratchSize, sizes.buildScratchSize);
            this->build(build.info);
            EXPECT_EQ(std::vector<uint8_t>(target.memory(), target.memory() + expected.size()), expected);
        }
    }
}

TEST_F(MicromapStructure, IndicesOfEightBits)
{
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    for (const uint32_t stride : {1u, 3u, 4u}) {
        Geometry geometry{.vertices = triangleRow(8)};
        geometry.micromap = Attachment{&micromap, VK_INDEX_TYPE_UINT8_EXT, {3, -1, 1, -2, 0, -3, 5, -4}, stride};
        EXPECT_EQ(tracedBottom(Blas(gpu(), {geometry}).address()), (std::vector{2, 0, 1, 1, 0, 2, 1, 2}))
            << "stride " << stride;
    }
}

// Every type on ranges of one buffer, by its own name and as GENERIC.
TEST_F(MicromapStructure, EveryTypeOnAddressRanges)
{
    const Micromap input(gpu(), eightStates());
    const Buffer memory(gpu(), 1 << 18, kStorage);
    ASSERT_EQ(memory.address() % 256, 0u);
    for (const bool generic : {false, true}) {
        SCOPED_TRACE(generic ? "GENERIC" : "by name");
        const Placed micromap(gpu(), generic ? kGeneric : kMicromapType, memory.address() + 512, input.size());
        buildInto(input, micromap.handle());
        EXPECT_EQ(std::memcmp(memory.bytes(), std::vector<uint8_t>(512).data(), 512), 0);
        EXPECT_EQ(tracedMicromap(micromap.handle()), kForwards);

        Micromap built(gpu(), eightStates(true));
        built.build();
        Blas blas(gpu());
        blas.prepare({mapped(&built)});
        const Placed bottom(gpu(), generic ? kGeneric : kBottom, memory.address() + (1 << 16), blas.size());
        BuildInfo info = blas.buildInfo();
        info.dstAccelerationStructure = bottom.handle();
        build(info, blas.ranges());
        EXPECT_EQ(tracedBottom(bottom.address()), kBackwards);

        VkAccelerationStructureInstanceKHR one = instance(blas, {}, 1);
        one.accelerationStructureReference = bottom.address();
        Tlas tlas(gpu());
        tlas.prepare(std::array{one});
        const Placed top(gpu(), generic ? kGeneric : kTop, memory.address() + (1 << 17), tlas.size());
        info = tlas.buildInfo();
        info.dstAccelerationStructure = top.handle();
        build(info, tlas.ranges());
        // Looked at by a copy that the tracer can bind.
        vt::Structure seen(gpu(), kTop);
        seen.create(tlas.size());
        copy(top.handle(), seen.handle());
        EXPECT_EQ(traced(seen), kBackwards);
    }
}

TEST_F(MicromapStructure, GenericTakesTheBuiltType)
{
    const Micromap input(gpu(), eightStates());
    Micromap other(gpu(), eightStates(true));
    other.build();
    Blas blas(gpu());
    blas.prepare({mapped(&other)});
    const Placed generic(gpu(), kGeneric, std::max(blas.size(), input.size()) + 4096);
    for (int round = 0; round < 2; ++round) {
        buildInto(input, generic.handle());
        EXPECT_EQ(tracedMicromap(generic.handle()), kForwards);
        EXPECT_EQ(query(generic.handle(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR),
                  translatedTests() ? reportedSize(gpu(), 64 + kWhole) : 64 + kWhole);
        BuildInfo info = blas.buildInfo();
        info.dstAccelerationStructure = generic.handle();
        build(info, blas.ranges());
        EXPECT_EQ(tracedBottom(generic.address()), kBackwards);
        // The structure no longer contains a micromap: every state is unknown.
        gpu().breaks("VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11624");
        EXPECT_EQ(tracedMicromap(generic.handle()), kPlain);
        const auto serialized = query(generic.handle(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR);
        EXPECT_GT(serialized, 8u * 12 * 3) << "a bottom-level structure";
    }
}

TEST_F(MicromapStructure, CopiesOfGenericStructures)
{
    const Micromap input(gpu(), eightStates(), kAllow);
    const Placed source(gpu(), kGeneric, input.size());
    buildInto(input, source.handle());
    // The size of a clone, as the first of the queries says; by host and device.
    const Placed clone(gpu(), kGeneric, source.size());
    copy(source.handle(), clone.handle());
    EXPECT_EQ(tracedMicromap(clone.handle()), kForwards);
    const VkDeviceSize compacted = query(source.handle(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR);
    EXPECT_EQ(compacted, reportedSize(gpu(), kCompacted));
    EXPECT_LT(compacted, source.size());
    const Placed compact(gpu(), kGeneric, compacted);
    copy(clone.handle(), compact.handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    EXPECT_EQ(tracedMicromap(compact.handle()), kForwards);
    // Copied to a structure created as a micromap, and back.
    const Placed named(gpu(), kMicromapType, compacted);
    copy(compact.handle(), named.handle());
    EXPECT_EQ(tracedMicromap(named.handle()), kForwards);

    for (const VkAccelerationStructureKHR from : {source.handle(), named.handle()}) {
        const Guarded data(gpu(), query(from, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR), 256,
                           VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        gpu().submit([&](VkCommandBuffer commands) {
            recordMicromapToMemory(gpu(), commands, {VK_NULL_HANDLE, from}, data.address());
        });
        EXPECT_TRUE(data.intact());
        // Emulation writes the sizes after the version, as in data of other structures.
        uint64_t numbers[3];
        std::memcpy(numbers, data.bytes() + 2 * VK_UUID_SIZE, sizeof numbers);
        if (!translatedTests()) {
            EXPECT_EQ(numbers[0], data.size()) << "\"matching the value queried\"";
            EXPECT_EQ(numbers[2], 0u) << "handles of other structures";
        }
        for (const VkAccelerationStructureTypeKHR type : {kGeneric, kMicromapType}) {
            // With the only size that is known of the data.
            const Placed loaded(gpu(), type, translatedTests() ? data.size() : numbers[1]);
            gpu().submit([&](VkCommandBuffer commands) {
                recordMemoryToMicromap(gpu(), commands, data.address(), loaded.micromap());
            });
            EXPECT_EQ(tracedMicromap(loaded.handle()), kForwards) << type;
        }
    }
}

class MicromapStructureMaintenance : public MicromapStructure
{
protected:
    MicromapStructureMaintenance() : MicromapStructure({.api = Api::Khr, .maintenance = true}) {}
};

// Micromaps and the driver's objects in one call and one pool.
TEST_F(MicromapStructureMaintenance, QueriesOfEveryKind)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME))
        GTEST_SKIP() << "no VK_KHR_ray_tracing_maintenance1";
    Micromap first(gpu(), eightStates(), kAllow), second(gpu(), repeated(), kAllow);
    first.build();
    second.build();
    const auto compaction = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    const Blas blas(gpu(), {mapped(&first)}, compaction), plain(gpu(), {mapped(nullptr)}, compaction);
    const std::vector all{first.handle().khr, blas.handle(), plain.handle(), second.handle().khr, plain.handle()};
    const auto alone = [&](VkQueryType type) {
        std::vector<uint64_t> out;
        for (const VkAccelerationStructureKHR structure : all)
            out.push_back(query(structure, type));
        return out;
    };
    for (const VkQueryType type :
         {VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
          VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR}) {
        SCOPED_TRACE(testing::Message() << "type " << type);
        const std::vector<uint64_t> values = queryAll(all, type);
        EXPECT_EQ(values, alone(type));
        if (type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR) {
            EXPECT_EQ(values[0], reportedSize(gpu(), kCompacted));
            EXPECT_EQ(values[3], reportedSize(gpu(), 64 + 2 * 16 + 64));
        } else if (type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR) {
            EXPECT_EQ(values[0], 64 + kWhole);
            EXPECT_EQ(values[3], 64u + 64 + 2 * 16 + 3 * 64);
        } else {
            // The size that a clone needs; the handles may be larger.
            EXPECT_EQ(values[0], reportedSize(gpu(), kWhole));
            EXPECT_EQ(values[3], reportedSize(gpu(), 64 + 2 * 16 + 3 * 64));
        }
    }
    const auto pointers = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR;
    const Tlas tlas(gpu(), {instance(blas, {}, 1), instance(plain, {2, 0, 0}, 2)});
    EXPECT_EQ(query(tlas.handle(), pointers), 2u);
    expectNoMessages();
    const QueryPool pool(gpu(), pointers);
    const VkAccelerationStructureKHR micromap = first.handle().khr;
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &micromap, pointers, pool, 0);
    });
    expectRejected("VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-12425");
    // It has no micromap.
    uint64_t value = 7;
    EXPECT_EQ(vkGetQueryPoolResults(gpu().device(), pool, 0, 1, 8, &value, 8, VK_QUERY_RESULT_64_BIT),
              strictTests() ? VK_NOT_READY : VK_SUCCESS);
    EXPECT_EQ(value, strictTests() ? 7u : 0u);
}

TEST_F(MicromapStructure, CompatibilityOfEveryKindOfData)
{
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    const Blas blas(gpu(), {mapped(&micromap)});
    Serialized bottom = serialize(gpu(), blas);
    EXPECT_TRUE(micromapIsCompatible(gpu(), bottom.bytes().data()));
    const Guarded data(gpu(), 4096, 256, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    gpu().submit(
        [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu(), commands, micromap.handle(), data.address()); });
    EXPECT_TRUE(micromapIsCompatible(gpu(), data.bytes()));
    for (uint8_t *bytes : {bottom.bytes().data(), data.bytes()}) {
        for (const size_t i : {0u, 15u, 16u, 31u}) {
            bytes[i] ^= 4;
            EXPECT_FALSE(micromapIsCompatible(gpu(), bytes)) << i;
            bytes[i] ^= 4;
        }
    }
    EXPECT_FALSE(micromapIsCompatible(gpu(), std::array<uint8_t, 2 * VK_UUID_SIZE>{1, 2, 3}.data()));
}

TEST_F(MicromapStructure, AddressIsThatOfItsMemory)
{
    const Buffer memory(gpu(), 8192, kStorage);
    const Placed micromap(gpu(), kMicromapType, memory.address() + 1024, 2048);
    EXPECT_EQ(micromap.address(), memory.address() + 1024);
}

TEST_F(MicromapStructure, DestroyingNothingIsAllowed)
{
    gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), VK_NULL_HANDLE, nullptr);
}

// The spy looks at every handle that reaches the driver.
TEST_F(MicromapStructure, NamesAndPrivateDataStayInTheLayer)
{
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    const Blas blas(gpu(), {mapped(&micromap)});
    const auto load = [this](const char *name) { return vkGetInstanceProcAddr(gpu().instance(), name); };
    const auto setName = reinterpret_cast<PFN_vkSetDebugUtilsObjectNameEXT>(load("vkSetDebugUtilsObjectNameEXT"));
    const auto setTag = reinterpret_cast<PFN_vkSetDebugUtilsObjectTagEXT>(load("vkSetDebugUtilsObjectTagEXT"));
    auto create = vkInit<VkPrivateDataSlotCreateInfo>();
    VkPrivateDataSlot slot = VK_NULL_HANDLE;
    VT_CHECK(vkCreatePrivateDataSlot(gpu().device(), &create, nullptr, &slot));
    uint64_t value = 40;
    for (const VkAccelerationStructureKHR structure : {micromap.handle().khr, blas.handle()}) {
        const auto object = reinterpret_cast<uint64_t>(structure);
        auto name = vkInit<VkDebugUtilsObjectNameInfoEXT>(
            {.objectType = VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, .objectHandle = object, .pObjectName = "leaves"});
        EXPECT_EQ(setName(gpu().device(), &name), VK_SUCCESS);
        auto tag = vkInit<VkDebugUtilsObjectTagInfoEXT>({.objectType = VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                                                         .objectHandle = object,
                                                         .tagSize = 6,
                                                         .pTag = "leaves"});
        EXPECT_EQ(setTag(gpu().device(), &tag), VK_SUCCESS);
        EXPECT_EQ(vkSetPrivateData(gpu().device(), VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, object, slot, ++value),
                  VK_SUCCESS);
    }
    value = 40;
    for (const VkAccelerationStructureKHR structure : {micromap.handle().khr, blas.handle()}) {
        uint64_t got = 0;
        vkGetPrivateData(gpu().device(), VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                         reinterpret_cast<uint64_t>(structure), slot, &got);
        EXPECT_EQ(got, ++value);
    }
    vkDestroyPrivateDataSlot(gpu().device(), slot, nullptr);
    // The layer's own messages know the name.
    BuildInfo info = StructureBuild(micromap.buildInfo(), micromap.handle().khr).info;
    info.geometryCount = 0;
    build(info);
    const std::vector<Message> messages = gpu().takeUnexpectedMessages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(messages[0].object, "leaves");
}

TEST_F(MicromapStructure, FeaturesPropertiesAndVersions)
{
    auto micromaps = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>();
    auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &micromaps});
    vkGetPhysicalDeviceFeatures2(gpu().physical(), &features);
    EXPECT_EQ(micromaps.micromap, VK_TRUE);
    auto limits = vkInit<VkPhysicalDeviceOpacityMicromapPropertiesKHR>();
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &limits});
    vkGetPhysicalDeviceProperties2(gpu().physical(), &properties);
    EXPECT_EQ(limits.maxOpacity2StateSubdivisionLevel, 12u);
    EXPECT_EQ(limits.maxOpacity4StateSubdivisionLevel, 12u);
    EXPECT_EQ(limits.maxOpacityLossy4StateSubdivisionLevel, 12u);
    EXPECT_GE(limits.maxMicromapTriangles, uint64_t{1} << 27);

    uint32_t count = 0;
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu().physical(), nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> list(count);
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu().physical(), nullptr, &count, list.data()));
    for (const char *name : {"VK_KHR_opacity_micromap", "VK_KHR_device_address_commands"}) {
        const auto is = [name](const VkExtensionProperties &p) { return std::strcmp(p.extensionName, name) == 0; };
        ASSERT_EQ(std::count_if(list.begin(), list.end(), is), 1) << name;
        EXPECT_EQ(std::find_if(list.begin(), list.end(), is)->specVersion, 1u) << name;
    }
    EXPECT_NE(gpu().vk().CreateAccelerationStructure2KHR, nullptr);
    EXPECT_EQ(gpu().vk().CreateMicromapEXT, nullptr) << "of an extension that is not enabled";
}

class MicromapStructureDisabled : public MicromapStructure
{
protected:
    MicromapStructureDisabled() : MicromapStructure({.api = Api::Khr, .micromapFeature = false}) {}
};

TEST_F(MicromapStructureDisabled, ReportsMicromaps)
{
    constexpr const char *kSizes = "VUID-VkAccelerationStructureBuildGeometryInfoKHR-micromap-11559";
    const Buffer memory(gpu(), 4096, kStorage);
    const MicromapInput input = eightStates();
    if (!strictTests()) {
        // It works nevertheless.
        Micromap micromap(gpu(), input);
        micromap.build();
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        ASSERT_EQ(messages.size(), 3u) << "sizes, creation, build";
        EXPECT_EQ(messages[0].id, std::string("VELLUM-") + kSizes);
        EXPECT_EQ(messages[1].id, "VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-micromap-11609");
        EXPECT_EQ(messages[2].id, std::string("VELLUM-") + kSizes);
        EXPECT_EQ(tracedMicromap(micromap), kForwards);
        return;
    }
    expectCreationRejected(kMicromapType, {memory.address(), 1024},
                           "VUID-VkAccelerationStructureCreateInfo2KHR-micromap-11609");
    const std::vector<VkMicromapUsageEXT> usage = input.usage();
    VkMicromapBuildInfoEXT info{};
    info.usageCountsCount = static_cast<uint32_t>(usage.size());
    info.pUsageCounts = usage.data();
    EXPECT_EQ(micromapSizes(gpu(), info).micromapSize, 0u);
    expectRejected(kSizes);
    const Placed generic(gpu(), kGeneric, memory.address(), 4096);
    build(StructureBuild(info, generic.handle()).info);
    expectRejected(kSizes);
    // Everything else works.
    const Blas blas(gpu(), {mapped(nullptr)});
    EXPECT_EQ(tracedBottom(blas.address()), kPlain);
}

class MicromapStructureBoth : public MicromapStructure
{
protected:
    MicromapStructureBoth() : MicromapStructure({.api = Api::Khr, .bothApis = true}) {}
};

// Geometries of one structure, and instances of one scene, with micromaps of either extension.
TEST_F(MicromapStructureBoth, MicromapsOfBothExtensionsInOneScene)
{
    Micromap khr(gpu(), eightStates());
    khr.build();
    gpu().use(Api::Ext);
    Micromap ext(gpu(), eightStates(true));
    ext.build();
    gpu().use(Api::Khr);
    Geometry first = mapped(&khr), second = mapped(&ext);
    for (Vec3 &vertex : second.vertices)
        vertex[1] += 2;
    const Blas both(gpu(), {first, second});
    const Blas one(gpu(), {mapped(&ext)});
    const Tlas tlas(gpu(), {instance(both, {0, 2, 0}, 1), instance(one, {}, 2)});
    EXPECT_EQ(traced(tlas), kBackwards);
    const Tlas lower(gpu(), {instance(both, {}, 1)}), upper(gpu(), {instance(both, {0, -2, 0}, 1)});
    EXPECT_EQ(traced(lower), kForwards);
    EXPECT_EQ(traced(upper), kBackwards);
}

// Serialized, one kind of micromap is named and the other's data comes along: in any order, and shared.
TEST_F(MicromapStructureBoth, SerializedStructuresOfBothExtensions)
{
    Micromap khr(gpu(), eightStates());
    khr.build();
    gpu().use(Api::Ext);
    auto ext = std::make_unique<Micromap>(gpu(), eightStates(true));
    ext->build();
    gpu().use(Api::Khr);
    const std::vector<std::vector<const Micromap *>> arrangements{{&khr, ext.get(), &khr, ext.get(), nullptr},
                                                                  {nullptr, &khr, ext.get(), nullptr, &khr},
                                                                  {&khr, &khr, nullptr, ext.get(), ext.get()},
                                                                  {ext.get(), &khr, ext.get(), &khr, &khr}};
    std::vector<Serialized> serialized;
    std::vector<std::vector<std::vector<int>>> expected;
    const auto rows = [&](const Structure &blas) {
        std::vector<std::vector<int>> out;
        for (int g = 0; g < 5; ++g)
            out.push_back(traced(Tlas(gpu(), {instance(blas, {0, -2.0f * static_cast<float>(g), 0}, 1)})));
        return out;
    };
    for (const auto &arrangement : arrangements) {
        std::vector<Geometry> geometries;
        for (const Micromap *micromap : arrangement) {
            Geometry &geometry = geometries.emplace_back(mapped(micromap));
            for (Vec3 &vertex : geometry.vertices)
                vertex[1] += 2 * static_cast<float>(geometries.size() - 1);
        }
        const Blas blas(gpu(), geometries);
        expected.push_back(rows(blas));
        for (size_t g = 0; g < 5; ++g)
            EXPECT_EQ(expected.back()[g], arrangement[g] == &khr      ? kForwards
                                          : arrangement[g] != nullptr ? kBackwards
                                                                      : kPlain);
        serialized.push_back(serialize(gpu(), blas));
        EXPECT_EQ(queried(gpu(), blas, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR),
                  serialized.back().total());
    }
    gpu().use(Api::Ext);
    ext.reset();
    gpu().use(Api::Khr);
    for (size_t i = 0; i < arrangements.size(); ++i) {
        SCOPED_TRACE(i);
        const auto back = deserialized(gpu(), serialized[i], kBottom);
        EXPECT_EQ(rows(*back), expected[i]);
        // Serialized again.
        const Serialized again = serialize(gpu(), *back);
        EXPECT_EQ(again.total(), serialized[i].total());
        EXPECT_EQ(rows(*deserialized(gpu(), again, kBottom)), expected[i]);
    }
}

// Two devices at the same time, each with one of the extensions.
TEST(MicromapStructureDevices, OneWithEachExtension)
{
    for (const Api api : {Api::Ext, Api::Khr}) {
        Gpu first({.api = api}), second({.api = api == Api::Ext ? Api::Khr : Api::Ext});
        for (Gpu *gpu : {&first, &second}) {
            const Patchwork patchwork(*gpu);
            EXPECT_EQ(seenOf(*gpu, Blas(*gpu, patchwork.geometries())).size(), Patchwork::rays().size());
        }
        const Patchwork one(first), two(second);
        EXPECT_EQ(seenOf(first, Blas(first, one.geometries())), seenOf(second, Blas(second, two.geometries())));
    }
}

} // namespace
