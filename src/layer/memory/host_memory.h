// SPDX-License-Identifier: Apache-2.0
// The memory that buffers are bound to, and its mappings. The host commands of micromaps read and write buffers that
// the application may or may not have mapped, and some checks read what the application has written. A memory object
// can be mapped only once (VUID-vkMapMemory-memory-00678). So the layer keeps track of the application's mappings.
// Where it has host commands, it maps the whole memory object, except where only the driver can map it.
#pragma once

#include <cstdint>
#include <mutex>
#include <unordered_map>
#include <unordered_set>

#include <vulkan/vulkan.h>

#include "vk/newer.h"

namespace vellum::layer
{

class AddressMap;
struct DeviceBuffers;
struct Driver;

// The range to flush or invalidate for bytes of memory that is not coherent: the smallest range of whole atoms
// (VkMappedMemoryRange). The application may have written to other atoms without flushing them, and invalidating those
// would discard its writes (vkInvalidateMappedMemoryRanges).
constexpr VkMappedMemoryRange atomsOf(VkDeviceMemory memory, VkDeviceSize memoryBytes, VkDeviceSize begin,
                                      VkDeviceSize bytes, VkDeviceSize atom)
{
    const VkDeviceSize first = begin / atom * atom;
    const VkDeviceSize last = (begin + bytes + atom - 1) / atom * atom;
    return {VK_STRUCTURE_TYPE_MAPPED_MEMORY_RANGE, nullptr, memory, first,
            (last < memoryBytes ? last : memoryBytes) - first};
}

class HostMemory
{
public:
    void allocated(VkDeviceMemory memory, VkDeviceSize bytes, VkMemoryPropertyFlags properties);
    // Hides the addresses of the buffers that are bound to it: other memory may have them next, while the buffers still
    // exist.
    void freed(VkDeviceMemory memory, AddressMap &addresses);
    void bound(VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset);
    void destroyed(VkBuffer buffer);

    // The application's mappings. map() maps the whole memory, and returns the address of `offset`.
    VkResult map(const Driver &driver, VkDeviceMemory memory, VkDeviceSize offset, VkMemoryMapFlags flags, void **data);
    void unmap(const Driver &driver, VkDeviceMemory memory);
    // The driver has mapped or unmapped the memory for the application: bytes from `offset` on are at `data`.
    void mappedByDriver(VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize bytes, void *data);
    // The driver is about to unmap it: the mapping is no longer read. Returns the mapping, which mappedByDriver()
    // restores if the driver's command fails.
    struct Mapping {
        VkDeviceSize offset = 0;
        VkDeviceSize bytes = 0;
        void *data = nullptr; // null: there was none
    };
    Mapping unmappedByDriver(VkDeviceMemory memory);

    // Reads bytes of a buffer, if the application has mapped them; otherwise returns false. Writes of the device to
    // memory that is not coherent may be missing.
    bool peek(VkBuffer buffer, VkDeviceSize offset, void *bytes, VkDeviceSize count);

private:
    friend class HostView;
    struct Memory {
        VkMemoryPropertyFlags properties = 0;
        VkDeviceSize bytes = 0;
        uint8_t *mapped = nullptr;            // address of offset 0; null if nothing is mapped
        VkDeviceSize first = 0, last = 0;     // the mapped bytes; last may be behind the memory's end
        uint32_t users = 0;                   // the application and host views
        std::unordered_set<VkBuffer> buffers; // bound to it
    };
    struct Binding {
        VkDeviceMemory memory = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
    };
    VkResult open(const Driver &driver, Memory &memory, VkDeviceMemory handle, VkMemoryMapFlags flags);
    void close(const Driver &driver, Memory &memory, VkDeviceMemory handle);

    std::mutex mutex_;
    std::unordered_map<VkDeviceMemory, Memory> memories_;
    std::unordered_map<VkBuffer, Binding> bindings_;
};

// Bytes of a buffer, mapped for as long as this object lives. Its end makes writes visible to the device.
class HostView
{
public:
    enum class For { Reading, Writing };
    HostView(DeviceBuffers &device, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize bytes, For use);
    ~HostView();
    HostView(const HostView &) = delete;
    HostView &operator=(const HostView &) = delete;
    // Null if the buffer is not bound to host-visible memory, or the memory cannot be mapped.
    [[nodiscard]] uint8_t *bytes() const { return bytes_; }

private:
    DeviceBuffers &device_;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkMappedMemoryRange atoms_{}; // to be flushed at the end; empty for coherent memory and for reading
    uint8_t *bytes_ = nullptr;
};

// Returns whether one of several bindings succeeded: some may do so although the command fails (VK_KHR_maintenance6).
bool isBound(const VkBindBufferMemoryInfo &info, VkResult ofAll);

} // namespace vellum::layer
