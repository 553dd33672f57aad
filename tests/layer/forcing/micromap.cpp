// SPDX-License-Identifier: Apache-2.0
#include "forcing/content.h"

#include <algorithm>
#include <cstring>

namespace forcing
{
namespace
{

constexpr VkDeviceSize kAlignment = 256;             // of micromaps, their data and scratch memory
constexpr VkDeviceSize kMostScratchAlignment = 4096; // minAccelerationStructureScratchOffsetAlignment of any driver
constexpr uint32_t kFirstIndices = 4096;

VkDeviceSize aligned(VkDeviceSize value, VkDeviceSize to)
{
    return (value + to - 1) / to * to;
}

} // namespace

ForcedMicromap::~ForcedMicromap()
{
    if (ext_ != VK_NULL_HANDLE)
        next_.DestroyMicromapEXT(device_, ext_, nullptr);
    if (khr_ != VK_NULL_HANDLE)
        next_.DestroyAccelerationStructureKHR(device_, khr_, nullptr);
    destroy(storage_);
    for (const std::vector<Indices> &all : indices_) {
        for (const Indices &indices : all)
            destroy(indices.buffer);
    }
}

// In host-visible memory; the handle is null if there is none.
Buffer ForcedMicromap::makeBuffer(VkDeviceSize size, VkBufferUsageFlags usage)
{
    Buffer buffer;
    auto info = vkInit<VkBufferCreateInfo>(
        {.size = size,
         .usage = usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
         .sharingMode = families_.size() > 1 ? VK_SHARING_MODE_CONCURRENT : VK_SHARING_MODE_EXCLUSIVE,
         .queueFamilyIndexCount = static_cast<uint32_t>(families_.size()),
         .pQueueFamilyIndices = families_.data()});
    if (next_.CreateBuffer(device_, &info, nullptr, &buffer.handle) != VK_SUCCESS)
        return {};
    VkMemoryRequirements needs{};
    next_.GetBufferMemoryRequirements(device_, buffer.handle, &needs);
    constexpr VkMemoryPropertyFlags kWanted =
        VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    auto flags = vkInit<VkMemoryAllocateFlagsInfo>({.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT});
    auto allocation = vkInit<VkMemoryAllocateInfo>({.pNext = &flags, .allocationSize = needs.size});
    for (uint32_t type = 0; type < memory_.memoryTypeCount && buffer.memory == VK_NULL_HANDLE; ++type) {
        allocation.memoryTypeIndex = type;
        if ((needs.memoryTypeBits >> type & 1) != 0 && (memory_.memoryTypes[type].propertyFlags & kWanted) == kWanted)
            next_.AllocateMemory(device_, &allocation, nullptr, &buffer.memory);
    }
    if (buffer.memory == VK_NULL_HANDLE ||
        next_.BindBufferMemory(device_, buffer.handle, buffer.memory, 0) != VK_SUCCESS ||
        next_.MapMemory(device_, buffer.memory, 0, VK_WHOLE_SIZE, 0, &buffer.bytes) != VK_SUCCESS) {
        destroy(buffer);
        return {};
    }
    const auto address = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer.handle});
    buffer.address = next_.GetBufferDeviceAddress(device_, &address);
    return buffer;
}

void ForcedMicromap::destroy(const Buffer &buffer)
{
    next_.DestroyBuffer(device_, buffer.handle, nullptr);
    next_.FreeMemory(device_, buffer.memory, nullptr);
}

Buffer ForcedMicromap::upload(std::span<const std::byte> bytes)
{
    const VkBufferUsageFlags usage = settings_.api == Api::Ext
                                         ? VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT
                                         : VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    Buffer buffer = makeBuffer(bytes.size() + kAlignment, usage);
    const VkDeviceSize offset = aligned(buffer.address, kAlignment) - buffer.address;
    if (buffer.handle != VK_NULL_HANDLE)
        std::memcpy(static_cast<std::byte *>(buffer.bytes) + offset, bytes.data(), bytes.size());
    buffer.address += offset;
    return buffer;
}

// Submits what `record` records, and waits.
template <class Record>
VkResult ForcedMicromap::run(const BuildQueue &queue, Record record)
{
    VkCommandPool pool = VK_NULL_HANDLE;
    const auto poolInfo = vkInit<VkCommandPoolCreateInfo>({.queueFamilyIndex = queue.family});
    VkResult result = next_.CreateCommandPool(device_, &poolInfo, nullptr, &pool);
    if (result != VK_SUCCESS)
        return result;
    VkCommandBuffer commands = VK_NULL_HANDLE;
    const auto allocation = vkInit<VkCommandBufferAllocateInfo>(
        {.commandPool = pool, .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY, .commandBufferCount = 1});
    result = next_.AllocateCommandBuffers(device_, &allocation, &commands);
    if (result == VK_SUCCESS)
        result = queue.setLoaderData(device_, commands);
    const auto begin = vkInit<VkCommandBufferBeginInfo>({.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT});
    if (result == VK_SUCCESS)
        result = next_.BeginCommandBuffer(commands, &begin);
    if (result == VK_SUCCESS) {
        record(commands);
        result = next_.EndCommandBuffer(commands);
    }
    auto submit = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
    if (result == VK_SUCCESS)
        result = next_.QueueSubmit(queue.handle, 1, &submit, VK_NULL_HANDLE);
    if (result == VK_SUCCESS)
        result = next_.QueueWaitIdle(queue.handle);
    next_.DestroyCommandPool(device_, pool, nullptr);
    return result;
}

VkResult ForcedMicromap::build(const BuildQueue &queue)
{
    return settings_.api == Api::Ext ? buildExt(queue) : buildKhr(queue);
}

VkResult ForcedMicromap::buildExt(const BuildQueue &queue)
{
    const MicromapContent &content = micromapContent();
    const Buffer data = upload(std::as_bytes(std::span(content.data)));
    const Buffer triangles = upload(std::as_bytes(std::span(content.triangles)));
    auto info = vkInit<VkMicromapBuildInfoEXT>({.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT,
                                                .mode = VK_BUILD_MICROMAP_MODE_BUILD_EXT,
                                                .usageCountsCount = static_cast<uint32_t>(content.usage.size()),
                                                .pUsageCounts = content.usage.data()});
    info.data.deviceAddress = data.address;
    info.triangleArray.deviceAddress = triangles.address;
    info.triangleArrayStride = sizeof(VkMicromapTriangleEXT);
    auto sizes = vkInit<VkMicromapBuildSizesInfoEXT>();
    next_.GetMicromapBuildSizesEXT(device_, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &sizes);
    storage_ = makeBuffer(sizes.micromapSize, VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT);
    const Buffer scratch =
        makeBuffer(sizes.buildScratchSize + kMostScratchAlignment, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    auto create = vkInit<VkMicromapCreateInfoEXT>(
        {.buffer = storage_.handle, .size = sizes.micromapSize, .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    VkResult result = next_.CreateMicromapEXT(device_, &create, nullptr, &ext_);
    info.dstMicromap = ext_;
    info.scratchData.deviceAddress = aligned(scratch.address, kMostScratchAlignment);
    if (result == VK_SUCCESS)
        result = run(queue, [&](VkCommandBuffer commands) { next_.CmdBuildMicromapsEXT(commands, 1, &info); });
    for (const Buffer &buffer : {data, triangles, scratch})
        destroy(buffer);
    return result;
}

VkResult ForcedMicromap::buildKhr(const BuildQueue &queue)
{
    const MicromapContent &content = micromapContent();
    const Buffer data = upload(std::as_bytes(std::span(content.data)));
    const Buffer triangles = upload(std::as_bytes(std::span(content.triangles)));
    std::vector<VkMicromapUsageKHR> usage;
    for (const VkMicromapUsageEXT &u : content.usage)
        usage.push_back({u.count, u.subdivisionLevel, static_cast<VkOpacityMicromapFormatKHR>(u.format)});
    auto source =
        vkInit<VkAccelerationStructureGeometryMicromapDataKHR>({.usageCountsCount = static_cast<uint32_t>(usage.size()),
                                                                .pUsageCounts = usage.data(),
                                                                .data = data.address,
                                                                .triangleArray = triangles.address,
                                                                .triangleArrayStride = sizeof(VkMicromapTriangleKHR)});
    auto geometry =
        vkInit<VkAccelerationStructureGeometryKHR>({.pNext = &source, .geometryType = VK_GEOMETRY_TYPE_MICROMAP_KHR});
    auto info = vkInit<VkAccelerationStructureBuildGeometryInfoKHR>(
        {.type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR,
         .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
         .geometryCount = 1,
         .pGeometries = &geometry});
    auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    next_.GetAccelerationStructureBuildSizesKHR(device_, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
                                                nullptr, &sizes);
    storage_ = makeBuffer(sizes.accelerationStructureSize + kAlignment,
                          VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
    const Buffer scratch =
        makeBuffer(sizes.buildScratchSize + kMostScratchAlignment, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    auto create = vkInit<VkAccelerationStructureCreateInfo2KHR>(
        {.addressRange = {aligned(storage_.address, kAlignment), sizes.accelerationStructureSize},
         .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
    VkResult result = next_.CreateAccelerationStructure2KHR(device_, &create, nullptr, &khr_);
    info.dstAccelerationStructure = khr_;
    info.scratchData.deviceAddress = aligned(scratch.address, kMostScratchAlignment);
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = nullptr; // a micromap has none
    if (result == VK_SUCCESS)
        result = run(queue, [&](VkCommandBuffer commands) {
            next_.CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
        });
    for (const Buffer &buffer : {data, triangles, scratch})
        destroy(buffer);
    return result;
}

VkDeviceAddress ForcedMicromap::indices(bool opaque, uint32_t triangles)
{
    std::lock_guard lock(mutex_);
    std::vector<Indices> &all = indices_[opaque];
    if (!all.empty() && all.back().triangles >= triangles)
        return all.back().buffer.address;
    const uint32_t count = std::max({triangles, kFirstIndices, all.empty() ? 0 : 2 * all.back().triangles});
    const Buffer buffer =
        makeBuffer(count * sizeof(int16_t), VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR);
    if (buffer.handle == VK_NULL_HANDLE)
        return 0;
    const std::span<const int16_t> pattern = indexPattern(settings_.content, opaque);
    for (uint32_t i = 0; i < count; ++i)
        static_cast<int16_t *>(buffer.bytes)[i] = pattern[i % pattern.size()];
    all.push_back({buffer, count});
    return buffer.address;
}

bool ForcedMicromap::attach(bool opaque, uint32_t triangles, const void *&chain, Attachment &attachment)
{
    const std::span<const int16_t> pattern = indexPattern(settings_.content, opaque);
    const VkDeviceAddress address = indices(opaque, triangles);
    if (address == 0)
        return false;
    bool hasData = false;
    for (uint32_t i = 0; i < pattern.size(); ++i) {
        if (pattern[i] < 0)
            continue;
        hasData = true;
        const auto size = static_cast<uint32_t>(pattern.size());
        const VkMicromapUsageEXT &usage = micromapContent().usage[static_cast<size_t>(pattern[i])];
        attachment.usage.push_back(
            {triangles / size + (i < triangles % size ? 1 : 0), usage.subdivisionLevel, usage.format});
    }
    auto &ext = attachment.ext;
    auto &khr = attachment.khr;
    ext = vkInit<VkAccelerationStructureTrianglesOpacityMicromapEXT>();
    khr = vkInit<VkAccelerationStructureTrianglesOpacityMicromapKHR>();
    ext.pNext = khr.pNext = const_cast<void *>(chain);
    ext.indexType = khr.indexType = VK_INDEX_TYPE_UINT16;
    ext.indexBuffer.deviceAddress = khr.indexBuffer = address;
    ext.indexStride = khr.indexStride = sizeof(int16_t);
    ext.usageCountsCount = static_cast<uint32_t>(attachment.usage.size());
    ext.pUsageCounts = attachment.usage.data();
    ext.micromap = hasData ? ext_ : VK_NULL_HANDLE;
    khr.micromap = hasData ? khr_ : VK_NULL_HANDLE;
    chain = settings_.api == Api::Ext ? static_cast<const void *>(&ext) : &khr;
    return true;
}

} // namespace forcing
