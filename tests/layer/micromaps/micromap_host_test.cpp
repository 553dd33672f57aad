// SPDX-License-Identifier: Apache-2.0
// The host commands of micromaps: each writes the same as its device command, and both can be mixed.
#include <algorithm>

#include "core/micromap_memory.h"
#include "harness/program/labels.h"
#include "harness/states.h"
#include "micromaps/build_flags.h"

namespace
{

const vt::Labels kMicromapHostLabels{{"MicromapHost.*", "one_api"},
                                     {"MicromapHost.*Modes*", "strict_ext"},
                                     {"MicromapHostDisabled.*", "one_api"},
                                     {"MicromapHostNewer.*", "one_api"},
                                     {"MicromapHostValidated.*", "one_api"}};

using namespace vt;

constexpr size_t kHeader = 64;

class MicromapHost : public GpuTest
{
protected:
    // Host commands are VK_EXT_opacity_micromap's only.
    explicit MicromapHost(const Options &options = {.api = Api::Ext}) : GpuTest(options) {}

    static MicromapInput mixed()
    {
        Random random(51);
        MicromapInput input;
        for (int i = 0; i < 300; ++i) {
            const uint32_t level = (random() >> 8) % 9;
            const uint16_t format = random() >> 31 != 0 ? kTwoState : kFourState;
            if (i % 3 == 0 && !input.triangles.empty())
                input.triangles.push_back(input.triangles[(random() >> 8) % input.triangles.size()]);
            else
                input.add(level, format, randomStates(random, level, format));
        }
        return input;
    }
    // Data that can stay as it lies, without bytes that no triangle has.
    static MicromapInput dense(uint32_t level, uint16_t format)
    {
        Random random(level + format);
        MicromapInput input;
        for (int i = 0; i < 300; ++i)
            input.add(level, format, randomStates(random, level, format));
        return input;
    }
    // The bytes in use.
    static std::vector<uint8_t> used(const Micromap &micromap)
    {
        return {micromap.memory(), micromap.memory() + vellum::micromapMemoryInUse(micromap.memory())};
    }
    void hostBuild(const Micromap &micromap)
    {
        const VkMicromapBuildInfoEXT info = micromap.hostBuildInfo();
        VT_CHECK(gpu().vk().BuildMicromapsEXT(gpu().device(), VK_NULL_HANDLE, 1, &info));
    }
    VkResult hostCopy(const Micromap &from, const Micromap &to, VkCopyMicromapModeEXT mode,
                      VkDeferredOperationKHR operation = VK_NULL_HANDLE)
    {
        auto info = vkInit<VkCopyMicromapInfoEXT>({.src = from.handle().ext, .dst = to.handle().ext, .mode = mode});
        return gpu().vk().CopyMicromapEXT(gpu().device(), operation, &info);
    }
    VkDeviceSize hostSize(const Micromap &micromap, VkQueryType type)
    {
        const VkMicromapEXT handle = micromap.handle().ext;
        VkDeviceSize size = 0;
        VT_CHECK(gpu().vk().WriteMicromapsPropertiesEXT(gpu().device(), 1, &handle, type, 8, &size, 8));
        return size;
    }
    std::vector<uint8_t> hostSerialize(const Micromap &micromap)
    {
        std::vector<uint8_t> bytes(hostSize(micromap, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT));
        auto info = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = micromap.handle().ext});
        info.dst.hostAddress = bytes.data();
        info.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
        VT_CHECK(gpu().vk().CopyMicromapToMemoryEXT(gpu().device(), VK_NULL_HANDLE, &info));
        return bytes;
    }
    void hostDeserialize(const std::vector<uint8_t> &bytes, const Micromap &to)
    {
        auto info = vkInit<VkCopyMemoryToMicromapInfoEXT>();
        info.src.hostAddress = bytes.data();
        info.dst = to.handle().ext;
        info.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
        VT_CHECK(gpu().vk().CopyMemoryToMicromapEXT(gpu().device(), VK_NULL_HANDLE, &info));
    }
    Buffer deviceSerialize(const Micromap &micromap, size_t size)
    {
        Buffer out(gpu(), size, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        auto info = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = micromap.handle().ext});
        info.dst.deviceAddress = out.address();
        info.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
        gpu().submit([&](VkCommandBuffer commands) { gpu().vk().CmdCopyMicromapToMemoryEXT(commands, &info); });
        return out;
    }
    void expectMessage(const char *part)
    {
        const std::vector<Message> all = gpu().takeUnexpectedMessages();
        EXPECT_TRUE(std::any_of(all.begin(), all.end(), [part](const Message &m) {
            return m.id.find(part) != std::string::npos;
        })) << part;
    }
    static constexpr std::array<VkBuildMicromapFlagsEXT, 4> kFlags{
        0, kAllow, VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT, kAllow | VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT};
};

TEST_F(MicromapHost, BuildsAreThoseOfTheDevice)
{
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        SCOPED_TRACE(testing::Message() << "flags " << flags);
        for (const MicromapInput &input : {mixed(), dense(3, kFourState), dense(4, kTwoState), dense(6, kTwoState)}) {
            Micromap device(gpu(), input, flags);
            device.build();
            const Micromap host(gpu(), input, flags);
            hostBuild(host);
            EXPECT_GT(used(host).size(), 5000u);
            EXPECT_EQ(used(host), used(device));
        }
    }
}

// Large triangles that use the same data, of which the usage counts declare only one: scratch memory has no capacity
// for the parts of the others. A triangle that was not examined must not count as transparent.
TEST_F(MicromapHost, MoreLargeTrianglesThanDeclared)
{
    MicromapInput input;
    std::vector<uint8_t> states(1u << 16);
    for (size_t i = 0; i < states.size(); ++i)
        states[i] = i % 4;
    input.add(8, kFourState, states);
    for (int i = 0; i < 7; ++i)
        input.triangles.push_back(input.triangles[0]);
    input.declared = {{1, 8, kFourState}, {7, 0, kFourState}};
    for (const VkBuildMicromapFlagsEXT flags : std::array<VkBuildMicromapFlagsEXT, 2>{0, kFast}) {
        SCOPED_TRACE(testing::Message() << "flags " << flags);
        Micromap device(gpu(), input, flags);
        device.build();
        for (size_t i = 0; i < input.triangles.size(); ++i) {
            uint32_t coarse = 0;
            std::memcpy(&coarse, device.memory() + 64 + 8 * i + 4, 4);
            for (uint32_t sub = 0; sub < 16; ++sub)
                EXPECT_GE(coarse >> (2 * sub) & 3u, 2u) << "triangle " << i;
        }
        const Micromap host(gpu(), input, flags);
        hostBuild(host);
        EXPECT_EQ(used(host), used(device));
    }
}

TEST_F(MicromapHost, CompactionAndSizes)
{
    const Micromap source(gpu(), mixed(), kAllow);
    hostBuild(source);
    const VkDeviceSize size = hostSize(source, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT);
    EXPECT_LT(size, used(source).size());
    const Micromap target(gpu(), source, size), onDevice(gpu(), source, size);
    EXPECT_EQ(hostCopy(source, target, VK_COPY_MICROMAP_MODE_COMPACT_EXT), VK_SUCCESS);
    EXPECT_EQ(used(target).size(), size);
    EXPECT_EQ(hostSize(target, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT), size);
    gpu().submit([&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu(), commands, source.handle(), onDevice.handle(), VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    });
    EXPECT_EQ(used(target), used(onDevice));
    const Micromap clone(gpu(), source, source.size());
    EXPECT_EQ(hostCopy(source, clone, VK_COPY_MICROMAP_MODE_CLONE_EXT), VK_SUCCESS);
    EXPECT_EQ(used(clone), used(source));
    const Micromap small(gpu(), source, size - 16);
    EXPECT_EQ(hostCopy(source, small, VK_COPY_MICROMAP_MODE_COMPACT_EXT), VK_SUCCESS);
    EXPECT_TRUE(used(small).empty());
    expectMessage("VELLUM-micromap-copy-size");
}

TEST_F(MicromapHost, SerializedByOneReadByTheOther)
{
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        Micromap source(gpu(), mixed(), flags);
        source.build();
        const std::vector<uint8_t> bytes = hostSerialize(source);
        const Buffer device = deviceSerialize(source, bytes.size());
        EXPECT_EQ(std::memcmp(bytes.data(), device.bytes(), bytes.size()), 0);
        const Micromap target(gpu(), source, bytes.size() - kHeader);
        hostDeserialize(bytes, target);
        EXPECT_EQ(used(target), used(source));
        const Micromap onDevice(gpu(), source, source.size());
        auto info = vkInit<VkCopyMemoryToMicromapInfoEXT>();
        info.src.deviceAddress = device.address();
        info.dst = onDevice.handle().ext;
        info.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
        gpu().submit([&](VkCommandBuffer commands) { gpu().vk().CmdCopyMemoryToMicromapEXT(commands, &info); });
        EXPECT_EQ(used(onDevice), used(source));
        // Invalid data is rejected.
        std::vector<uint8_t> bad = bytes;
        bad[20] ^= 1;
        hostDeserialize(bad, target);
        EXPECT_TRUE(used(target).empty());
        expectMessage("VELLUM-VUID-VkCopyMemoryToMicromapInfoEXT-src-07549");
        const Micromap small(gpu(), source, bytes.size() - kHeader - 16);
        hostDeserialize(bytes, small);
        EXPECT_TRUE(used(small).empty());
        expectMessage("VELLUM-micromap-copy-size");
    }
}

// The application need not have mapped the memory, and may have mapped a part of it.
TEST_F(MicromapHost, MappedOrNot)
{
    Micromap reference(gpu(), mixed(), kAllow);
    reference.build();
    const Micromap micromap(gpu(), mixed(), kAllow);
    const std::vector<uint8_t> expected = used(reference);
    uint8_t *const before = const_cast<uint8_t *>(micromap.memory());
    vkUnmapMemory(gpu().device(), micromap.storageMemory());
    hostBuild(micromap);
    void *part = nullptr;
    VT_CHECK(vkMapMemory(gpu().device(), micromap.storageMemory(), 64, 64, 0, &part));
    hostBuild(micromap);
    vkUnmapMemory(gpu().device(), micromap.storageMemory());
    void *whole = nullptr;
    VT_CHECK(vkMapMemory(gpu().device(), micromap.storageMemory(), 0, VK_WHOLE_SIZE, 0, &whole));
    EXPECT_EQ(static_cast<uint8_t *>(part), static_cast<uint8_t *>(whole) + 64);
    ASSERT_EQ(micromap.memory(), before) << "lavapipe's memory has one address";
    EXPECT_EQ(used(micromap), expected);
}

TEST_F(MicromapHost, DeferredOperations)
{
    const auto create = reinterpret_cast<PFN_vkCreateDeferredOperationKHR>(
        vkGetDeviceProcAddr(gpu().device(), "vkCreateDeferredOperationKHR"));
    const auto resultOf = reinterpret_cast<PFN_vkGetDeferredOperationResultKHR>(
        vkGetDeviceProcAddr(gpu().device(), "vkGetDeferredOperationResultKHR"));
    const auto destroy = reinterpret_cast<PFN_vkDestroyDeferredOperationKHR>(
        vkGetDeviceProcAddr(gpu().device(), "vkDestroyDeferredOperationKHR"));
    VkDeferredOperationKHR operation = VK_NULL_HANDLE;
    VT_CHECK(create(gpu().device(), nullptr, &operation));
    const Micromap source(gpu(), mixed(), kAllow);
    const VkMicromapBuildInfoEXT info = source.hostBuildInfo();
    EXPECT_EQ(gpu().vk().BuildMicromapsEXT(gpu().device(), operation, 1, &info), VK_OPERATION_NOT_DEFERRED_KHR);
    EXPECT_EQ(resultOf(gpu().device(), operation), VK_SUCCESS);
    const Micromap clone(gpu(), source, source.size());
    EXPECT_EQ(hostCopy(source, clone, VK_COPY_MICROMAP_MODE_CLONE_EXT, operation), VK_OPERATION_NOT_DEFERRED_KHR);
    EXPECT_EQ(used(clone), used(source));
    destroy(gpu().device(), operation, nullptr);
}

TEST_F(MicromapHost, RejectsWithoutBoundMemory)
{
    auto info = vkInit<VkBufferCreateInfo>({.size = 65536, .usage = VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu().device(), &info, nullptr, &buffer));
    auto create = vkInit<VkMicromapCreateInfoEXT>({.buffer = buffer, .size = 65536});
    VkMicromapEXT unbound = VK_NULL_HANDLE;
    VT_CHECK(gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &unbound));
    const VkMicromapUsageEXT usage{1, 3, kFourState};
    const Micromap other(gpu(), mixed());
    VkMicromapBuildInfoEXT build = other.hostBuildInfo();
    build.usageCountsCount = 1;
    build.pUsageCounts = &usage;
    build.dstMicromap = unbound;
    EXPECT_LT(gpu().vk().BuildMicromapsEXT(gpu().device(), VK_NULL_HANDLE, 1, &build), VK_SUCCESS);
    expectMessage("VUID-vkBuildMicromapsEXT-pInfos-07552");
    VkDeviceSize size = 0;
    EXPECT_LT(gpu().vk().WriteMicromapsPropertiesEXT(gpu().device(), 1, &unbound,
                                                     VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT, 8, &size, 8),
              VK_SUCCESS);
    expectMessage("vkWriteMicromapsPropertiesEXT-buffer-07577");
    const auto rejected = [&](VkResult result, const char *rule) {
        EXPECT_LT(result, VK_SUCCESS);
        expectMessage(rule);
    };
    auto copy = vkInit<VkCopyMicromapInfoEXT>({.src = unbound, .dst = other.handle().ext});
    rejected(gpu().vk().CopyMicromapEXT(gpu().device(), VK_NULL_HANDLE, &copy), "vkCopyMicromapEXT-buffer-07558");
    std::swap(copy.src, copy.dst);
    rejected(gpu().vk().CopyMicromapEXT(gpu().device(), VK_NULL_HANDLE, &copy), "vkCopyMicromapEXT-buffer-07559");
    std::vector<uint8_t> bytes(4096);
    auto save = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = unbound});
    save.dst.hostAddress = bytes.data();
    save.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    rejected(gpu().vk().CopyMicromapToMemoryEXT(gpu().device(), VK_NULL_HANDLE, &save),
             "vkCopyMicromapToMemoryEXT-buffer-07568");
    auto load = vkInit<VkCopyMemoryToMicromapInfoEXT>();
    load.src.hostAddress = bytes.data();
    load.dst = unbound;
    load.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    rejected(gpu().vk().CopyMemoryToMicromapEXT(gpu().device(), VK_NULL_HANDLE, &load),
             "vkCopyMemoryToMicromapEXT-buffer-07565");
    EXPECT_EQ(bytes, std::vector<uint8_t>(4096));
    gpu().vk().DestroyMicromapEXT(gpu().device(), unbound, nullptr);
    vkDestroyBuffer(gpu().device(), buffer, nullptr);
}

TEST_F(MicromapHost, RejectsWrongModesPointersAndSizes)
{
    const Micromap source(gpu(), mixed()), target(gpu(), mixed());
    hostBuild(source);
    hostBuild(target);
    const std::vector<uint8_t> before = used(target);
    const auto rejected = [&](VkResult result, const char *rule) {
        EXPECT_LT(result, VK_SUCCESS);
        expectMessage(rule);
        EXPECT_EQ(used(target), before);
    };
    const VkDevice device = gpu().device();
    for (const bool data : {false, true}) {
        VkMicromapBuildInfoEXT build = target.hostBuildInfo();
        (data ? build.data : build.triangleArray).hostAddress = nullptr;
        rejected(gpu().vk().BuildMicromapsEXT(device, VK_NULL_HANDLE, 1, &build),
                 data ? "vkBuildMicromapsEXT-pInfos-07553" : "vkBuildMicromapsEXT-pInfos-07554");
    }
    std::vector<uint8_t> bytes(1 << 20);
    auto save = vkInit<VkCopyMicromapToMemoryInfoEXT>(
        {.src = source.handle().ext, .mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT});
    rejected(gpu().vk().CopyMicromapToMemoryEXT(device, VK_NULL_HANDLE, &save),
             "vkCopyMicromapToMemoryEXT-pInfo-07569");
    auto load = vkInit<VkCopyMemoryToMicromapInfoEXT>(
        {.dst = target.handle().ext, .mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT});
    rejected(gpu().vk().CopyMemoryToMicromapEXT(device, VK_NULL_HANDLE, &load),
             "vkCopyMemoryToMicromapEXT-pInfo-07563");
    const std::array<VkMicromapEXT, 2> both{source.handle().ext, target.handle().ext};
    std::array<VkDeviceSize, 2> sizes{1, 1};
    const auto write = [&](VkQueryType type, size_t size, size_t stride) {
        return gpu().vk().WriteMicromapsPropertiesEXT(device, 2, both.data(), type, size, sizes.data(), stride);
    };
    rejected(write(VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT, 12, 8), "vkWriteMicromapsPropertiesEXT-dataSize-07576");
    EXPECT_EQ(sizes[1], 1u);
    rejected(write(VK_QUERY_TYPE_OCCLUSION, 16, 8), "vkWriteMicromapsPropertiesEXT-queryType-07503");
}

// Modes that a command does not have: there is one thing that it can do, unless the layer is strict.
TEST_F(MicromapHost, OtherModes)
{
    const Micromap source(gpu(), mixed()), target(gpu(), mixed());
    hostBuild(source);
    const auto done = [&](VkResult result, const char *rule) {
        EXPECT_EQ(result == VK_SUCCESS, !strictTests());
        expectMessage(rule);
    };
    const VkDevice device = gpu().device();
    done(hostCopy(source, target, VK_COPY_MICROMAP_MODE_SERIALIZE_EXT), "VkCopyMicromapInfoEXT-mode-07531");
    if (!strictTests()) {
        EXPECT_EQ(used(target), used(source));
    }
    target.forget();
    std::vector<uint8_t> bytes(1 << 20);
    auto save = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = source.handle().ext});
    save.dst.hostAddress = bytes.data();
    save.mode = VK_COPY_MICROMAP_MODE_CLONE_EXT;
    done(gpu().vk().CopyMicromapToMemoryEXT(device, VK_NULL_HANDLE, &save), "VkCopyMicromapToMemoryInfoEXT-mode-07542");
    EXPECT_EQ(bytes == std::vector<uint8_t>(bytes.size()), strictTests());
    auto load = vkInit<VkCopyMemoryToMicromapInfoEXT>();
    load.src.hostAddress = bytes.data();
    load.dst = target.handle().ext;
    load.mode = VK_COPY_MICROMAP_MODE_COMPACT_EXT;
    done(gpu().vk().CopyMemoryToMicromapEXT(device, VK_NULL_HANDLE, &load), "VkCopyMemoryToMicromapInfoEXT-mode-07548");
    if (!strictTests()) {
        EXPECT_EQ(used(target).size(), used(source).size());
    }
}

class MicromapHostNewer : public MicromapHost
{
protected:
    MicromapHostNewer() : MicromapHost(Options{.oldValidation = false, .api = Api::Ext, .newer = true}) {}
};

// A mapping that only the driver can make (VK_EXT_map_memory_placed defines its structure; here it requests nothing) is
// one nevertheless: the layer must not map the memory a second time, and must unmap it when the application does.
TEST_F(MicromapHostNewer, MappedByTheDriver)
{
    struct MapInfo { // VkMemoryMapInfo, which the oldest supported headers do not know
        VkStructureType sType;
        const void *pNext;
        VkFlags flags;
        VkDeviceMemory memory;
        VkDeviceSize offset, size;
    };
    struct Placed { // VkMemoryMapPlacedInfoEXT
        VkStructureType sType;
        const void *pNext;
        void *address;
    };
    using Map = VkResult(VKAPI_PTR *)(VkDevice, const MapInfo *, void **);
    const auto map = reinterpret_cast<Map>(vkGetDeviceProcAddr(gpu().device(), "vkMapMemory2KHR"));
    if (map == nullptr)
        GTEST_SKIP() << "no VK_KHR_map_memory2";
    Micromap reference(gpu(), mixed(), kAllow);
    reference.build();
    const Micromap micromap(gpu(), mixed(), kAllow);
    vkUnmapMemory(gpu().device(), micromap.storageMemory());
    const Placed placed{static_cast<VkStructureType>(1000272002), nullptr, nullptr};
    const MapInfo info{VK_STRUCTURE_TYPE_MEMORY_MAP_INFO_KHR, &placed, 0, micromap.storageMemory(), 0, VK_WHOLE_SIZE};
    for (int turn = 0; turn < 2; ++turn) {
        void *whole = nullptr;
        VT_CHECK(map(gpu().device(), &info, &whole));
        hostBuild(micromap);
        EXPECT_EQ(used(micromap), used(reference));
        vkUnmapMemory(gpu().device(), micromap.storageMemory());
    }
    void *whole = nullptr;
    VT_CHECK(vkMapMemory(gpu().device(), micromap.storageMemory(), 0, VK_WHOLE_SIZE, 0, &whole));
}

class MicromapHostDisabled : public MicromapHost
{
protected:
    MicromapHostDisabled() : MicromapHost(Options{.api = Api::Ext, .hostCommands = false}) {}
};

TEST_F(MicromapHostDisabled, RejectsHostCommands)
{
    const Micromap micromap(gpu(), mixed());
    const auto rejected = [&](VkResult result, const char *rule) {
        EXPECT_EQ(result, VK_ERROR_FEATURE_NOT_PRESENT);
        expectMessage(rule);
    };
    const VkDevice device = gpu().device();
    const VkMicromapBuildInfoEXT info = micromap.hostBuildInfo();
    rejected(gpu().vk().BuildMicromapsEXT(device, VK_NULL_HANDLE, 1, &info),
             "VUID-vkBuildMicromapsEXT-micromapHostCommands-07555");
    const Micromap other(gpu(), mixed());
    rejected(hostCopy(micromap, other, VK_COPY_MICROMAP_MODE_CLONE_EXT),
             "VUID-vkCopyMicromapEXT-micromapHostCommands-07560");
    std::vector<uint8_t> bytes(4096);
    auto load = vkInit<VkCopyMemoryToMicromapInfoEXT>();
    load.src.hostAddress = bytes.data();
    load.dst = micromap.handle().ext;
    load.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    rejected(gpu().vk().CopyMemoryToMicromapEXT(device, VK_NULL_HANDLE, &load),
             "VUID-vkCopyMemoryToMicromapEXT-micromapHostCommands-07566");
    auto save = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = micromap.handle().ext});
    save.dst.hostAddress = bytes.data();
    save.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    rejected(gpu().vk().CopyMicromapToMemoryEXT(device, VK_NULL_HANDLE, &save),
             "VUID-vkCopyMicromapToMemoryEXT-micromapHostCommands-07571");
    const VkMicromapEXT handle = micromap.handle().ext;
    VkDeviceSize size = 0;
    rejected(gpu().vk().WriteMicromapsPropertiesEXT(device, 1, &handle, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT, 8,
                                                    &size, 8),
             "VUID-vkWriteMicromapsPropertiesEXT-micromapHostCommands-07578");
}

class MicromapHostValidated : public MicromapHost
{
protected:
    MicromapHostValidated() : MicromapHost(Options{.api = Api::Ext, .validate = true}) {}
};

TEST_F(MicromapHostValidated, ReportsWrongInput)
{
    MicromapInput input = mixed();
    input.declared = input.usage();
    input.triangles[4].format = 7;
    const Micromap micromap(gpu(), std::move(input));
    hostBuild(micromap);
    const std::vector<Message> reported = gpu().takeUnexpectedMessages();
    ASSERT_EQ(reported.size(), 1u);
    EXPECT_NE(reported[0].text.find("triangle 4: format 7"), std::string::npos) << reported[0].text;
}

} // namespace
