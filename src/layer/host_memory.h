// Which memory buffers are bound to, and the host's view of it: for the host commands of micromaps, which need not be
// mapped by the application, but may be. A memory object can be mapped only once (VUID-vkMapMemory-memory-00678), so
// the application's mappings are known here, and are of the whole memory.
#pragma once

#include <cstdint>
#include <mutex>
#include <unordered_map>

#include <vulkan/vulkan.h>

#include "layer/vulkan_newer.h"

namespace vellum::layer
{

struct Device;

class HostMemory
{
public:
    void allocated(VkDeviceMemory memory, VkMemoryPropertyFlags properties);
    void freed(VkDeviceMemory memory);
    void bound(VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset);
    void destroyed(VkBuffer buffer);

    // The application's mappings. `map` maps the whole memory and gives the address of `offset`.
    VkResult map(const Device &device, VkDeviceMemory memory, VkDeviceSize offset, VkMemoryMapFlags flags, void **data);
    void unmap(const Device &device, VkDeviceMemory memory);

private:
    friend class HostView;
    struct Memory {
        VkMemoryPropertyFlags properties = 0;
        uint8_t *mapped = nullptr; // the whole of it
        uint32_t users = 0;        // the application and host views
    };
    struct Binding {
        VkDeviceMemory memory = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
    };
    VkResult open(const Device &device, Memory &memory, VkDeviceMemory handle, VkMemoryMapFlags flags);
    void close(const Device &device, Memory &memory, VkDeviceMemory handle);

    std::mutex mutex_;
    std::unordered_map<VkDeviceMemory, Memory> memories_;
    std::unordered_map<VkBuffer, Binding> bindings_;
};

// Bytes of a buffer, mapped for as long as this object lives; written ones reach the device at its end.
class HostView
{
public:
    HostView(Device &device, VkBuffer buffer, VkDeviceSize offset);
    ~HostView();
    HostView(const HostView &) = delete;
    HostView &operator=(const HostView &) = delete;
    // Null where the buffer is not bound to host-visible memory, or that cannot be mapped.
    [[nodiscard]] uint8_t *bytes() const { return bytes_; }

private:
    Device &device_;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    bool coherent_ = true;
    uint8_t *bytes_ = nullptr;
};

VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice, VkDeviceMemory, const VkAllocationCallbacks *);
VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory(VkDevice, VkBuffer, VkDeviceMemory, VkDeviceSize);
VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory2(VkDevice, uint32_t, const VkBindBufferMemoryInfo *);
VKAPI_ATTR VkResult VKAPI_CALL mapMemory(VkDevice, VkDeviceMemory, VkDeviceSize, VkDeviceSize, VkMemoryMapFlags,
                                         void **);
VKAPI_ATTR void VKAPI_CALL unmapMemory(VkDevice, VkDeviceMemory);
VKAPI_ATTR VkResult VKAPI_CALL mapMemory2(VkDevice, const newer::MemoryMapInfo *, void **);
VKAPI_ATTR VkResult VKAPI_CALL unmapMemory2(VkDevice, const newer::MemoryUnmapInfo *);

} // namespace vellum::layer
