// SPDX-License-Identifier: Apache-2.0
#include "layer/memory/host_memory.h"

#include <cstring>
#include <utility>

#include "layer/base/commands.h"
#include "layer/base/pnext.h"
#include "layer/memory/device_buffers.h"

namespace vellum::layer
{

void HostMemory::allocated(VkDeviceMemory memory, VkDeviceSize bytes, VkMemoryPropertyFlags properties)
{
    std::lock_guard lock(mutex_);
    memories_[memory] = {.properties = properties, .bytes = bytes};
}

void HostMemory::freed(VkDeviceMemory memory, AddressMap &addresses)
{
    // Held throughout: the handle of a buffer is not used again before destroyed().
    std::lock_guard lock(mutex_);
    const auto known = memories_.extract(memory);
    if (!known)
        return;
    for (const VkBuffer buffer : known.mapped().buffers) {
        addresses.hide(buffer);
        bindings_.erase(buffer);
    }
}

void HostMemory::bound(VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset)
{
    std::lock_guard lock(mutex_);
    bindings_[buffer] = {memory, offset};
    memories_[memory].buffers.insert(buffer);
}

void HostMemory::destroyed(VkBuffer buffer)
{
    std::lock_guard lock(mutex_);
    const auto binding = bindings_.extract(buffer);
    if (const auto memory = binding ? memories_.find(binding.mapped().memory) : memories_.end();
        memory != memories_.end())
        memory->second.buffers.erase(buffer);
}

VkResult HostMemory::open(const Driver &driver, Memory &memory, VkDeviceMemory handle, VkMemoryMapFlags flags)
{
    if (memory.users == 0) {
        void *mapped = nullptr;
        const VkResult result = driver.next.MapMemory(driver.handle, handle, 0, VK_WHOLE_SIZE, flags, &mapped);
        if (result != VK_SUCCESS)
            return result;
        memory.mapped = static_cast<uint8_t *>(mapped);
        memory.first = 0;
        memory.last = memory.bytes;
    }
    ++memory.users;
    return VK_SUCCESS;
}

void HostMemory::close(const Driver &driver, Memory &memory, VkDeviceMemory handle)
{
    if (memory.users == 0 || --memory.users > 0)
        return;
    memory.mapped = nullptr;
    driver.next.UnmapMemory(driver.handle, handle);
}

VkResult HostMemory::map(const Driver &driver, VkDeviceMemory handle, VkDeviceSize offset, VkMemoryMapFlags flags,
                         void **data)
{
    std::lock_guard lock(mutex_);
    Memory &memory = memories_[handle];
    const VkResult result = open(driver, memory, handle, flags);
    if (result == VK_SUCCESS)
        *data = memory.mapped + offset;
    return result;
}

void HostMemory::unmap(const Driver &driver, VkDeviceMemory handle)
{
    std::lock_guard lock(mutex_);
    close(driver, memories_[handle], handle);
}

void HostMemory::mappedByDriver(VkDeviceMemory handle, VkDeviceSize offset, VkDeviceSize bytes, void *data)
{
    std::lock_guard lock(mutex_);
    Memory &memory = memories_[handle];
    memory.mapped = static_cast<uint8_t *>(data) - offset;
    memory.first = offset;
    memory.last = bytes == VK_WHOLE_SIZE ? bytes : offset + bytes;
    memory.users = 1;
}

HostMemory::Mapping HostMemory::unmappedByDriver(VkDeviceMemory handle)
{
    std::lock_guard lock(mutex_);
    Memory &memory = memories_[handle];
    if (!memory.mapped)
        return {};
    memory.users = 0;
    return {memory.first, memory.last - memory.first, std::exchange(memory.mapped, nullptr) + memory.first};
}

bool HostMemory::peek(VkBuffer buffer, VkDeviceSize offset, void *bytes, VkDeviceSize count)
{
    std::lock_guard lock(mutex_);
    const auto binding = bindings_.find(buffer);
    const auto found = binding == bindings_.end() ? memories_.end() : memories_.find(binding->second.memory);
    if (found == memories_.end() || !found->second.mapped)
        return false;
    const Memory &memory = found->second;
    const VkDeviceSize begin = binding->second.offset + offset;
    if (begin < memory.first || begin > memory.last || count > memory.last - begin)
        return false;
    std::memcpy(bytes, memory.mapped + begin, count);
    return true;
}

HostView::HostView(DeviceBuffers &device, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize bytes, For use)
    : device_(device)
{
    HostMemory &host = device.host;
    std::lock_guard lock(host.mutex_);
    const auto binding = host.bindings_.find(buffer);
    if (binding == host.bindings_.end())
        return;
    HostMemory::Memory &memory = host.memories_[binding->second.memory];
    if ((memory.properties & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) == 0 ||
        host.open(device.driver, memory, binding->second.memory, 0) != VK_SUCCESS)
        return;
    memory_ = binding->second.memory;
    const VkDeviceSize begin = binding->second.offset + offset;
    if (begin < memory.first || begin > memory.last || bytes > memory.last - begin)
        return; // the application has mapped another part, by a command that only the driver supports
    bytes_ = memory.mapped + begin;
    if ((memory.properties & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT) == 0 && bytes > 0) {
        VkPhysicalDeviceProperties properties{};
        device.driver.instance->GetPhysicalDeviceProperties(device.driver.physicalDevice, &properties);
        atoms_ = atomsOf(memory_, memory.bytes, begin, bytes, properties.limits.nonCoherentAtomSize);
        device.driver.next.InvalidateMappedMemoryRanges(device.driver.handle, 1, &atoms_);
        if (use == For::Reading)
            atoms_.size = 0;
    }
}

HostView::~HostView()
{
    if (!memory_)
        return;
    HostMemory &host = device_.host;
    std::lock_guard lock(host.mutex_);
    if (atoms_.size > 0)
        device_.driver.next.FlushMappedMemoryRanges(device_.driver.handle, 1, &atoms_);
    host.close(device_.driver, host.memories_[memory_], memory_);
}

void freeMemory(DeviceBuffers &device, VkDevice handle, VkDeviceMemory memory, const VkAllocationCallbacks *allocator)
{
    device.host.freed(memory, device.addresses);
    device.driver.next.FreeMemory(handle, memory, allocator);
}

VkResult bindBufferMemory(DeviceBuffers &device, VkDevice handle, VkBuffer buffer, VkDeviceMemory memory,
                          VkDeviceSize offset)
{
    const VkResult result = device.driver.next.BindBufferMemory(handle, buffer, memory, offset);
    if (result == VK_SUCCESS) {
        device.host.bound(buffer, memory, offset);
        rememberAddress(device, buffer);
    }
    return result;
}

bool isBound(const VkBindBufferMemoryInfo &info, VkResult ofAll)
{
    const auto *status = findInChain<VkBindMemoryStatusKHR>(info.pNext, VK_STRUCTURE_TYPE_BIND_MEMORY_STATUS_KHR);
    return ofAll == VK_SUCCESS || (status && *status->pResult == VK_SUCCESS);
}

VkResult bindBufferMemory2(DeviceBuffers &device, VkDevice handle, uint32_t count, const VkBindBufferMemoryInfo *infos)
{
    const VkResult result = device.driver.next.BindBufferMemory2(handle, count, infos);
    for (uint32_t i = 0; i < count; ++i) {
        if (!isBound(infos[i], result))
            continue;
        device.host.bound(infos[i].buffer, infos[i].memory, infos[i].memoryOffset);
        rememberAddress(device, infos[i].buffer);
    }
    return result;
}

namespace
{

// Returns whether host commands of the layer may have to map the memory as well.
bool sharesMappings(const Driver &driver)
{
    return driver.emulated() && driver.enabled.hostCommands;
}

} // namespace

VkResult mapMemory(DeviceBuffers &device, VkDevice handle, VkDeviceMemory memory, VkDeviceSize offset,
                   VkDeviceSize size, VkMemoryMapFlags flags, void **data)
{
    if (!sharesMappings(device.driver)) {
        const VkResult result = device.driver.next.MapMemory(handle, memory, offset, size, flags, data);
        if (result == VK_SUCCESS)
            device.host.mappedByDriver(memory, offset, size, *data);
        return result;
    }
    return device.host.map(device.driver, memory, offset, flags, data);
}

void unmapMemory(DeviceBuffers &device, VkDevice handle, VkDeviceMemory memory)
{
    if (!sharesMappings(device.driver)) {
        device.host.unmappedByDriver(memory);
        return device.driver.next.UnmapMemory(handle, memory);
    }
    device.host.unmap(device.driver, memory);
}

VkResult mapMemory2(DeviceBuffers &device, VkDevice handle, const VkMemoryMapInfoKHR *info, void **data)
{
    // Only the driver can map memory at an address that the application chooses (VK_EXT_map_memory_placed).
    if (info->pNext || !sharesMappings(device.driver)) {
        const VkResult result = device.driver.next.MapMemory2KHR(handle, info, data);
        if (result == VK_SUCCESS)
            device.host.mappedByDriver(info->memory, info->offset, info->size, *data);
        return result;
    }
    return device.host.map(device.driver, info->memory, info->offset, info->flags, data);
}

VkResult unmapMemory2(DeviceBuffers &device, VkDevice handle, const VkMemoryUnmapInfoKHR *info)
{
    if (info->pNext || info->flags != 0 || !sharesMappings(device.driver)) {
        const HostMemory::Mapping was = device.host.unmappedByDriver(info->memory);
        const VkResult result = device.driver.next.UnmapMemory2KHR(handle, info);
        if (result != VK_SUCCESS && was.data) // VK_ERROR_MEMORY_MAP_FAILED: it stays mapped
            device.host.mappedByDriver(info->memory, was.offset, was.bytes, was.data);
        return result;
    }
    device.host.unmap(device.driver, info->memory);
    return VK_SUCCESS;
}

} // namespace vellum::layer
