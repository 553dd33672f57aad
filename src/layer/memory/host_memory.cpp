#include "layer/memory/host_memory.h"

#include "layer/door/device.h"
#include "layer/memory/buffers.h"

namespace vellum::layer
{

void HostMemory::allocated(VkDeviceMemory memory, VkDeviceSize bytes, VkMemoryPropertyFlags properties)
{
    std::lock_guard lock(mutex_);
    memories_[memory] = {.properties = properties, .bytes = bytes};
}

void HostMemory::freed(VkDeviceMemory memory)
{
    std::lock_guard lock(mutex_);
    memories_.erase(memory);
}

void HostMemory::bound(VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset)
{
    std::lock_guard lock(mutex_);
    bindings_[buffer] = {memory, offset};
}

void HostMemory::destroyed(VkBuffer buffer)
{
    std::lock_guard lock(mutex_);
    bindings_.erase(buffer);
}

VkResult HostMemory::open(const Device &device, Memory &memory, VkDeviceMemory handle, VkMemoryMapFlags flags)
{
    if (memory.users == 0) {
        void *mapped = nullptr;
        const VkResult result = device.next.MapMemory(device.handle, handle, 0, VK_WHOLE_SIZE, flags, &mapped);
        if (result != VK_SUCCESS)
            return result;
        memory.mapped = static_cast<uint8_t *>(mapped);
        memory.first = 0;
        memory.last = memory.bytes;
    }
    ++memory.users;
    return VK_SUCCESS;
}

void HostMemory::close(const Device &device, Memory &memory, VkDeviceMemory handle)
{
    if (memory.users == 0 || --memory.users > 0)
        return;
    memory.mapped = nullptr;
    device.next.UnmapMemory(device.handle, handle);
}

VkResult HostMemory::map(const Device &device, VkDeviceMemory handle, VkDeviceSize offset, VkMemoryMapFlags flags,
                         void **data)
{
    std::lock_guard lock(mutex_);
    Memory &memory = memories_[handle];
    const VkResult result = open(device, memory, handle, flags);
    if (result == VK_SUCCESS)
        *data = memory.mapped + offset;
    return result;
}

void HostMemory::unmap(const Device &device, VkDeviceMemory handle)
{
    std::lock_guard lock(mutex_);
    close(device, memories_[handle], handle);
}

void HostMemory::mappedByDriver(VkDeviceMemory handle, VkDeviceSize offset, VkDeviceSize bytes, void *data)
{
    std::lock_guard lock(mutex_);
    Memory &memory = memories_[handle];
    memory.mapped = static_cast<uint8_t *>(data) - offset;
    memory.first = offset;
    memory.last = bytes == VK_WHOLE_SIZE ? memory.bytes : offset + bytes;
    memory.users = 1;
}

void HostMemory::unmappedByDriver(VkDeviceMemory handle)
{
    std::lock_guard lock(mutex_);
    Memory &memory = memories_[handle];
    memory.mapped = nullptr;
    memory.users = 0;
}

HostView::HostView(Device &device, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize bytes) : device_(device)
{
    HostMemory &host = device.hostMemory;
    std::lock_guard lock(host.mutex_);
    const auto binding = host.bindings_.find(buffer);
    if (binding == host.bindings_.end())
        return;
    HostMemory::Memory &memory = host.memories_[binding->second.memory];
    if ((memory.properties & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) == 0 ||
        host.open(device, memory, binding->second.memory, 0) != VK_SUCCESS)
        return;
    memory_ = binding->second.memory;
    const VkDeviceSize begin = binding->second.offset + offset;
    if (begin < memory.first || begin > memory.last || bytes > memory.last - begin)
        return; // the application has mapped another part of it, where only the driver can
    bytes_ = memory.mapped + begin;
    if ((memory.properties & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT) == 0 && bytes > 0) {
        VkPhysicalDeviceProperties properties{};
        device.instance->next.GetPhysicalDeviceProperties(device.physicalDevice, &properties);
        atoms_ = atomsOf(memory_, memory.bytes, begin, bytes, properties.limits.nonCoherentAtomSize);
        device.next.InvalidateMappedMemoryRanges(device.handle, 1, &atoms_);
    }
}

HostView::~HostView()
{
    if (!memory_)
        return;
    HostMemory &host = device_.hostMemory;
    std::lock_guard lock(host.mutex_);
    if (atoms_.size > 0)
        device_.next.FlushMappedMemoryRanges(device_.handle, 1, &atoms_);
    host.close(device_, host.memories_[memory_], memory_);
}

VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice handle, VkDeviceMemory memory, const VkAllocationCallbacks *allocator)
{
    Device &device = deviceOf(handle);
    device.hostMemory.freed(memory);
    device.next.FreeMemory(handle, memory, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory(VkDevice handle, VkBuffer buffer, VkDeviceMemory memory,
                                                VkDeviceSize offset)
{
    Device &device = deviceOf(handle);
    const VkResult result = device.next.BindBufferMemory(handle, buffer, memory, offset);
    if (result == VK_SUCCESS) {
        device.hostMemory.bound(buffer, memory, offset);
        rememberAddress(device, buffer);
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory2(VkDevice handle, uint32_t count, const VkBindBufferMemoryInfo *infos)
{
    Device &device = deviceOf(handle);
    const VkResult result = device.next.BindBufferMemory2(handle, count, infos);
    for (uint32_t i = 0; result == VK_SUCCESS && i < count; ++i) {
        device.hostMemory.bound(infos[i].buffer, infos[i].memory, infos[i].memoryOffset);
        rememberAddress(device, infos[i].buffer);
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL mapMemory(VkDevice handle, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize size,
                                         VkMemoryMapFlags flags, void **data)
{
    Device &device = deviceOf(handle);
    if (!device.asked.hostCommands)
        return device.next.MapMemory(handle, memory, offset, size, flags, data);
    return device.hostMemory.map(device, memory, offset, flags, data);
}

VKAPI_ATTR void VKAPI_CALL unmapMemory(VkDevice handle, VkDeviceMemory memory)
{
    Device &device = deviceOf(handle);
    if (!device.asked.hostCommands)
        return device.next.UnmapMemory(handle, memory);
    device.hostMemory.unmap(device, memory);
}

VKAPI_ATTR VkResult VKAPI_CALL mapMemory2(VkDevice handle, const newer::MemoryMapInfo *info, void **data)
{
    Device &device = deviceOf(handle);
    if (!device.asked.hostCommands)
        return device.next.MapMemory2(handle, info, data);
    // With a place given by the application (VK_EXT_map_memory_placed), only the driver can map.
    if (info->pNext) {
        const VkResult result = device.next.MapMemory2(handle, info, data);
        if (result == VK_SUCCESS)
            device.hostMemory.mappedByDriver(info->memory, info->offset, info->size, *data);
        return result;
    }
    return device.hostMemory.map(device, info->memory, info->offset, info->flags, data);
}

VKAPI_ATTR VkResult VKAPI_CALL unmapMemory2(VkDevice handle, const newer::MemoryUnmapInfo *info)
{
    Device &device = deviceOf(handle);
    if (!device.asked.hostCommands)
        return device.next.UnmapMemory2(handle, info);
    if (info->pNext || info->flags != 0) {
        const VkResult result = device.next.UnmapMemory2(handle, info);
        if (result == VK_SUCCESS)
            device.hostMemory.unmappedByDriver(info->memory);
        return result;
    }
    device.hostMemory.unmap(device, info->memory);
    return VK_SUCCESS;
}

} // namespace vellum::layer
