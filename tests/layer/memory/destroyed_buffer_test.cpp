// SPDX-License-Identifier: Apache-2.0
// Buffers in the memory of others, which the application destroys while commands and structures by address exist. The
// layer may have recorded them in place of those that the application means. The layers below report the use of a
// destroyed buffer; lavapipe crashes.
#include <atomic>
#include <cstdlib>
#include <thread>

#include "gpu/copies.h"
#include "gpu/scene.h"
#include "harness/decoys.h"
#include "harness/program/labels.h"
#include "harness/states.h"

namespace
{

using namespace vt;

const Labels kDestroyedBufferLabels{{"DestroyedBuffers.*", "translated"}, {"DestroyedBuffersByAddress.*", "one_api"}};

constexpr VkDeviceSize kAlignment = 256; // at least that of inputs, micromaps and scratch memory

// A buffer at whose address there is a decoy.
class Shadowed
{
public:
    Shadowed(Gpu &gpu, Decoys &decoys, VkDeviceSize size, VkBufferUsageFlags usage)
        : buffer_(gpu, size + kAlignment, usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT)
    {
        decoys.add(buffer_, usage);
        offset_ = (buffer_.address() + kAlignment - 1) / kAlignment * kAlignment - buffer_.address();
    }
    [[nodiscard]] VkBuffer handle() const { return buffer_.handle(); }
    [[nodiscard]] VkDeviceAddress begin() const { return buffer_.address(); }
    [[nodiscard]] VkDeviceSize offset() const { return offset_; } // of the first aligned byte
    [[nodiscard]] VkDeviceAddress address() const { return buffer_.address() + offset_; }
    [[nodiscard]] uint8_t *bytes() const { return buffer_.bytes() + offset_; }

private:
    Buffer buffer_;
    VkDeviceSize offset_ = 0;
};

class DestroyedBuffers : public GpuTest
{
protected:
    explicit DestroyedBuffers(const Options &options = {}) : GpuTest(options) {}

    static MicromapInput input()
    {
        Random random(5);
        MicromapInput input;
        for (const uint32_t level : {4u, 4u, 8u})
            input.add(level, kFourState, randomStates(random, level, kFourState));
        return input;
    }
    Shadowed upload(Decoys &decoys, const void *from, size_t bytes)
    {
        Shadowed buffer(gpu(), decoys, bytes, micromapInputUsage(gpu()));
        std::memcpy(buffer.bytes(), from, bytes);
        return buffer;
    }
    Shadowed scratch(Decoys &decoys, VkDeviceSize bytes)
    {
        return {gpu(), decoys, bytes, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT};
    }
    static std::vector<uint8_t> built(Micromap &micromap)
    {
        micromap.forget();
        micromap.build();
        return {micromap.memory(), micromap.memory() + micromap.size()};
    }
};

TEST_F(DestroyedBuffers, OfMicromapBuilds)
{
    for (const VkBuildMicromapFlagsEXT flags :
         {VkBuildMicromapFlagsEXT{0}, VkBuildMicromapFlagsEXT{VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT},
          VkBuildMicromapFlagsEXT{gpu().khr() ? kLossy : 0}}) {
        Micromap micromap(gpu(), input(), flags);
        const std::vector<uint8_t> expected = built(micromap);
        micromap.forget();
        Decoys decoys(gpu());
        const MicromapInput &in = micromap.input();
        VkMicromapBuildInfoEXT info = micromap.buildInfo();
        const Shadowed data = upload(decoys, in.data.data(), in.data.size());
        const Shadowed triangles = upload(decoys, in.triangles.data(), in.triangles.size() * sizeof in.triangles[0]);
        const Shadowed temporary = scratch(decoys, micromapSizes(gpu(), info).buildScratchSize);
        info.data.deviceAddress = data.address();
        info.triangleArray.deviceAddress = triangles.address();
        info.scratchData.deviceAddress = temporary.address();
        gpu().submit([&](VkCommandBuffer commands) {
            const MicromapBuild build{info, micromap.handle()};
            recordMicromapBuilds(gpu(), commands, std::span(&build, 1));
            decoys.destroy();
        });
        EXPECT_EQ(std::vector<uint8_t>(micromap.memory(), micromap.memory() + micromap.size()), expected) << flags;
    }
}

// The buffer of a micromap of VK_KHR_opacity_micromap is named by an address, too.
TEST_F(DestroyedBuffers, OfMicromaps)
{
    Micromap model(gpu(), input());
    const std::vector<uint8_t> expected = built(model);
    Decoys decoys(gpu());
    const Shadowed storage(gpu(), decoys, model.size(), micromapStorageUsage(gpu()));
    const MicromapHandle micromap =
        createMicromap(gpu(), storage.handle(), storage.begin(), storage.offset(), model.size());
    decoys.destroy();
    gpu().submit([&](VkCommandBuffer commands) {
        const MicromapBuild build{model.buildInfo(), micromap};
        recordMicromapBuilds(gpu(), commands, std::span(&build, 1));
    });
    EXPECT_EQ(std::vector<uint8_t>(storage.bytes(), storage.bytes() + model.size()), expected);
    destroyMicromap(gpu(), micromap);
}

class DestroyedBuffersByAddress : public DestroyedBuffers
{
protected:
    DestroyedBuffersByAddress() : DestroyedBuffers({.addressCommands = true}) {}

    void copy(VkCommandBuffer commands, VkDeviceAddress from, VkDeviceAddress to, VkDeviceSize bytes)
    {
        const auto region = vkInit<VkDeviceMemoryCopyKHR>(
            {.srcRange = {from, bytes}, .srcFlags = kUnknownUsage, .dstRange = {to, bytes}, .dstFlags = kUnknownUsage});
        const auto info = vkInit<VkCopyDeviceMemoryInfoKHR>({.regionCount = 1, .pRegions = &region});
        gpu().vk().CmdCopyMemoryKHR(commands, &info);
    }
    static constexpr VkBufferUsageFlags kCopied = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
};

TEST_F(DestroyedBuffersByAddress, OfStructures)
{
    const Patchwork patchwork(gpu());
    const Blas like(gpu(), patchwork.geometries());
    const auto expected = seenOf(gpu(), like);
    Decoys decoys(gpu());
    const Shadowed storage(gpu(), decoys, like.size(), gpu().structureUsage());
    auto create = vkInit<VkAccelerationStructureCreateInfo2KHR>(
        {.addressRange = {storage.address(), like.size()}, .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    VT_CHECK(gpu().vk().CreateAccelerationStructure2KHR(gpu().device(), &create, nullptr, &structure));
    decoys.destroy();
    auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = structure});
    VkAccelerationStructureInstanceKHR named = instance(like, {}, 77);
    named.accelerationStructureReference = gpu().vk().GetAccelerationStructureDeviceAddressKHR(gpu().device(), &query);
    gpu().submit([&](VkCommandBuffer commands) {
        const auto info = vkInit<VkCopyAccelerationStructureInfoKHR>(
            {.src = like.handle(), .dst = structure, .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR});
        gpu().vk().CmdCopyAccelerationStructureKHR(commands, &info);
    });
    EXPECT_EQ(seen(gpu(), Tlas(gpu(), {named}), Patchwork::rays()), expected);
    gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), structure, nullptr);
}

// An allocator is not called once the object is destroyed.
TEST_F(DestroyedBuffersByAddress, WithAllocationCallbacks)
{
    struct Memory {
        bool gone = false;
        long blocks = 0;
    } memory;
    // Stores the size before each block, for reallocation.
    VkAllocationCallbacks callbacks{};
    callbacks.pUserData = &memory;
    callbacks.pfnAllocation = [](void *user, size_t bytes, size_t alignment, VkSystemAllocationScope) -> void * {
        auto *own = static_cast<Memory *>(user);
        EXPECT_FALSE(own->gone);
        ++own->blocks;
        return ::operator new (bytes, std::align_val_t{std::max<size_t>(alignment, 64)});
    };
    callbacks.pfnReallocation = [](void *, void *, size_t, size_t, VkSystemAllocationScope) -> void * {
        return nullptr;
    };
    callbacks.pfnFree = [](void *user, void *block) {
        auto *own = static_cast<Memory *>(user);
        EXPECT_FALSE(own->gone);
        own->blocks -= block ? 1 : 0;
        ::operator delete (block, std::align_val_t{64});
    };
    const Buffer from(gpu(), 64, kCopied | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const Buffer to(gpu(), 64, kCopied | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    Decoys decoys(gpu());
    decoys.add(from, kCopied, &callbacks);
    std::memset(from.bytes(), 0x5a, 64);
    gpu().submit([&](VkCommandBuffer commands) {
        copy(commands, from.address(), to.address(), 64);
        decoys.destroy();
        memory.gone = true;
    });
    EXPECT_EQ(to.bytes()[63], 0x5a);
    EXPECT_EQ(memory.blocks, 0);
}

// The memory of a buffer may be freed before the buffer is destroyed, and then is the memory of others.
TEST_F(DestroyedBuffersByAddress, WhoseMemoryIsFreed)
{
    const auto make = [&](VkDeviceSize size) {
        auto info =
            vkInit<VkBufferCreateInfo>({.size = size, .usage = kCopied | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
        VkBuffer buffer = VK_NULL_HANDLE;
        VT_CHECK(vkCreateBuffer(gpu().device(), &info, nullptr, &buffer));
        return buffer;
    };
    constexpr VkDeviceSize kSize = 1 << 20, kOffset = 65536;
    VkBuffer whole = make(kSize);
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(gpu().device(), whole, &needs);
    const auto allocate = [&] {
        return gpu().allocate({needs.size, needs.alignment, needs.memoryTypeBits},
                              VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
    };
    // The buffer that is found first, since it begins nearest.
    const VkBuffer part = make(kSize - kOffset);
    VkMemoryRequirements partNeeds;
    vkGetBufferMemoryRequirements(gpu().device(), part, &partNeeds);
    ASSERT_EQ(kOffset % partNeeds.alignment, 0u);
    VkDeviceMemory memory = allocate();
    VT_CHECK(vkBindBufferMemory(gpu().device(), part, memory, kOffset));
    const VkDeviceAddress address = gpu().address(part);
    vkFreeMemory(gpu().device(), memory, nullptr);
    memory = allocate();
    VT_CHECK(vkBindBufferMemory(gpu().device(), whole, memory, 0));
    const bool same = gpu().address(whole) + kOffset == address;
    const Buffer to(gpu(), 64, kCopied | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    if (same) {
        void *mapped = nullptr;
        VT_CHECK(vkMapMemory(gpu().device(), memory, 0, VK_WHOLE_SIZE, 0, &mapped));
        std::memset(static_cast<uint8_t *>(mapped) + kOffset, 0x5a, 64);
        gpu().submit([&](VkCommandBuffer commands) { copy(commands, address, to.address(), 64); });
        EXPECT_EQ(to.bytes()[63], 0x5a);
    }
    vkDestroyBuffer(gpu().device(), part, nullptr);
    vkDestroyBuffer(gpu().device(), whole, nullptr);
    vkFreeMemory(gpu().device(), memory, nullptr);
    if (!same)
        GTEST_SKIP() << "new memory has another address";
}

// The application may free the memory of a buffer, destroy the buffer, and then the structure at its address. The
// driver's buffer lives as long as the structure, which the spy checks when the structure's address is queried.
TEST_F(DestroyedBuffersByAddress, WhoseMemoryIsFreedBeforeAStructure)
{
    auto info = vkInit<VkBufferCreateInfo>(
        {.size = 65536, .usage = gpu().structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu().device(), &info, nullptr, &buffer));
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(gpu().device(), buffer, &needs);
    VkDeviceMemory memory = gpu().allocate({needs.size, needs.alignment, needs.memoryTypeBits}, 0);
    VT_CHECK(vkBindBufferMemory(gpu().device(), buffer, memory, 0));
    auto create = vkInit<VkAccelerationStructureCreateInfo2KHR>(
        {.addressRange = {gpu().address(buffer), 4096}, .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    VT_CHECK(gpu().vk().CreateAccelerationStructure2KHR(gpu().device(), &create, nullptr, &structure));
    vkFreeMemory(gpu().device(), memory, nullptr);
    vkDestroyBuffer(gpu().device(), buffer, nullptr);
    auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = structure});
    EXPECT_NE(gpu().vk().GetAccelerationStructureDeviceAddressKHR(gpu().device(), &query), 0u);
    for (const Message &m : gpu().takeUnexpectedMessages())
        EXPECT_EQ(m.id, "VUID-vkGetAccelerationStructureDeviceAddressKHR-pInfo-09541");
    gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), structure, nullptr);
}

// One thread creates and destroys aliases while another records and submits.
TEST_F(DestroyedBuffersByAddress, WhileCommandsAreRecorded)
{
    const Buffer from(gpu(), 64, kCopied | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const Buffer to(gpu(), 64, kCopied | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    std::memset(from.bytes(), 0x5a, 64);
    std::atomic<bool> end = false;
    std::thread thread([&] {
        Decoys decoys(gpu());
        for (int i = 0; i < 500; ++i) {
            decoys.add(from, kCopied);
            decoys.add(to, kCopied);
            std::this_thread::yield();
            decoys.destroy();
        }
        end = true;
    });
    while (!end) {
        std::memset(to.bytes(), 0, 64);
        gpu().submit([&](VkCommandBuffer commands) {
            for (int i = 0; i < 20; ++i) // several of them find an alias
                copy(commands, from.address(), to.address(), 64);
        });
        EXPECT_EQ(to.bytes()[63], 0x5a);
    }
    thread.join();
}

} // namespace
