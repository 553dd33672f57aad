// SPDX-License-Identifier: Apache-2.0
// Memory for recorded commands of the layer: scratch memory of injected builds, the driver's serialized data, changed
// hit records.
#pragma once

#include <vector>

#include "layer/memory/memory_pool.h"

namespace vellum::layer
{

inline constexpr VkDeviceSize kScratchAlignment = 256; // shaderGroupBaseAlignment is at most 64
VkBufferUsageFlags scratchUsage(const GpuContext &context);

// The scratch memory of one command buffer. Commands that use it are between full barriers, so they share the memory,
// unless the command buffer may be executed on several queues at once.
class ScratchMemory
{
public:
    explicit ScratchMemory(MemoryPool &pool) : pool_(pool) {}

    // Begins the next command, which may reuse the memory of those before if commands share it.
    void restart() { next_ = shared_ ? 0 : next_; }
    // Allocates bytes for shaders, builds and traces, at a multiple of 256; 0 if there is no memory. The content is
    // undefined.
    VkDeviceAddress allocate(VkDeviceSize bytes);
    // Called once the commands are gone. Keeps the last piece for the next ones, unless it is large: then other command
    // buffers can use it.
    void reset();
    // Sets whether commands share the memory; called while none is recorded. Two executions of a command buffer with
    // VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT may be in different commands at once, and the barriers of one do not
    // order those of the other.
    void setShared(bool shared) { shared_ = shared; }
    // Keeps nothing.
    void release();

private:
    MemoryPool &pool_;
    std::vector<PooledMemory> pieces_; // the last one is in use
    VkDeviceSize next_ = 0;            // in the last one
    bool shared_ = true;
};

} // namespace vellum::layer
