// SPDX-License-Identifier: Apache-2.0
// Shared by the programs.
#pragma once

#include "programs.h"

namespace vt
{

using ExtAttached = VkAccelerationStructureTrianglesOpacityMicromapEXT;
using KhrAttached = VkAccelerationStructureTrianglesOpacityMicromapKHR;

// Records commands, and executes them if they are right: a driver may do anything with wrong ones.
template <typename Record>
void recordUnlessWrong(Gpu &gpu, bool wrong, Record record)
{
    const VkCommandBuffer commands = gpu.begin();
    record(commands);
    gpu.end(commands);
    if (!wrong)
        gpu.execute(commands);
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
}

// One triangle of level 2.
inline MicromapInput oneTriangle()
{
    MicromapInput input;
    input.add(2, kFourState, std::vector<uint8_t>(16, 1));
    return input;
}

// Memory for micromaps, and handles to it. A micromap that is built there can be read by each of the handles, so that a
// driver does no harm where a program uses one that was never built.
class SharedMemory
{
public:
    explicit SharedMemory(Gpu &gpu, VkDeviceSize size = 65536)
        : gpu_(gpu), memory_(gpu, size, 256, micromapStorageUsage(gpu))
    {
    }
    SharedMemory(const SharedMemory &) = delete;
    SharedMemory &operator=(const SharedMemory &) = delete;
    ~SharedMemory()
    {
        for (const MicromapHandle &handle : handles_)
            destroyMicromap(gpu_, handle);
    }
    MicromapHandle create(VkDeviceSize offset, VkDeviceSize size,
                          VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
    {
        handles_.push_back(createMicromap(gpu_, memory_.buffer(), memory_.address() - memory_.offset(),
                                          memory_.offset() + offset, size, type));
        return handles_.back();
    }
    // Destroys a handle before the others.
    void destroy(MicromapHandle handle)
    {
        std::erase_if(handles_, [&](const MicromapHandle &h) { return h.object() == handle.object(); });
        destroyMicromap(gpu_, handle);
    }
    [[nodiscard]] VkDeviceAddress address() const { return memory_.address(); }

private:
    Gpu &gpu_;
    Guarded memory_;
    std::vector<MicromapHandle> handles_;
};

// A handle to the memory of a micromap that was built by another one.
struct Twins {
    explicit Twins(Gpu &gpu, VkBuildMicromapFlagsEXT flags = 0)
        : source(gpu, oneTriangle(), flags), memory(gpu), built(memory.create(0, source.size())),
          other(memory.create(0, source.size()))
    {
        gpu.submit([&](VkCommandBuffer commands) {
            recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{source.buildInfo(), built}});
        });
    }
    Micromap source;
    SharedMemory memory;
    MicromapHandle built;
    MicromapHandle other; // never built
};

// A buffer for micromaps and structures, without memory; the right one has memory.
class PerhapsUnbound
{
public:
    PerhapsUnbound(Gpu &gpu, bool wrong) : gpu_(gpu)
    {
        auto info = vkInit<VkBufferCreateInfo>({.size = 65536, .usage = micromapStorageUsage(gpu)});
        VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer_));
        if (!wrong)
            memory_ = gpu.bindMemory(buffer_, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT);
        if (gpu.khr()) {
            const auto creation = vkInit<VkAccelerationStructureCreateInfoKHR>(
                {.buffer = buffer_, .size = 32768, .type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR});
            VT_CHECK(gpu.vk().CreateAccelerationStructureKHR(gpu.device(), &creation, nullptr, &object.khr));
        } else {
            object = createMicromap(gpu, buffer_, 0, 0, 32768);
        }
    }
    PerhapsUnbound(const PerhapsUnbound &) = delete;
    PerhapsUnbound &operator=(const PerhapsUnbound &) = delete;
    ~PerhapsUnbound()
    {
        destroyMicromap(gpu_, object);
        vkDestroyBuffer(gpu_.device(), buffer_, nullptr);
        vkFreeMemory(gpu_.device(), memory_, nullptr);
    }
    MicromapHandle object; // a micromap, or with VK_KHR_opacity_micromap a GENERIC structure

private:
    Gpu &gpu_;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
};

// A build of a structure, which can be changed. Indirect builds read the ranges from a buffer.
enum class By { Host, Indirect };
struct Build {
    Build(Gpu &g, const Structure &structure, By b = By::Host)
        : gpu(g), by(b), info(structure.buildInfo()), geometry(info.pGeometries[0]), ranges(structure.ranges()),
          memory(g, sizeof *ranges, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT)
    {
        info.pGeometries = &geometry;
        info.geometryCount = 1;
        std::memcpy(memory.bytes(), ranges, sizeof *ranges);
    }
    void record(VkCommandBuffer commands) const { record(commands, by); }
    void record(VkCommandBuffer commands, By command) const
    {
        const VkDeviceAddress address = memory.address();
        const uint32_t stride = sizeof *ranges;
        const uint32_t *most = &ranges->primitiveCount;
        if (command == By::Host)
            gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
        else
            gpu.vk().CmdBuildAccelerationStructuresIndirectKHR(commands, 1, &info, &address, &stride, &most);
    }
    Gpu &gpu;
    By by;
    VkAccelerationStructureBuildGeometryInfoKHR info;
    VkAccelerationStructureGeometryKHR geometry;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges;
    Buffer memory;
};

// A buffer, which can be destroyed before its memory, and memory, which can be freed before the buffer.
class Storage
{
public:
    explicit Storage(Gpu &gpu, VkBufferUsageFlags usage = 0) : gpu_(gpu)
    {
        const auto info = vkInit<VkBufferCreateInfo>(
            {.size = 65536,
             .usage = usage | micromapStorageUsage(gpu) | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                      VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
        VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer_));
        memory_ = gpu.bindMemory(buffer_, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT);
        const auto addressInfo = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer_});
        address_ = vkGetBufferDeviceAddress(gpu.device(), &addressInfo);
    }
    Storage(const Storage &) = delete;
    Storage &operator=(const Storage &) = delete;
    ~Storage()
    {
        destroyBuffer();
        freeMemory();
    }
    void destroyBuffer() { vkDestroyBuffer(gpu_.device(), std::exchange(buffer_, VK_NULL_HANDLE), nullptr); }
    void freeMemory() { vkFreeMemory(gpu_.device(), std::exchange(memory_, VK_NULL_HANDLE), nullptr); }
    [[nodiscard]] VkBuffer buffer() const { return buffer_; }
    [[nodiscard]] VkDeviceAddress address() const { return address_; }

private:
    Gpu &gpu_;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkDeviceAddress address_ = 0;
};

} // namespace vt
