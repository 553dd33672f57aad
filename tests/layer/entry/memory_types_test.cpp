// SPDX-License-Identifier: Apache-2.0
// Memory types of devices other than lavapipe: one for each purpose, in small heaps, or usable only with a feature. The
// mock driver (layers/memory_quirk.cpp) reports what breaks their rules.
#include <algorithm>

#include "gpu/copies.h"
#include "harness/harness.h"

namespace
{

using namespace vt;

constexpr VkMemoryPropertyFlags kLocal = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
constexpr VkMemoryPropertyFlags kVisible = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
constexpr VkMemoryPropertyFlags kCoherent = VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

class MemoryTypes : public testing::Test
{
protected:
    // A memory type of exactly those properties.
    static uint32_t type(const Gpu &gpu, VkMemoryPropertyFlags flags)
    {
        VkPhysicalDeviceMemoryProperties memory;
        vkGetPhysicalDeviceMemoryProperties(gpu.physical(), &memory);
        for (uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
            if (memory.memoryTypes[i].propertyFlags == flags)
                return i;
        }
        throw std::runtime_error("no such memory type");
    }
    static void expectNoMessages(Gpu &gpu)
    {
        for (const Message &m : gpu.takeUnexpectedMessages())
            ADD_FAILURE() << m.id << ": " << m.text;
    }
    static VkResult allocate(const Gpu &gpu, uint32_t type, VkDeviceSize bytes, VkDeviceMemory &memory)
    {
        auto info = vkInit<VkMemoryAllocateInfo>({.allocationSize = bytes, .memoryTypeIndex = type});
        return vkAllocateMemory(gpu.device(), &info, nullptr, &memory);
    }
};

// Without the feature deviceCoherentMemory an application must not use such memory
// (VUID-vkAllocateMemory-deviceCoherentMemory-02790), so the layer must not either, even if it is local and visible.
TEST_F(MemoryTypes, UsesNoTypeThatNeedsAFeature)
{
    Gpu gpu(Options{.validation = false, .quirks = "uncached"});
    MicromapInput input;
    input.add(1, kFourState, std::vector<uint8_t>(4, 1));
    Micromap(gpu, input).build();
    expectNoMessages(gpu);
}

// A heap that is as large as the layer's tables at first, but smaller than what a pool of queries takes.
TEST_F(MemoryTypes, AllocatesNoMoreThanTheHeap)
{
    Gpu gpu(Options{.validation = false, .quirks = "window"});
    {
        const QueryPool pool(gpu, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR, 23u << 20);
    }
    expectNoMessages(gpu);
}

// Many devices have little memory that is local and visible, and applications need it. Data that only the GPU uses is
// in other memory.
TEST_F(MemoryTypes, KeepsTheWindowForTheApplication)
{
    Gpu gpu(Options{.validation = false, .quirks = "window"});
    constexpr VkDeviceSize kBytes = VkDeviceSize{64} << 20;
    const Buffer storage(gpu, kBytes, gpu.structureUsage());
    const Buffer data(gpu, 4096, VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = storage.handle(), .size = kBytes, .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    VT_CHECK(gpu.vk().CreateAccelerationStructureKHR(gpu.device(), &info, nullptr, &structure));
    VkCommandBuffer commands = gpu.begin();
    // The driver may write as many bytes as the size in the handle, to memory of the layer.
    auto copy = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>({.src = structure});
    copy.dst.deviceAddress = (data.address() + 255) & ~VkDeviceAddress{255};
    copy.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
    gpu.vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &copy);
    VkDeviceMemory memory = VK_NULL_HANDLE;
    EXPECT_EQ(allocate(gpu, type(gpu, kLocal | kVisible | kCoherent), VkDeviceSize{220} << 20, memory), VK_SUCCESS);
    vkFreeMemory(gpu.device(), memory, nullptr);
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
    gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
    expectNoMessages(gpu);
}

// A micromap on memory that is not coherent. The host commands read what the device has written, and the device what
// they have.
TEST_F(MemoryTypes, HostCommandsOnMemoryThatIsNotCoherent)
{
    Gpu gpu(Options{.quirks = "discrete", .api = Api::Ext});
    MicromapInput input;
    for (uint8_t i = 0; i < 7; ++i)
        input.add(3, kFourState, std::vector<uint8_t>(64, i % 4));
    Micromap built(gpu, input);
    built.build();
    auto bufferInfo = vkInit<VkBufferCreateInfo>(
        {.size = built.size() + 512,
         .usage = VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu.device(), &bufferInfo, nullptr, &buffer));
    VkMemoryRequirements requirements{};
    vkGetBufferMemoryRequirements(gpu.device(), buffer, &requirements);
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VT_CHECK(allocate(gpu, type(gpu, kVisible | VK_MEMORY_PROPERTY_HOST_CACHED_BIT), requirements.size, memory));
    VT_CHECK(vkBindBufferMemory(gpu.device(), buffer, memory, 0));
    auto info = vkInit<VkMicromapCreateInfoEXT>(
        {.buffer = buffer, .offset = 256, .size = built.size(), .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    VkMicromapEXT micromap = VK_NULL_HANDLE;
    VT_CHECK(gpu.vk().CreateMicromapEXT(gpu.device(), &info, nullptr, &micromap));
    const auto copyInfo = [](VkMicromapEXT from, VkMicromapEXT to) {
        return vkInit<VkCopyMicromapInfoEXT>({.src = from, .dst = to, .mode = VK_COPY_MICROMAP_MODE_CLONE_EXT});
    };
    // Built by the host, read by the device.
    VkMicromapBuildInfoEXT build = built.hostBuildInfo();
    build.dstMicromap = micromap;
    VT_CHECK(gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 1, &build));
    const Micromap copied(gpu, built, built.size());
    const VkCopyMicromapInfoEXT fromIt = copyInfo(micromap, copied.handle().ext);
    gpu.submit([&](VkCommandBuffer commands) { gpu.vk().CmdCopyMicromapEXT(commands, &fromIt); });
    EXPECT_TRUE(std::equal(built.memory(), built.memory() + 64, copied.memory()));
    // Written by the device, read by the host.
    MicromapInput small;
    small.add(1, kFourState, std::vector<uint8_t>(4, 2));
    Micromap other(gpu, small);
    other.build();
    const VkCopyMicromapInfoEXT toIt = copyInfo(other.handle().ext, micromap);
    gpu.submit([&](VkCommandBuffer commands) { gpu.vk().CmdCopyMicromapEXT(commands, &toIt); });
    VkDeviceSize sizes[2]{};
    const VkMicromapEXT queried[]{micromap, other.handle().ext};
    VT_CHECK(gpu.vk().WriteMicromapsPropertiesEXT(
        gpu.device(), 2, queried, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT, sizeof sizes, sizes, sizeof sizes[0]));
    EXPECT_EQ(sizes[0], sizes[1]);
    gpu.vk().DestroyMicromapEXT(gpu.device(), micromap, nullptr);
    vkDestroyBuffer(gpu.device(), buffer, nullptr);
    vkFreeMemory(gpu.device(), memory, nullptr);
    expectNoMessages(gpu);
}

} // namespace
