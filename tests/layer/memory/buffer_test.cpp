// SPDX-License-Identifier: Apache-2.0
// Buffers and memory as they reach the driver: usage that the layer adds, and the bindings that it tracks. The spy
// below the layer reports usage that a buffer may not have.
#include <array>

#include "gpu/scene.h"
#include "harness/harness.h"
#include "harness/mock_driver.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kBufferLabels{{"BindingsExt.*", "one_api"}};

using namespace vt;

constexpr auto kUnknownType = static_cast<VkStructureType>(0x7ffffff0); // a structure of the future
constexpr VkBufferUsageFlags kScratchUsage =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
constexpr VkBufferUsageFlags kMicromapUsage =
    VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;

VkBufferCreateInfo bufferInfo(VkBufferUsageFlags usage, const void *next = nullptr, VkBufferCreateFlags flags = 0)
{
    return vkInit<VkBufferCreateInfo>({.pNext = next, .flags = flags, .size = 65536, .usage = usage});
}

class Buffers : public GpuTest
{
protected:
    // Without the validation layer, which is older than some of the structures and does not support protected memory on
    // lavapipe.
    explicit Buffers(const Options &options = {.validation = false}) : GpuTest(options) {}

    void create(const VkBufferCreateInfo &info)
    {
        VkBuffer buffer = VK_NULL_HANDLE;
        VT_CHECK(vkCreateBuffer(gpu().device(), &info, nullptr, &buffer));
        vkDestroyBuffer(gpu().device(), buffer, nullptr);
        auto query = vkInit<VkDeviceBufferMemoryRequirements>({.pCreateInfo = &info});
        auto requirements = vkInit<VkMemoryRequirements2>();
        vkGetDeviceBufferMemoryRequirements(gpu().device(), &query, &requirements);
    }
    void expectMessages(const char *id, size_t count)
    {
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        EXPECT_EQ(messages.size(), count);
        for (const Message &message : messages)
            EXPECT_EQ(message.id, id) << message.text;
    }
};

TEST_F(Buffers, ProtectedBuffersGetNoMoreUsage)
{
    for (const VkBufferUsageFlags usage : {kScratchUsage, VkBufferUsageFlags{VK_BUFFER_USAGE_STORAGE_BUFFER_BIT},
                                           kScratchUsage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT}) {
        create(bufferInfo(usage, nullptr, VK_BUFFER_CREATE_PROTECTED_BIT));
        const auto usage2 = vkInit<VkBufferUsageFlags2CreateInfoKHR>({.usage = usage});
        create(bufferInfo(0, &usage2, VK_BUFFER_CREATE_PROTECTED_BIT));
    }
}

TEST_F(Buffers, TileMemoryGetsNoMoreUsage)
{
    constexpr VkBufferUsageFlags kTileMemory = 0x08000000; // VK_BUFFER_USAGE_TILE_MEMORY_BIT_QCOM
    create(bufferInfo(kScratchUsage | kTileMemory));
}

// The driver gets it as it is, where the layer has to change it.
TEST_F(Buffers, UsageBehindAnUnknownStructureIsReported)
{
    auto usage2 = vkInit<VkBufferUsageFlags2CreateInfoKHR>({.usage = kScratchUsage});
    const VkBaseInStructure unknown{kUnknownType, reinterpret_cast<const VkBaseInStructure *>(&usage2)};
    create(bufferInfo(0, &unknown));
    expectMessages("VELLUM-unknown-structure", 2);
    usage2.usage = VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT;
    create(bufferInfo(0, &unknown));
    expectMessages("", 0);
}

TEST_F(Buffers, AllocationFlagsBehindAnUnknownStructureAreReported)
{
    auto flags = vkInit<VkMemoryAllocateFlagsInfo>();
    const VkBaseInStructure unknown{kUnknownType, reinterpret_cast<const VkBaseInStructure *>(&flags)};
    auto info = vkInit<VkMemoryAllocateInfo>({.pNext = &unknown, .allocationSize = 4096});
    for (const VkMemoryAllocateFlags given : {0u, 0u + VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT}) {
        flags.flags = given;
        VkDeviceMemory memory = VK_NULL_HANDLE;
        VT_CHECK(vkAllocateMemory(gpu().device(), &info, nullptr, &memory));
        vkFreeMemory(gpu().device(), memory, nullptr);
        expectMessages("VELLUM-unknown-structure", given == 0 ? 1 : 0);
    }
}

// The usage may be in the chain as well.
TEST_F(Buffers, ExternalMemory)
{
    const auto usage2 = vkInit<VkBufferUsageFlags2CreateInfoKHR>({.usage = kMicromapUsage});
    auto info = vkInit<VkPhysicalDeviceExternalBufferInfo>(
        {.usage = kMicromapUsage, .handleType = VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT});
    for (const void *chain : {static_cast<const void *>(nullptr), static_cast<const void *>(&usage2)}) {
        info.pNext = chain;
        auto properties = vkInit<VkExternalBufferProperties>();
        vkGetPhysicalDeviceExternalBufferProperties(gpu().physical(), &info, &properties);
    }
}

// Host commands map what a buffer is bound to.
class BindingsExt : public Buffers
{
protected:
    BindingsExt() : Buffers({.validation = false, .quirks = "failures", .api = Api::Ext}) {}
};

TEST_F(BindingsExt, PartialFailures)
{
    MicromapInput input;
    input.add(4, kFourState, std::vector<uint8_t>(256, 1));
    const Micromap like(gpu(), input);
    constexpr uint32_t kCount = 3, kFailing = 1;
    std::array<VkBuffer, kCount> buffers{};
    std::array<VkResult, kCount> results{VK_NOT_READY, VK_NOT_READY, VK_NOT_READY};
    std::array<VkBindMemoryStatusKHR, kCount> statuses{};
    std::array<VkBindBufferMemoryInfo, kCount> infos{};
    const VkBufferCreateInfo info = bufferInfo(VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT);
    VkDeviceMemory memory = VK_NULL_HANDLE;
    for (uint32_t i = 0; i < kCount; ++i) {
        VT_CHECK(vkCreateBuffer(gpu().device(), &info, nullptr, &buffers[i]));
        VkMemoryRequirements needs{};
        vkGetBufferMemoryRequirements(gpu().device(), buffers[i], &needs);
        auto allocation = vkInit<VkMemoryAllocateInfo>(
            {.allocationSize = kCount * needs.size,
             .memoryTypeIndex = gpu().memoryType(needs.memoryTypeBits, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT)});
        if (i == 0)
            VT_CHECK(vkAllocateMemory(gpu().device(), &allocation, nullptr, &memory));
        statuses[i] = vkInit<VkBindMemoryStatusKHR>({.pResult = &results[i]});
        infos[i] = vkInit<VkBindBufferMemoryInfo>(
            {.pNext = &statuses[i], .buffer = buffers[i], .memory = memory, .memoryOffset = i * needs.size});
    }
    const auto failAt = testDriverFunction<uint64_t (*)(uint64_t)>("vellumDriverFailAt");
    failAt(kFailing + 1);
    EXPECT_EQ(vkBindBufferMemory2(gpu().device(), kCount, infos.data()), VK_ERROR_OUT_OF_DEVICE_MEMORY);
    failAt(0);
    for (uint32_t i = 0; i < kCount; ++i) {
        const bool bound = i != kFailing;
        EXPECT_EQ(results[i] == VK_SUCCESS, bound);
        auto create = vkInit<VkMicromapCreateInfoEXT>({.buffer = buffers[i], .size = info.size});
        VkMicromapEXT micromap = VK_NULL_HANDLE;
        VT_CHECK(gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &micromap));
        VkMicromapBuildInfoEXT build = like.hostBuildInfo();
        build.dstMicromap = micromap;
        EXPECT_EQ(gpu().vk().BuildMicromapsEXT(gpu().device(), VK_NULL_HANDLE, 1, &build) == VK_SUCCESS, bound) << i;
        expectMessages("VELLUM-VUID-vkBuildMicromapsEXT-pInfos-07552", bound ? 0 : 1);
        gpu().vk().DestroyMicromapEXT(gpu().device(), micromap, nullptr);
        vkDestroyBuffer(gpu().device(), buffers[i], nullptr);
    }
    vkFreeMemory(gpu().device(), memory, nullptr);
}

} // namespace
