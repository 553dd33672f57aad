// Memory that recorded commands use for themselves: scratch memory of builds that the application did not ask for,
// results that are put together before they are copied, hit records that were changed.
#pragma once

#include <vector>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

// Of one command buffer. The commands that use it have full barriers around them, so they use the same memory.
class ScratchMemory
{
public:
    // For the next command: what was allocated before may be used again.
    void restart() { next_ = begin_; }
    // That many bytes for shaders, builds, traces and transfers, at an address that is a multiple of 256; 0 where there
    // is no memory. The content is undefined.
    struct Place {
        VkDeviceAddress address = 0;
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
    };
    Place place(const GpuContext &context, VkDeviceSize bytes);
    VkDeviceAddress allocate(const GpuContext &context, VkDeviceSize bytes) { return place(context, bytes).address; }
    // When the commands are gone: the last piece is kept for the next ones, unless it is a large one.
    void reset();

private:
    std::vector<GpuBuffer> chunks_; // the last one is in use
    VkDeviceAddress begin_ = 0;
    VkDeviceAddress next_ = 0;
    VkDeviceAddress end_ = 0;
};

} // namespace vellum::layer
