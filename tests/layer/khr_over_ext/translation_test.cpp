// SPDX-License-Identifier: Apache-2.0
// VK_KHR_opacity_micromap on a driver with VK_EXT_opacity_micromap only (quirk "ext"): the driver's own micromaps are
// used. The quirk reports whatever such a driver does not know. The suites that run as layer_ext.* check that results
// are the same.
#include <cstring>

#ifndef _WIN32
#include <sys/mman.h>
#endif

#include "command_buffer/inherited_state.h"
#include "harness/mock_driver.h"
#include "micromaps/micromap_structures.h"

namespace
{

using namespace vt;

constexpr auto kCompactedSize = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
constexpr auto kSerializedSize = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR;

std::string layerTool(const Gpu &gpu)
{
    uint32_t count = 0;
    vkGetPhysicalDeviceToolProperties(gpu.physical(), &count, nullptr);
    std::vector<VkPhysicalDeviceToolProperties> tools(
        count, {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TOOL_PROPERTIES, nullptr, {}, {}, 0, {}, {}});
    vkGetPhysicalDeviceToolProperties(gpu.physical(), &count, tools.data());
    for (const VkPhysicalDeviceToolProperties &tool : tools) {
        if (std::strcmp(tool.layer, "VK_LAYER_VELLUM_opacity_micromap") == 0)
            return tool.description;
    }
    return "";
}

uint64_t driverBuilds()
{
    return testDriverFunction<uint64_t (*)()>("vellumExtBuilds")();
}

// Those of them whose input is not at multiples of 256 (VUID-vkCmdBuildMicromapsEXT-pInfos-07515).
uint64_t misalignedBuilds()
{
    return testDriverFunction<uint64_t (*)()>("vellumExtMisaligned")();
}

class Translation : public MicromapStructure
{
protected:
    explicit Translation(const Options &options = {.quirks = "ext", .api = Api::Khr}) : MicromapStructure(options) {}
};

class TranslationForced : public Translation
{
protected:
    TranslationForced() : Translation(forced()) {}
    static Options forced()
    {
        setenv("VELLUM_IMPLEMENTATION", "emulated", 1);
        return {.quirks = "ext", .api = Api::Khr, .memory = Memory::Apart};
    }
    void SetUp() override
    {
        Translation::SetUp();
        unsetenv("VELLUM_IMPLEMENTATION");
    }
};

class TranslationBeside : public Translation
{
protected:
    TranslationBeside() : Translation({.quirks = "ext", .api = Api::Khr, .bothApis = true}) {}
};

TEST_F(Translation, MicromapsAreTheDrivers)
{
    EXPECT_EQ(layerTool(gpu()), "translated");
    const uint64_t before = driverBuilds();
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    EXPECT_EQ(driverBuilds(), before + 1);
    EXPECT_EQ(tracedMicromap(micromap), kForwards);
}

TEST_F(TranslationForced, MicromapsAreTheLayers)
{
    EXPECT_EQ(layerTool(gpu()), "emulated");
    const uint64_t before = driverBuilds();
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    EXPECT_EQ(tracedMicromap(micromap), kForwards);
    EXPECT_EQ(driverBuilds(), before);
}

TEST_F(Translation, LimitsAreTheDrivers)
{
    auto ext = vkInit<VkPhysicalDeviceOpacityMicromapPropertiesEXT>();
    auto khr = vkInit<VkPhysicalDeviceOpacityMicromapPropertiesKHR>({.pNext = &ext});
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &khr});
    vkGetPhysicalDeviceProperties2(gpu().physical(), &properties);
    EXPECT_GT(ext.maxOpacity4StateSubdivisionLevel, 0u);
    EXPECT_EQ(khr.maxOpacity2StateSubdivisionLevel, ext.maxOpacity2StateSubdivisionLevel);
    EXPECT_EQ(khr.maxOpacity4StateSubdivisionLevel, ext.maxOpacity4StateSubdivisionLevel);
    EXPECT_EQ(khr.maxOpacityLossy4StateSubdivisionLevel, ext.maxOpacity4StateSubdivisionLevel);
    EXPECT_GE(khr.maxMicromapTriangles, 1u << 24);
}

// VK_KHR_opacity_micromap takes multiples of 128, VK_EXT_opacity_micromap of 256.
TEST_F(Translation, InputAtMultiplesOf128)
{
    MicromapInput input = eightStates();
    for (const VkDeviceSize stride : {8u, 12u}) {
        input.stride = stride;
        const Micromap usual(gpu(), input);
        const auto *const bytes = input.data.data();
        const Buffer data(gpu(), 4096,
                          VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                              VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        for (const auto &[dataAt, trianglesAt] : {std::pair{128u, 2048u}, {0u, 2176u}, {384u, 2176u}}) {
            SCOPED_TRACE(testing::Message() << stride << " " << dataAt << " " << trianglesAt);
            std::memset(data.bytes(), 0xff, 4096);
            std::memcpy(data.bytes() + dataAt, bytes, input.data.size());
            for (size_t i = 0; i < input.triangles.size(); ++i)
                std::memcpy(data.bytes() + trianglesAt + i * stride, &input.triangles[i], sizeof input.triangles[i]);
            const Placed target(gpu(), kMicromapType, usual.size());
            StructureBuild build(usual.buildInfo(), target.handle());
            build.data.data = data.address() + dataAt;
            build.data.triangleArray = data.address() + trianglesAt;
            this->build(build.info);
            EXPECT_EQ(tracedMicromap(target.handle()), kForwards);
        }
    }
}

// A micromap without triangles, whose input is not read.
TEST_F(Translation, NoInputAtMultiplesOf128)
{
    const Micromap usual(gpu(), eightStates());
    const Placed target(gpu(), kMicromapType, usual.size());
    StructureBuild build(usual.buildInfo(), target.handle());
    build.data.usageCountsCount = 0;
    const uint64_t misaligned = misalignedBuilds(), before = driverBuilds();
    for (const auto &[data, triangles] : {std::pair{128u, 0u}, {0u, 128u}, {384u, 128u}}) {
        build.data.data = usual.buildInfo().data.deviceAddress + data;
        build.data.triangleArray = usual.buildInfo().data.deviceAddress + triangles;
        this->build(build.info);
    }
    EXPECT_EQ(driverBuilds(), before + 3);
    EXPECT_EQ(misalignedBuilds(), misaligned);
}

// Handles that reach to the end of the buffer, several for one content, and contents of many sizes in turn.
TEST_F(Translation, GenericStructuresOfAnySize)
{
    const Buffer memory(gpu(), 1 << 18, kStorage);
    const Placed first(gpu(), kGeneric, memory.address() + 4096, (1 << 18) - 4096);
    const Placed again(gpu(), kGeneric, memory.address() + 4096, 1 << 17);
    const Placed second(gpu(), kGeneric, memory.address() + (1 << 16), (1 << 18) - (1 << 16));
    Micromap small(gpu(), eightStates(), kAllow);
    MicromapInput more = eightStates(true);
    more.add(6, kFourState, std::vector<uint8_t>(4096, 2));
    const Micromap large(gpu(), more);
    for (int round = 0; round < 2; ++round) {
        buildInto(small, first.handle());
        EXPECT_EQ(tracedMicromap(again.handle()), kForwards);
        copy(again.handle(), second.handle());
        buildInto(large, again.handle());
        EXPECT_EQ(tracedMicromap(first.handle()), kBackwards);
        EXPECT_EQ(tracedMicromap(second.handle()), kForwards);
        copy(second.handle(), first.handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
        EXPECT_EQ(tracedMicromap(first.handle()), kForwards);
        EXPECT_LE(query(first.handle(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR), small.size());
    }
}

// From the same query pool.
TEST_F(Translation, SizesOfMicromapsAndOtherStructures)
{
    Micromap micromap(gpu(), repeated(), kAllow);
    micromap.build();
    Blas plain(gpu(), {mapped(nullptr)}, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR);
    for (const VkQueryType type : {kCompactedSize, kSerializedSize}) {
        const auto both = queryAll({plain.handle(), micromap.handle().khr, plain.handle()}, type);
        EXPECT_EQ(both[0], both[2]);
        EXPECT_EQ(both[1], query(micromap.handle().khr, type));
        EXPECT_NE(both[1], both[0]);
        EXPECT_GT(both[1], 0u);
    }
    EXPECT_LT(query(micromap.handle().khr, kCompactedSize), micromap.size());
}

class TranslationSerialized : public Translation
{
protected:
    static constexpr VkBufferUsageFlags kData =
        VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;

    void save(VkAccelerationStructureKHR structure, VkDeviceAddress address)
    {
        gpu().submit([&](VkCommandBuffer commands) {
            recordMicromapToMemory(gpu(), commands, {VK_NULL_HANDLE, structure}, address);
        });
    }
    void restore(VkDeviceAddress address, VkAccelerationStructureKHR structure)
    {
        gpu().submit([&](VkCommandBuffer commands) {
            recordMemoryToMicromap(gpu(), commands, address, {VK_NULL_HANDLE, structure});
        });
    }
    // Of a micromap or another structure.
    Buffer saved(VkAccelerationStructureKHR structure)
    {
        Buffer data(gpu(), query(structure, kSerializedSize), kData);
        EXPECT_EQ(data.address() % 256, 0u);
        save(structure, data.address());
        return data;
    }
    // The beginning of a buffer.
    void fill(const Buffer &target, const Buffer &content)
    {
        gpu().submit([&](VkCommandBuffer commands) {
            const VkBufferCopy all{0, 0, content.size()};
            vkCmdCopyBuffer(commands, content.handle(), target.handle(), 1, &all);
        });
    }
};

TEST_F(TranslationSerialized, VersionsAreTheDrivers)
{
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    const Buffer data = saved(micromap.handle().khr);
    const auto isCompatible = [&] {
        const auto version = vkInit<VkAccelerationStructureVersionInfoKHR>({.pVersionData = data.bytes()});
        VkAccelerationStructureCompatibilityKHR result = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_MAX_ENUM_KHR;
        gpu().vk().GetDeviceAccelerationStructureCompatibilityKHR(gpu().device(), &version, &result);
        return result == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
    };
    EXPECT_TRUE(isCompatible());
    data.bytes()[2 * VK_UUID_SIZE - 1] ^= 1;
    EXPECT_FALSE(isCompatible());
}

#ifndef _WIN32
// Lavapipe's addresses are the host's: a write to these bytes ends the process.
TEST_F(TranslationSerialized, DataIsOnlyRead)
{
    constexpr VkDeviceSize kPages = 1 << 16;
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    ASSERT_LE(query(micromap.handle().khr, kSerializedSize), kPages);
    const Buffer memory(gpu(), 2 * kPages, kData);
    ASSERT_EQ(memory.address(), reinterpret_cast<uint64_t>(memory.bytes()));
    const VkDeviceSize offset = (kPages - memory.address() % kPages) % kPages;
    save(micromap.handle().khr, memory.address() + offset);
    ASSERT_EQ(mprotect(memory.bytes() + offset, kPages, PROT_READ), 0);
    const Placed target(gpu(), kMicromapType, micromap.size());
    restore(memory.address() + offset, target.handle());
    ASSERT_EQ(mprotect(memory.bytes() + offset, kPages, PROT_READ | PROT_WRITE), 0);
    EXPECT_EQ(tracedMicromap(target.handle()), kForwards);
}
#endif

// The target does not state what it is for: the version in mapped memory does, or the size.
TEST_F(TranslationSerialized, MicromapsInGenericStructures)
{
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    const Buffer visible = saved(micromap.handle().khr);
    const Buffer hidden(gpu(), visible.size(), kData, Buffer::Place::Device);
    fill(hidden, visible);
    const Buffer memory(gpu(), 1 << 18, kStorage);
    const Placed whole(gpu(), kGeneric, memory.address(), memory.size());
    restore(visible.address(), whole.handle());
    EXPECT_EQ(tracedMicromap(whole.handle()), kForwards);
    // The source's size, and that of the data, which the proposal for VK_KHR_opacity_micromap suggests.
    for (const VkDeviceSize size : {micromap.size(), visible.size()}) {
        const Placed target(gpu(), kGeneric, size);
        restore(hidden.address(), target.handle());
        EXPECT_EQ(tracedMicromap(target.handle()), kForwards) << size;
    }
}

// The same staging memory, for a micromap and then for another structure.
TEST_F(TranslationSerialized, OtherStructuresInGenericStructures)
{
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    const Blas blas(gpu(), {mapped(nullptr)});
    const Buffer other = saved(blas.handle());
    const Buffer memory(gpu(), 1 << 18, kStorage);
    const Placed whole(gpu(), kGeneric, memory.address(), memory.size());
    for (const Buffer::Place place : {Buffer::Place::Host, Buffer::Place::Device}) {
        const Buffer staging(gpu(), 1 << 16, kData, place);
        save(micromap.handle().khr, staging.address());
        fill(staging, other);
        restore(staging.address(), whole.handle());
        EXPECT_EQ(tracedBottom(whole.address()), kPlain) << static_cast<int>(place);
    }
    // A size as the layer reports it for micromaps.
    const Placed marked(gpu(), kGeneric, memory.address(), (1 << 16) + 64);
    restore(other.address(), marked.handle());
    EXPECT_EQ(tracedBottom(marked.address()), kPlain);
}

// Only the driver knows the type of what was deserialized into a GENERIC structure.
TEST_F(TranslationSerialized, CopiesOfDeserializedTopLevelStructures)
{
    const Blas blas(gpu(), {mapped(nullptr)});
    const Tlas tlas(gpu(), {instance(blas, {0, 0, 0}, 0)});
    const Buffer data = saved(tlas.handle());
    const Placed restored(gpu(), kGeneric, tlas.size());
    restore(data.address(), restored.handle());
    for (const auto type : {kTop, kGeneric}) {
        vt::Structure target(gpu(), type);
        target.create(tlas.size());
        copy(restored.handle(), target.handle());
        EXPECT_EQ(traced(target), kPlain) << type;
    }
}

// With device address commands alone, no structure is a micromap.
TEST(TranslationWithoutMicromaps, StructuresOfAnySize)
{
    Gpu gpu({.quirks = "ext", .micromaps = false, .api = Api::Khr, .addressCommands = true});
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(8)}});
    const Serialized data = serialize(gpu, blas);
    vt::Structure target(gpu, kGeneric);
    target.create((1 << 16) + 64);
    deserialize(gpu, data, target);
    EXPECT_EQ(seenOf(gpu, target), seenOf(gpu, blas));
}

// Serialized data of VK_KHR_opacity_micromap names the micromaps; that of a driver's VK_EXT_opacity_micromap cannot.
TEST_F(Translation, BlasesWithMicromapsAreNotSerialized)
{
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    const Blas with(gpu(), {mapped(&micromap)}), without(gpu(), {mapped(nullptr)});
    const Buffer data(gpu(), 1 << 16, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const auto serialize = [&](VkAccelerationStructureKHR structure) {
        auto info = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>({.src = structure});
        info.dst.deviceAddress = data.address();
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
        std::memset(data.bytes(), 0, data.size());
        gpu().submit(
            [&](VkCommandBuffer commands) { gpu().vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &info); });
        return std::any_of(data.bytes(), data.bytes() + data.size(), [](uint8_t byte) { return byte != 0; });
    };
    EXPECT_TRUE(serialize(without.handle()));
    EXPECT_TRUE(gpu().takeUnexpectedMessages().empty());
    EXPECT_FALSE(serialize(with.handle()));
    expectRejected("not-available");
    // Neither is a copy.
    vt::Structure copied(gpu(), kBottom);
    copied.create(with.size());
    copy(with.handle(), copied.handle());
    EXPECT_FALSE(serialize(copied.handle()));
    expectRejected("not-available");
}

// The commands of VK_EXT_opacity_micromap are the driver's, and so are its handles.
TEST_F(TranslationBeside, MicromapsOfBothExtensions)
{
    Micromap khr(gpu(), eightStates());
    khr.build();
    auto info = vkInit<VkMicromapCreateInfoEXT>();
    const Buffer storage(gpu(), khr.size(), VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | kStorage);
    info.buffer = storage.handle();
    info.size = khr.size();
    VkMicromapEXT ext = VK_NULL_HANDLE;
    VT_CHECK(gpu().vk().CreateMicromapEXT(gpu().device(), &info, nullptr, &ext));
    VkMicromapBuildInfoEXT build = khr.buildInfo();
    build.dstMicromap = ext;
    const uint64_t before = driverBuilds();
    gpu().submit([&](VkCommandBuffer commands) { gpu().vk().CmdBuildMicromapsEXT(commands, 1, &build); });
    EXPECT_EQ(driverBuilds(), before + 1);
    EXPECT_EQ(tracedMicromap(khr), kForwards);
    gpu().vk().DestroyMicromapEXT(gpu().device(), ext, nullptr);
}

// --- how much a structure is said to have of each level and format ---

using Usages = std::vector<VkMicromapUsageEXT>;

class TranslationUsages : public Translation
{
protected:
    static Usages usages(bool built)
    {
        Usages all;
        testDriverFunction<void (*)(bool, Usages *)>("vellumExtUsages")(built, &all);
        return all;
    }
    // A structure of eight triangles with that micromap, whose size was queried at some time.
    struct Bottom {
        explicit Bottom(Gpu &gpu, VkAccelerationStructureKHR micromap) : any(gpu, eightStates()), blas(gpu)
        {
            blas.prepare({mapped(&any)});
            geometry = blas.buildInfo().pGeometries[0];
            attachment = *static_cast<const VkAccelerationStructureTrianglesOpacityMicromapKHR *>(
                geometry.geometry.triangles.pNext);
            attachment.micromap = micromap;
            geometry.geometry.triangles.pNext = &attachment;
        }
        BuildInfo info()
        {
            BuildInfo result = blas.buildInfo();
            result.pGeometries = &geometry;
            return result;
        }
        Micromap any;
        Blas blas;
        VkAccelerationStructureGeometryKHR geometry{};
        VkAccelerationStructureTrianglesOpacityMicromapKHR attachment{};
    };
    Usages measured(Bottom &bottom)
    {
        sizesOf(bottom.info());
        return usages(false);
    }
    Usages built(Bottom &bottom, const std::vector<int> &expected = kForwards)
    {
        build(bottom.info(), bottom.blas.ranges());
        Usages reported = usages(true);
        EXPECT_EQ(tracedBottom(bottom.blas.address()), expected);
        return reported;
    }
    static void expectWithin(const Usages &inner, const Usages &outer)
    {
        EXPECT_FALSE(inner.empty());
        for (const VkMicromapUsageEXT &usage : inner)
            EXPECT_TRUE(std::any_of(outer.begin(), outer.end(),
                                    [&](const VkMicromapUsageEXT &other) {
                                        return other.subdivisionLevel == usage.subdivisionLevel &&
                                               other.format == usage.format && other.count >= usage.count;
                                    }))
                << usage.count << " of level " << usage.subdivisionLevel << ", format " << usage.format;
    }
};

TEST_F(TranslationUsages, MeasuredBeforeTheMicromap)
{
    for (const auto type : {kMicromapType, kGeneric}) {
        const Micromap input(gpu(), eightStates());
        const Placed target(gpu(), type, input.size());
        Bottom bottom(gpu(), target.handle());
        const Usages before = measured(bottom);
        buildInto(input, target.handle());
        const Usages after = built(bottom);
        expectWithin(after, before);
        EXPECT_EQ(after.size(), 1u);
    }
}

// Without the shader that widens indices of eight bits, the geometry has no micromap: by the numbers of its triangles,
// the build would read beyond the micromap's.
TEST_F(TranslationUsages, IndicesThatCannotBeWidened)
{
    const auto failAt = testDriverFunction<uint64_t (*)(uint64_t)>("vellumDriverFailAt");
    const auto failed = testDriverFunction<const char *(*)()>("vellumDriverFailed");
    std::string command;
    for (uint64_t n = 1; command != "vkCreateShaderModule"; ++n) {
        Gpu fresh({.validation = false, .quirks = "ext,failures", .api = Api::Khr});
        Micromap micromap(fresh, eightStates());
        micromap.build();
        Geometry geometry{.vertices = triangleRow(16)};
        geometry.micromap = Attachment{&micromap, VK_INDEX_TYPE_UINT8_EXT, std::vector<int32_t>(16, 3)};
        Blas blas(fresh);
        blas.prepare({geometry});
        VkCommandBuffer commands = fresh.begin();
        const RangeInfo *ranges = blas.ranges();
        failAt(n);
        fresh.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &blas.buildInfo(), &ranges);
        ASSERT_GE(failAt(0), n);
        command = failed();
        EXPECT_EQ(usages(true).empty(), command == "vkCreateShaderModule") << command;
        vkFreeCommandBuffers(fresh.device(), fresh.pool(), 1, &commands);
        fresh.takeMessages();
    }
}

// The same levels and formats, for more triangles; and others between those builds.
TEST_F(TranslationUsages, MicromapsThatAreBuiltAgain)
{
    MicromapInput few;
    few.add(4, kFourState, std::vector<uint8_t>(256, 2));
    MicromapInput other;
    other.add(2, kTwoState, std::vector<uint8_t>(16, 1));
    const Micromap first(gpu(), few), second(gpu(), other), third(gpu(), eightStates());
    const Placed target(gpu(), kMicromapType, third.size());
    Bottom bottom(gpu(), target.handle());
    buildInto(first, target.handle());
    const Usages before = measured(bottom);
    buildInto(third, target.handle());
    expectWithin(built(bottom), before);
    buildInto(second, target.handle());
    const Usages between = measured(bottom);
    buildInto(third, target.handle());
    expectWithin(built(bottom), between);
}

// Only the device reads serialized data. What was serialized to its address may have been replaced.
TEST_F(TranslationUsages, Deserialized)
{
    Micromap first(gpu(), eightStates());
    MicromapInput input;
    for (int i = 0; i < 8; ++i)
        input.add(2, kTwoState, std::vector<uint8_t>(16, 1));
    Micromap second(gpu(), input);
    const Placed target(gpu(), kMicromapType, first.size());
    const Buffer data(gpu(), 1 << 16, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const Buffer other(gpu(), 1 << 16, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    first.build();
    second.build();
    gpu().submit([&](VkCommandBuffer commands) {
        recordMicromapToMemory(gpu(), commands, first.handle(), data.address());
        recordMicromapToMemory(gpu(), commands, second.handle(), other.address());
    });
    Bottom named(gpu(), second.handle().khr);
    const Usages known = built(named, std::vector(8, 1));
    std::memcpy(data.bytes(), other.bytes(), other.size());
    gpu().submit(
        [&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu(), commands, data.address(), target.micromap()); });
    Bottom restored(gpu(), target.handle());
    expectWithin(known, built(restored, std::vector(8, 1)));
}

// --- content, not handles ---

TEST_F(Translation, TypedMicromapsOfOverlappingHandles)
{
    const Buffer memory(gpu(), 1 << 20, kStorage);
    const Placed first(gpu(), kMicromapType, memory.address(), 1 << 20);
    const Placed second(gpu(), kMicromapType, memory.address() + (1 << 19), 1 << 19);
    const Placed third(gpu(), kMicromapType, memory.address() + (1 << 18), (1 << 20) - (1 << 18));
    const Micromap input(gpu(), eightStates());
    buildInto(input, first.handle());
    copy(first.handle(), second.handle());
    EXPECT_EQ(tracedMicromap(second.handle()), kForwards);
    const VkDeviceSize bytes = query(second.handle(), kSerializedSize);
    EXPECT_LT(bytes, 1u << 16);
    const Buffer data(gpu(), bytes, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    gpu().submit(
        [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu(), commands, second.micromap(), data.address()); });
    gpu().submit(
        [&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu(), commands, data.address(), third.micromap()); });
    EXPECT_EQ(tracedMicromap(third.handle()), kForwards);
    EXPECT_EQ(tracedMicromap(second.handle()), kForwards);
}

// Nothing was recorded, and the size is not one of a micromap. The content is unknown, so the layer must not guess a
// command for the driver.
TEST_F(Translation, GenericStructuresOfUnknownContent)
{
    const Placed from(gpu(), kGeneric, 4096), to(gpu(), kGeneric, 4096);
    gpu().takeUnexpectedMessages();
    copy(from.handle(), to.handle());
    expectRejected("not-available");
    const Buffer data(gpu(), 1 << 16, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    gpu().submit(
        [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu(), commands, from.micromap(), data.address()); });
    expectRejected("not-available");
    query(from.handle(), kSerializedSize);
    expectRejected("unknown-content");
    // Before the build, the size identifies it as a micromap.
    const Micromap input(gpu(), eightStates());
    ASSERT_EQ(input.size() % 256, 64u);
    const Placed marked(gpu(), kGeneric, input.size()), target(gpu(), kGeneric, input.size());
    VkCommandBuffer copies = gpu().begin();
    recordCopy(gpu(), copies, marked.handle(), target.handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
    gpu().end(copies);
    buildInto(input, marked.handle());
    gpu().execute(copies);
    EXPECT_EQ(tracedMicromap(target.handle()), kForwards);
}

// --- what is missing ---

class TranslationMissing : public Translation
{
protected:
    TranslationMissing() : Translation({.validation = false, .quirks = "ext", .api = Api::Khr}) {}
};

TEST_F(TranslationMissing, Geometries)
{
    Blas blas(gpu());
    blas.prepare({mapped(nullptr)});
    BuildInfo info = blas.buildInfo();
    const VkAccelerationStructureGeometryKHR *none = nullptr;
    info.pGeometries = nullptr;
    for (const auto *const *all : {static_cast<decltype(&none)>(nullptr), &none}) {
        info.ppGeometries = all;
        EXPECT_EQ(sizesOf(info).accelerationStructureSize, 0u);
        expectRejected("VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788");
        build(info, blas.ranges());
        expectRejected("VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788");
    }
    // Neither geometries nor ranges are required.
    info.geometryCount = 0;
    info.ppGeometries = nullptr;
    build(info);
    gpu().submit(
        [&](VkCommandBuffer commands) { gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, nullptr); });
    EXPECT_TRUE(gpu().takeUnexpectedMessages().empty());
}

// Sizes of structures need no work of the layer, which conditional rendering might discard. The copy of the layer that
// is the driver's extension here does need it, and rejects the command that it is passed.
TEST_F(TranslationMissing, SizesWhereConditionalRenderingIsInherited)
{
    if (!gpu().has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        GTEST_SKIP() << "no VK_EXT_conditional_rendering";
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    const Blas blas(gpu(), {mapped(&micromap)});
    const QueryPool pool(gpu(), kSerializedSize, 2);
    VkCommandBuffer secondary = beginInheritingCondition(gpu());
    VkAccelerationStructureKHR structure = blas.handle();
    gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(secondary, 1, &structure, kSerializedSize, pool, 0);
    for (const Message &m : gpu().takeUnexpectedMessages())
        EXPECT_EQ(m.id, "LOWER-VELLUM-not-available") << m.text;
    structure = micromap.handle().khr;
    gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(secondary, 1, &structure, kSerializedSize, pool, 1);
    expectRejected("not-available");
    VT_CHECK(vkEndCommandBuffer(secondary));
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 2);
        vkCmdExecuteCommands(commands, 1, &secondary);
    });
    uint64_t value = 0;
    for (uint32_t i = 0; i < 2; ++i)
        EXPECT_EQ(vkGetQueryPoolResults(gpu().device(), pool, i, 1, 8, &value, 8, VK_QUERY_RESULT_64_BIT),
                  i == 0 ? VK_SUCCESS : VK_NOT_READY);
}

// An index buffer that is not used may be anything.
TEST_F(TranslationMissing, IndicesOfNoType)
{
    Micromap micromap(gpu(), eightStates());
    micromap.build();
    Blas blas(gpu());
    blas.prepare({mapped(&micromap)});
    VkAccelerationStructureGeometryKHR geometry = blas.buildInfo().pGeometries[0];
    auto attachment =
        *static_cast<const VkAccelerationStructureTrianglesOpacityMicromapKHR *>(geometry.geometry.triangles.pNext);
    ASSERT_EQ(attachment.indexType, VK_INDEX_TYPE_NONE_KHR);
    attachment.indexBuffer = 12345;
    attachment.indexStride = 3;
    geometry.geometry.triangles.pNext = &attachment;
    BuildInfo info = blas.buildInfo();
    info.pGeometries = &geometry;
    build(info, blas.ranges());
    EXPECT_EQ(tracedBottom(blas.address()), kForwards);
    EXPECT_TRUE(gpu().takeUnexpectedMessages().empty());
}

// --- devices ---

class TranslationDevices : public Translation
{
protected:
    TranslationDevices() : Translation({.validation = false, .quirks = "ext,caching", .api = Api::Khr}) {}

    VkResult create(const std::vector<const char *> &names, VkDevice &device)
    {
        const float priority = 1;
        auto queue = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
        auto micromaps = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>({.micromap = VK_TRUE});
        auto info = vkInit<VkDeviceCreateInfo>();
        info.pNext =
            std::ranges::any_of(
                names, [](const char *name) { return std::strcmp(name, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME) == 0; })
                ? &micromaps
                : nullptr;
        info.queueCreateInfoCount = 1;
        info.pQueueCreateInfos = &queue;
        info.enabledExtensionCount = static_cast<uint32_t>(names.size());
        info.ppEnabledExtensionNames = names.data();
        return vkCreateDevice(gpu().physical(), &info, nullptr, &device);
    }
};

TEST_F(TranslationDevices, EverythingThatIsListed)
{
    uint32_t count = 0;
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu().physical(), nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> list(count);
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu().physical(), nullptr, &count, list.data()));
    std::vector<const char *> names;
    for (const VkExtensionProperties &extension : list)
        names.push_back(extension.extensionName);
    for (const char *name : {VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, "VK_KHR_pipeline_binary",
                             VK_EXT_SHADER_MODULE_IDENTIFIER_EXTENSION_NAME})
        EXPECT_TRUE(std::ranges::any_of(names, [name](const char *n) { return std::strcmp(n, name) == 0; })) << name;
    VkDevice device = VK_NULL_HANDLE;
    EXPECT_EQ(create(names, device), VK_SUCCESS);
    vkDestroyDevice(device, nullptr);
    EXPECT_TRUE(gpu().takeUnexpectedMessages().empty());
}

// The commands of micromaps are missing, and the layer must not fail because of that.
TEST_F(TranslationDevices, AddressCommandsAlone)
{
    VkDevice device = VK_NULL_HANDLE;
    ASSERT_EQ(create({VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME, VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
                      VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME},
                     device),
              VK_SUCCESS);
    gpu().takeUnexpectedMessages();
    const auto sizesOf = reinterpret_cast<PFN_vkGetAccelerationStructureBuildSizesKHR>(
        vkGetDeviceProcAddr(device, "vkGetAccelerationStructureBuildSizesKHR"));
    const Micromap input(gpu(), eightStates());
    const StructureBuild build(input.buildInfo(), VK_NULL_HANDLE);
    auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    sizesOf(device, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build.info, nullptr, &sizes);
    EXPECT_EQ(sizes.accelerationStructureSize, 0u);
    expectRejected("VUID-VkAccelerationStructureBuildGeometryInfoKHR-micromap-11559");
    vkDestroyDevice(device, nullptr);
}

} // namespace
