// Memory that recorded commands use for themselves: scratch memory of builds that the application did not ask for,
// serialized data of the driver's, hit records that were changed.
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
    // That many bytes for shaders, builds and traces, at an address that is a multiple of 256; 0 where there
    // is no memory. The content is undefined.
    VkDeviceAddress allocate(VkDeviceSize bytes);
    // When the commands are gone: the last piece is kept for the next ones, unless it is a large one.
    void reset();

private:
    MemoryPool &pool_;
    std::vector<PooledMemory> pieces_; // the last one is in use
    VkDeviceSize next_ = 0;            // in the last one
};

} // namespace vellum::layer
