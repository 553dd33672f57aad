#include "harness/harness.h"

#include <algorithm>
#include <stdexcept>

namespace vt
{

Buffer::Buffer(Gpu &gpu, VkDeviceSize size, VkBufferUsageFlags usage) : gpu_(&gpu), size_(size)
{
    auto info = vkInit<VkBufferCreateInfo>({.size = size, .usage = usage});
    VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer_));

    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(gpu.device(), buffer_, &needs);
    const bool addressed = (usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0;
    auto flags = vkInit<VkMemoryAllocateFlagsInfo>({.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT});
    auto allocation = vkInit<VkMemoryAllocateInfo>(
        {.pNext = addressed ? &flags : nullptr,
         .allocationSize = needs.size,
         .memoryTypeIndex = gpu.memoryType(needs.memoryTypeBits, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
                                                                     VK_MEMORY_PROPERTY_HOST_COHERENT_BIT)});
    VT_CHECK(vkAllocateMemory(gpu.device(), &allocation, nullptr, &memory_));
    VT_CHECK(vkBindBufferMemory(gpu.device(), buffer_, memory_, 0));
    void *mapped = nullptr;
    VT_CHECK(vkMapMemory(gpu.device(), memory_, 0, VK_WHOLE_SIZE, 0, &mapped));
    bytes_ = static_cast<uint8_t *>(mapped);
    std::memset(bytes_, 0, static_cast<size_t>(size));
    if (addressed) {
        auto query = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer_});
        // Of the extension, where it is enabled: programs of Vulkan 1.1.
        const auto extension = vkGetDeviceProcAddr(gpu.device(), "vkGetBufferDeviceAddressKHR");
        const auto addressOf =
            extension != nullptr ? reinterpret_cast<PFN_vkGetBufferDeviceAddress>(extension) : vkGetBufferDeviceAddress;
        address_ = addressOf(gpu.device(), &query);
    }
}

Buffer::~Buffer()
{
    if (gpu_ == nullptr)
        return;
    vkDestroyBuffer(gpu_->device(), buffer_, nullptr);
    vkFreeMemory(gpu_->device(), memory_, nullptr);
}

void Buffer::swap(Buffer &other) noexcept
{
    std::swap(gpu_, other.gpu_);
    std::swap(buffer_, other.buffer_);
    std::swap(memory_, other.memory_);
    std::swap(size_, other.size_);
    std::swap(address_, other.address_);
    std::swap(bytes_, other.bytes_);
}

QueryPool::QueryPool(Gpu &gpu, VkQueryType type, uint32_t count) : gpu_(&gpu), type_(type)
{
    auto info = vkInit<VkQueryPoolCreateInfo>({.queryType = type, .queryCount = count});
    VT_CHECK(vkCreateQueryPool(gpu.device(), &info, nullptr, &pool_));
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
    VT_CHECK(vkGetQueryPoolResults(gpu_->device(), pool_, query, 1, sizeof value, &value, sizeof value,
                                   VK_QUERY_RESULT_64_BIT));
    return value;
}

uint32_t Gpu::memoryType(uint32_t allowed, VkMemoryPropertyFlags wanted) const
{
    VkPhysicalDeviceMemoryProperties memory;
    vkGetPhysicalDeviceMemoryProperties(physical_, &memory);
    for (uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
        if ((allowed >> i & 1u) != 0 && (memory.memoryTypes[i].propertyFlags & wanted) == wanted)
            return i;
    }
    throw std::runtime_error("no memory type");
}

VkBufferUsageFlags Gpu::structureUsage() const
{
    const bool emulated = options_.vellum && options_.micromaps && options_.micromapFeature;
    const bool strict = !emulated || validationOfTests() == Validation::Above;
    return VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
           (strict ? VkBufferUsageFlags{VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT} : 0);
}

} // namespace vt
