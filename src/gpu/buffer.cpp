// SPDX-License-Identifier: Apache-2.0
#include "gpu/device.h"

#include <algorithm>
#include <stdexcept>

namespace vellum::gpu
{

Buffer::Buffer(Device &gpu, VkDeviceSize size, VkBufferUsageFlags usage, Place place) : gpu_(&gpu), size_(size)
{
    auto info = vkInit<VkBufferCreateInfo>({.size = size, .usage = usage});
    CHECK_VK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer_));

    const bool addressed = (usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0;
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(gpu.device(), buffer_, &needs);
    // Offsets of structures in their buffers are multiples of 256, and so are addresses of micromaps
    // (VUID-VkAccelerationStructureCreateInfoKHR-offset-03734).
    needs.alignment = std::max<VkDeviceSize>(needs.alignment, 256);
    if (place == Place::Device) {
        piece_ = gpu.deviceMemory().allocate(
            needs, gpu.memoryType(needs.memoryTypeBits, 0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT));
        CHECK_VK(vkBindBufferMemory(gpu.device(), buffer_, piece_.memory, piece_.offset));
    } else {
        begin_ = needs.alignment;
        needs.size += begin_;
        memory_ =
            gpu.allocate(needs, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT, addressed);
        const auto bind =
            vkInit<VkBindBufferMemoryInfo>({.buffer = buffer_, .memory = memory_, .memoryOffset = begin_});
        CHECK_VK(vkBindBufferMemory2(gpu.device(), 1, &bind));
        void *mapped = nullptr;
        CHECK_VK(vkMapMemory(gpu.device(), memory_, begin_, size, 0, &mapped));
        bytes_ = static_cast<uint8_t *>(mapped);
        std::memset(bytes_, 0, static_cast<size_t>(size));
    }
    if (addressed)
        address_ = gpu.address(buffer_);
}

Buffer::Buffer(Device &gpu, const Buffer &other, VkDeviceSize offset, VkDeviceSize size, VkBufferUsageFlags usage)
    : gpu_(&gpu), size_(size)
{
    const auto info = vkInit<VkBufferCreateInfo>({.size = size, .usage = usage});
    CHECK_VK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer_));
    VkMemoryRequirements needs, others; // others: what its memory was allocated by
    vkGetBufferMemoryRequirements(gpu.device(), buffer_, &needs);
    vkGetBufferMemoryRequirements(gpu.device(), other.handle(), &others);
    const VkDeviceSize begin = (other.begin_ + offset) / needs.alignment * needs.alignment;
    // VUID-vkBindBufferMemory-size-01037, -memory-01035
    if (begin + needs.size > other.begin_ + others.size || (others.memoryTypeBits & ~needs.memoryTypeBits) != 0) {
        *this = Buffer();
        return;
    }
    CHECK_VK(vkBindBufferMemory(gpu.device(), buffer_, other.memory(), begin));
    if ((usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0)
        address_ = gpu.address(buffer_);
}

Buffer::~Buffer()
{
    if (gpu_ == nullptr)
        return;
    vkDestroyBuffer(gpu_->device(), buffer_, nullptr);
    vkFreeMemory(gpu_->device(), memory_, nullptr);
    gpu_->deviceMemory().free(piece_);
}

// Delegates, so that the destructor also runs where this throws.
DeviceImage::DeviceImage(Device &gpu, const VkImageCreateInfo &info) : DeviceImage(gpu)
{
    CHECK_VK(vkCreateImage(gpu.device(), &info, nullptr, &image_));
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(gpu.device(), image_, &needs);
    memory_ = gpu.allocate(needs, 0, false);
    CHECK_VK(vkBindImageMemory(gpu.device(), image_, memory_, 0));
}

DeviceImage::~DeviceImage()
{
    vkDestroyImage(gpu_.device(), image_, nullptr);
    vkFreeMemory(gpu_.device(), memory_, nullptr);
}

void Buffer::swap(Buffer &other) noexcept
{
    std::swap(gpu_, other.gpu_);
    std::swap(buffer_, other.buffer_);
    std::swap(memory_, other.memory_);
    std::swap(begin_, other.begin_);
    std::swap(piece_, other.piece_);
    std::swap(size_, other.size_);
    std::swap(address_, other.address_);
    std::swap(bytes_, other.bytes_);
}

void Buffer::write(VkDeviceSize offset, const void *content, size_t size)
{
    if (size == 0)
        return;
    if (bytes_ != nullptr) {
        std::memcpy(bytes_ + offset, content, size);
        return;
    }
    const Buffer staging(*gpu_, size, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    std::memcpy(staging.bytes(), content, size);
    gpu_->submit([&](VkCommandBuffer commands) {
        const VkBufferCopy region{0, offset, size};
        vkCmdCopyBuffer(commands, staging.handle(), buffer_, 1, &region);
        barrier(commands);
    });
}

std::vector<uint32_t> Buffer::words(size_t count) const
{
    std::vector<uint32_t> result(count);
    if (bytes_ != nullptr) {
        std::memcpy(result.data(), bytes_, count * sizeof(uint32_t));
        return result;
    }
    const Buffer staging(*gpu_, count * sizeof(uint32_t), VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    gpu_->submit([&](VkCommandBuffer commands) {
        const VkBufferCopy region{0, 0, staging.size()};
        vkCmdCopyBuffer(commands, buffer_, staging.handle(), 1, &region);
        barrier(commands);
    });
    return staging.words(count);
}

Buffer Device::upload(const void *content, size_t size, VkBufferUsageFlags usage)
{
    const bool local = options_.memory == Memory::DeviceLocal;
    Buffer buffer(*this, std::max<VkDeviceSize>(size, 16),
                  usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                      (local ? VkBufferUsageFlags{VK_BUFFER_USAGE_TRANSFER_DST_BIT} : 0),
                  local ? Buffer::Place::Device : Buffer::Place::Host);
    buffer.write(0, content, size);
    return buffer;
}

QueryPool::QueryPool(Device &gpu, VkQueryType type, uint32_t count) : gpu_(&gpu), type_(type)
{
    auto info = vkInit<VkQueryPoolCreateInfo>({.queryType = type, .queryCount = count});
    CHECK_VK(vkCreateQueryPool(gpu.device(), &info, nullptr, &pool_));
}

QueryPool::~QueryPool()
{
    if (gpu_ != nullptr)
        vkDestroyQueryPool(gpu_->device(), pool_, nullptr);
}

void QueryPool::swap(QueryPool &other) noexcept
{
    std::swap(gpu_, other.gpu_);
    std::swap(type_, other.type_);
    std::swap(pool_, other.pool_);
}

uint64_t QueryPool::value(uint32_t query) const
{
    uint64_t value = 0;
    CHECK_VK(vkGetQueryPoolResults(gpu_->device(), pool_, query, 1, sizeof value, &value, sizeof value,
                                   VK_QUERY_RESULT_64_BIT));
    return value;
}

uint32_t Device::memoryType(uint32_t allowed, VkMemoryPropertyFlags wanted, VkMemoryPropertyFlags preferred) const
{
    VkPhysicalDeviceMemoryProperties memory;
    vkGetPhysicalDeviceMemoryProperties(physical_, &memory);
    for (const VkMemoryPropertyFlags flags : {wanted | preferred, wanted}) {
        for (uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
            if ((allowed >> i & 1u) != 0 && (memory.memoryTypes[i].propertyFlags & flags) == flags)
                return i;
        }
    }
    throw std::runtime_error("the device has no memory of the needed type");
}

VkDeviceMemory Device::allocate(const VkMemoryRequirements &needs, VkMemoryPropertyFlags wanted, bool addressed) const
{
    const auto flags = vkInit<VkMemoryAllocateFlagsInfo>({.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT});
    // The host reads what is not cached very slowly.
    const VkMemoryPropertyFlags preferred =
        (wanted & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) != 0 ? VK_MEMORY_PROPERTY_HOST_CACHED_BIT : 0;
    const auto info =
        vkInit<VkMemoryAllocateInfo>({.pNext = addressed ? &flags : nullptr,
                                      .allocationSize = needs.size,
                                      .memoryTypeIndex = memoryType(needs.memoryTypeBits, wanted, preferred)});
    VkDeviceMemory memory = VK_NULL_HANDLE;
    CHECK_VK(vkAllocateMemory(device_, &info, nullptr, &memory));
    return memory;
}

VkDeviceMemory Device::bindMemory(VkBuffer buffer, VkMemoryPropertyFlags wanted, bool addressed) const
{
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device_, buffer, &needs);
    const VkDeviceMemory memory = allocate(needs, wanted, addressed);
    CHECK_VK(vkBindBufferMemory(device_, buffer, memory, 0));
    return memory;
}

VkDeviceAddress Device::address(VkBuffer buffer) const
{
    const auto info = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer});
    // The command of the extension where that is enabled: Vulkan 1.1 has no other.
    const auto extension = vkGetDeviceProcAddr(device_, "vkGetBufferDeviceAddressKHR");
    return extension != nullptr ? reinterpret_cast<PFN_vkGetBufferDeviceAddress>(extension)(device_, &info)
                                : vkGetBufferDeviceAddress(device_, &info);
}

VkBufferUsageFlags Device::structureUsage() const
{
    return VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
           (options_.addressedStructures ? VkBufferUsageFlags{VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT} : 0);
}

} // namespace vellum::gpu
