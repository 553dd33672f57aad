// Memory that recorded commands use for themselves, such as scratch memory of builds that the application did not ask
// for.
#pragma once

#include <vector>

#include "layer/gpu_memory.h"

namespace vellum::layer
{

// Of one command buffer. The commands that use it have full barriers around them, so they use the same memory.
class ScratchMemory
{
public:
    // For the next command: what was allocated before may be used again.
    void restart() { next_ = begin_; }
    // Address of that many bytes for shaders and builds, a multiple of 256; 0 where there is no memory. The content is
    // undefined.
    VkDeviceAddress allocate(const GpuContext &context, VkDeviceSize bytes);
    // When the commands are gone.
    void reset();

private:
    std::vector<GpuBuffer> chunks_; // the last one is in use
    VkDeviceAddress begin_ = 0;
    VkDeviceAddress next_ = 0;
    VkDeviceAddress end_ = 0;
};

} // namespace vellum::layer
