// SPDX-License-Identifier: Apache-2.0
#include "layer/memory/gpu_memory.h"

#include <cstring>
#include <span>
#include <utility>
#include <vector>

namespace vellum::layer
{
namespace
{

constexpr VkBufferUsageFlags kUsage = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;

constexpr VkMemoryPropertyFlags kLocal = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
constexpr VkMemoryPropertyFlags kHost = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
// Properties of types that need a feature (VUID-vkAllocateMemory-deviceCoherentMemory-02790) or are for images.
constexpr VkMemoryPropertyFlags kSpecial = VK_MEMORY_PROPERTY_DEVICE_COHERENT_BIT_AMD |
                                           VK_MEMORY_PROPERTY_DEVICE_UNCACHED_BIT_AMD |
                                           VK_MEMORY_PROPERTY_PROTECTED_BIT | VK_MEMORY_PROPERTY_LAZILY_ALLOCATED_BIT;

// The types that a buffer's memory may have, the better ones first. Device-local memory is preferred, since shaders
// read these buffers at every hit. A device may have little memory that is also host-visible, which is left to the
// application: buffers that are not mapped prefer types that are not host-visible.
std::vector<uint32_t> memoryTypes(const VkPhysicalDeviceMemoryProperties &memory, uint32_t allowed, VkDeviceSize bytes,
                                  bool hostSees)
{
    struct Wish {
        VkMemoryPropertyFlags mask, flags;
    };
    static constexpr Wish kSeen[] = {{kLocal | kHost, kLocal | kHost}, {kLocal | kHost, kHost}};
    static constexpr Wish kUnseen[] = {{kLocal | VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT, kLocal},
                                       {kLocal | kHost, kLocal | kHost},
                                       {kLocal | kHost, kHost}};
    std::vector<uint32_t> types;
    for (const Wish &wish : hostSees ? std::span<const Wish>(kSeen) : std::span<const Wish>(kUnseen)) {
        for (uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
            const VkMemoryType &type = memory.memoryTypes[i];
            // VUID-vkAllocateMemory-pAllocateInfo-01713
            const bool fits = bytes <= memory.memoryHeaps[type.heapIndex].size;
            if ((allowed & (1u << i)) != 0 && fits && (type.propertyFlags & kSpecial) == 0 &&
                (type.propertyFlags & wish.mask) == wish.flags)
                types.push_back(i);
        }
    }
    return types;
}

void share(VkBufferCreateInfo &info, const GpuContext &context)
{
    if (!context.queueFamilies || context.queueFamilies->size() < 2) // VUID-VkBufferCreateInfo-sharingMode-00914
        return;
    info.sharingMode = VK_SHARING_MODE_CONCURRENT;
    info.queueFamilyIndexCount = static_cast<uint32_t>(context.queueFamilies->size());
    info.pQueueFamilyIndices = context.queueFamilies->data();
}

} // namespace

GpuBuffer &GpuBuffer::operator=(GpuBuffer &&other) noexcept
{
    if (this != &other) {
        reset();
        context_ = other.context_;
        buffer_ = std::exchange(other.buffer_, VK_NULL_HANDLE);
        memory_ = std::exchange(other.memory_, VK_NULL_HANDLE);
        address_ = std::exchange(other.address_, 0);
        mapped_ = std::exchange(other.mapped_, nullptr);
    }
    return *this;
}

VkResult GpuBuffer::create(const GpuContext &context, VkDeviceSize bytes, VkBufferUsageFlags extraUsage,
                           Content content)
{
    return make(context, bytes, extraUsage, content, nullptr);
}

VkResult GpuBuffer::createAgain(const GpuContext &context, VkDeviceSize bytes, ReplayAddress &address)
{
    VkResult result = make(context, bytes, 0, Content::Zero, &address);
    if (result != VK_SUCCESS && address != ReplayAddress{}) {
        address = {};
        result = make(context, bytes, 0, Content::Zero, &address);
    }
    if (result != VK_SUCCESS)
        return result;
    const VkBufferDeviceAddressInfo bufferInfo{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, nullptr, buffer_};
    const VkDeviceMemoryOpaqueCaptureAddressInfo memoryInfo{VK_STRUCTURE_TYPE_DEVICE_MEMORY_OPAQUE_CAPTURE_ADDRESS_INFO,
                                                            nullptr, memory_};
    address = {context.next->GetBufferOpaqueCaptureAddress(context.device, &bufferInfo),
               context.next->GetDeviceMemoryOpaqueCaptureAddress(context.device, &memoryInfo)};
    return VK_SUCCESS;
}

VkResult GpuBuffer::make(const GpuContext &context, VkDeviceSize bytes, VkBufferUsageFlags extraUsage, Content content,
                         ReplayAddress *replay)
{
    reset();
    context_ = context;
    const DeviceTable &next = *context.next;
    VkBufferCreateInfo bufferInfo{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    bufferInfo.size = bytes;
    bufferInfo.usage = kUsage | extraUsage;
    VkBufferOpaqueCaptureAddressCreateInfo bufferAddress{VK_STRUCTURE_TYPE_BUFFER_OPAQUE_CAPTURE_ADDRESS_CREATE_INFO};
    if (replay) {
        bufferInfo.flags = VK_BUFFER_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT;
        bufferInfo.pNext = &bufferAddress;
        bufferAddress.opaqueCaptureAddress = replay->buffer;
    }
    share(bufferInfo, context);
    VkResult result = next.CreateBuffer(context.device, &bufferInfo, nullptr, &buffer_);
    if (result != VK_SUCCESS) {
        buffer_ = VK_NULL_HANDLE;
        return result;
    }

    VkMemoryRequirements requirements{};
    next.GetBufferMemoryRequirements(context.device, buffer_, &requirements);
    VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
    flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    VkMemoryOpaqueCaptureAddressAllocateInfo memoryAddress{
        VK_STRUCTURE_TYPE_MEMORY_OPAQUE_CAPTURE_ADDRESS_ALLOCATE_INFO};
    if (replay) {
        // VUID-vkBindBufferMemory-bufferDeviceAddressCaptureReplay-09200
        flags.flags |= VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT;
        flags.pNext = &memoryAddress;
        memoryAddress.opaqueCaptureAddress = replay->memory;
    }
    VkMemoryAllocateInfo allocateInfo{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &flags, requirements.size, 0};
    result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
    const bool hostSees = content != Content::DevicesOnly;
    for (const uint32_t type : memoryTypes(context.memory, requirements.memoryTypeBits, requirements.size, hostSees)) {
        allocateInfo.memoryTypeIndex = type;
        result = next.AllocateMemory(context.device, &allocateInfo, nullptr, &memory_);
        // Another type may belong to another heap, with free memory.
        if (result != VK_ERROR_OUT_OF_DEVICE_MEMORY)
            break;
    }
    if (result != VK_SUCCESS)
        memory_ = VK_NULL_HANDLE; // undefined after a failure, as is buffer_
    void *mapped = nullptr;
    if (result == VK_SUCCESS)
        result = next.BindBufferMemory(context.device, buffer_, memory_, 0);
    if (result == VK_SUCCESS && hostSees)
        result = next.MapMemory(context.device, memory_, 0, VK_WHOLE_SIZE, 0, &mapped);
    if (result != VK_SUCCESS) {
        reset();
        return result;
    }
    mapped_ = static_cast<uint32_t *>(mapped);
    if (content == Content::Zero)
        std::memset(mapped_, 0, bytes);
    const VkBufferDeviceAddressInfo addressInfo{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, nullptr, buffer_};
    address_ = next.GetBufferDeviceAddress(context.device, &addressInfo);
    return VK_SUCCESS;
}

VkResult GpuBuffer::createOn(const GpuContext &context, void *memory, VkDeviceSize bytes, VkBufferUsageFlags extraUsage)
{
    reset();
    context_ = context;
    const VkResult result =
        context.importsHostMemory ? makeOn(memory, bytes, extraUsage) : VK_ERROR_FEATURE_NOT_PRESENT;
    if (result != VK_SUCCESS)
        reset();
    return result;
}

VkResult GpuBuffer::makeOn(void *memory, VkDeviceSize bytes, VkBufferUsageFlags extraUsage)
{
    constexpr VkExternalMemoryHandleTypeFlagBits kPointer = VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT;
    const DeviceTable &next = *context_.next;
    const VkExternalMemoryBufferCreateInfo external{VK_STRUCTURE_TYPE_EXTERNAL_MEMORY_BUFFER_CREATE_INFO, nullptr,
                                                    kPointer};
    VkBufferCreateInfo bufferInfo{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, &external};
    bufferInfo.size = bytes;
    bufferInfo.usage = kUsage | extraUsage;
    share(bufferInfo, context_);
    VkResult result = next.CreateBuffer(context_.device, &bufferInfo, nullptr, &buffer_);
    if (result != VK_SUCCESS) {
        buffer_ = VK_NULL_HANDLE;
        return result;
    }
    VkMemoryRequirements requirements{};
    next.GetBufferMemoryRequirements(context_.device, buffer_, &requirements);
    VkMemoryHostPointerPropertiesEXT host{VK_STRUCTURE_TYPE_MEMORY_HOST_POINTER_PROPERTIES_EXT};
    result = next.GetMemoryHostPointerPropertiesEXT(context_.device, kPointer, memory, &host);
    if (result != VK_SUCCESS)
        return result;
    const std::vector<uint32_t> types =
        memoryTypes(context_.memory, requirements.memoryTypeBits & host.memoryTypeBits, bytes, true);
    if (types.empty() || requirements.size > bytes)
        return VK_ERROR_INVALID_EXTERNAL_HANDLE;
    const VkImportMemoryHostPointerInfoEXT import{VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT, nullptr,
                                                  kPointer, memory};
    const VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO, &import,
                                          VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT, 0};
    const VkMemoryAllocateInfo allocateInfo{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &flags, bytes, types.front()};
    result = next.AllocateMemory(context_.device, &allocateInfo, nullptr, &memory_);
    if (result != VK_SUCCESS)
        memory_ = VK_NULL_HANDLE;
    else
        result = next.BindBufferMemory(context_.device, buffer_, memory_, 0);
    if (result != VK_SUCCESS)
        return result;
    const VkBufferDeviceAddressInfo addressInfo{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, nullptr, buffer_};
    address_ = next.GetBufferDeviceAddress(context_.device, &addressInfo);
    mapped_ = static_cast<uint32_t *>(memory);
    return address_ == reinterpret_cast<uintptr_t>(memory) ? VK_SUCCESS : VK_ERROR_INVALID_EXTERNAL_HANDLE;
}

void GpuBuffer::reset()
{
    if (buffer_)
        context_.next->DestroyBuffer(context_.device, buffer_, nullptr);
    if (memory_)
        context_.next->FreeMemory(context_.device, memory_, nullptr);
    buffer_ = VK_NULL_HANDLE;
    memory_ = VK_NULL_HANDLE;
    address_ = 0;
    mapped_ = nullptr;
}

} // namespace vellum::layer
