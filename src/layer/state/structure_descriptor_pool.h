// Descriptors (core/records.h) by their number, on memory of the layer's.
//
// Either the device writes what is in them, or the host does. Tools between the layer and the driver may write a page
// of mapped memory back as a whole when the host has written to a part of it (as capture tools do that guard pages),
// and so undo what the device has written beside it. So the host touches a page only while none of its descriptors is
// in use: a descriptor that is given back is not used again before all of its page are.
#pragma once

#include <cstdint>
#include <vector>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

// Where the descriptor of an acceleration structure lies (core/records.h).
struct StructureDescriptor {
    VkDeviceAddress address = 0;
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    const uint32_t *words = nullptr; // for the host to read, once the device has written them
};

class StructureDescriptorPool
{
public:
    static constexpr uint32_t kNone = UINT32_MAX;

    // The number of a descriptor of zeroes; kNone where there is no memory.
    uint32_t acquire(const GpuContext &context);
    void release(uint32_t descriptor);
    [[nodiscard]] StructureDescriptor location(uint32_t descriptor) const;
    [[nodiscard]] uint32_t *words(uint32_t descriptor) const;

private:
    struct Page {
        uint32_t taken = 0; // descriptors that were given out since it was empty
        uint32_t inUse = 0;
    };
    bool grow(const GpuContext &context);

    std::vector<GpuBuffer> buffers_;
    std::vector<Page> pages_;
    std::vector<uint32_t> emptyPages_; // none of their descriptors is in use; they may hold what was in them
    uint32_t open_ = kNone;            // the page that descriptors are taken from
};

} // namespace vellum::layer
