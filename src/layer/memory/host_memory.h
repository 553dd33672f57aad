// Which memory buffers are bound to, and the host's view of it: for the host commands of micromaps, whose buffers need
// not be mapped by the application, but may be, and to look at what the application has written. A memory object can be
// mapped only once (VUID-vkMapMemory-memory-00678), so the application's mappings are known here, and are of the whole
// memory, but for those that only the driver can make.
#pragma once

#include <cstdint>
#include <mutex>
#include <unordered_map>

#include <vulkan/vulkan.h>

#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

struct DeviceBuffers;
struct Driver;

// What has to be flushed or invalidated for bytes of memory that is not coherent: whole atoms (VkMappedMemoryRange),
// and no more of them than there must be. The application may have written others and not flushed them yet, and
// invalidating those would undo it (vkInvalidateMappedMemoryRanges).
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
    void freed(VkDeviceMemory memory);
    void bound(VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset);
    void destroyed(VkBuffer buffer);

    // The application's mappings. `map` maps the whole memory and gives the address of `offset`.
    VkResult map(const Driver &driver, VkDeviceMemory memory, VkDeviceSize offset, VkMemoryMapFlags flags, void **data);
    void unmap(const Driver &driver, VkDeviceMemory memory);
    // The driver has mapped or unmapped it as the application wanted: bytes from `offset` on are at `data`.
    void mappedByDriver(VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize bytes, void *data);
    void unmappedByDriver(VkDeviceMemory memory);

    // What the host sees of a buffer, where the application has mapped it; false where it has not. What the device has
    // written to memory that is not coherent need not be seen.
    bool peek(VkBuffer buffer, VkDeviceSize offset, void *bytes, VkDeviceSize count);

private:
    friend class HostView;
    struct Memory {
        VkMemoryPropertyFlags properties = 0;
        VkDeviceSize bytes = 0;
        uint8_t *mapped = nullptr; // where the whole of it is, or would be: what is mapped is
        VkDeviceSize first = 0, last = 0;
        uint32_t users = 0; // the application and host views
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

// Bytes of a buffer, mapped for as long as this object lives; written ones reach the device at its end.
class HostView
{
public:
    enum class For { Reading, Writing };
    HostView(DeviceBuffers &device, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize bytes, For use);
    ~HostView();
    HostView(const HostView &) = delete;
    HostView &operator=(const HostView &) = delete;
    // Null where the buffer is not bound to host-visible memory, or that cannot be mapped.
    [[nodiscard]] uint8_t *bytes() const { return bytes_; }

private:
    DeviceBuffers &device_;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkMappedMemoryRange atoms_{}; // to be flushed at the end; none of coherent memory, or where nothing is written
    uint8_t *bytes_ = nullptr;
};

void freeMemory(DeviceBuffers &, VkDevice, VkDeviceMemory, const VkAllocationCallbacks *);
VkResult bindBufferMemory(DeviceBuffers &, VkDevice, VkBuffer, VkDeviceMemory, VkDeviceSize);
VkResult bindBufferMemory2(DeviceBuffers &, VkDevice, uint32_t, const VkBindBufferMemoryInfo *);
VkResult mapMemory(DeviceBuffers &, VkDevice, VkDeviceMemory, VkDeviceSize, VkDeviceSize, VkMemoryMapFlags, void **);
void unmapMemory(DeviceBuffers &, VkDevice, VkDeviceMemory);
VkResult mapMemory2(DeviceBuffers &, VkDevice, const newer::MemoryMapInfo *, void **);
VkResult unmapMemory2(DeviceBuffers &, VkDevice, const newer::MemoryUnmapInfo *);

} // namespace vellum::layer
