// Memory that recorded commands use for themselves: scratch memory of builds that the application did not ask for,
// results that are put together before they are copied, hit records that were changed.
#pragma once

#include <vector>

#include "layer/memory/memory_pool.h"

namespace vellum::layer
{

inline constexpr VkDeviceSize kScratchAlignment = 256; // shaderGroupBaseAlignment is at most 64
VkBufferUsageFlags scratchUsage(const GpuContext &context);

// Of one command buffer. The commands that use it have full barriers around them, so they use the same memory.
class ScratchMemory
{
public:
    explicit ScratchMemory(MemoryPool &pool) : pool_(pool) {}

    // For the next command: what was allocated before may be used again.
    void restart() { next_ = 0; }
    // That many bytes for shaders, builds, traces and transfers, at an address that is a multiple of 256; 0 where there
    // is no memory. The content is undefined.
    struct Place {
        VkDeviceAddress address = 0;
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
    };
    Place place(VkDeviceSize bytes);
    VkDeviceAddress allocate(VkDeviceSize bytes) { return place(bytes).address; }
    // When the commands are gone: the last piece is kept for the next ones, unless it is a large one.
    void reset();

private:
    MemoryPool &pool_;
    std::vector<PooledMemory> pieces_; // the last one is in use
    VkDeviceSize next_ = 0;            // in the last one
};

} // namespace vellum::layer
