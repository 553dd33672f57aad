// Memory for what the layer's work in a command buffer leaves for the command after it.
#pragma once

#include <vector>

#include "layer/gpu_memory.h"

namespace vellum::layer
{

// The same memory serves one command after the other: the barriers around injected work order its uses.
class TransientMemory
{
public:
    // Address of at least `bytes` bytes, a multiple of 256; 0 where memory is used up. Contents are undefined.
    VkDeviceAddress get(const GpuContext &context, VkDeviceSize bytes);
    // The command buffer is recorded anew: of what it had, the largest piece is enough.
    void reset();

private:
    struct Block {
        GpuBuffer buffer;
        VkDeviceSize size = 0;
    };
    std::vector<Block> blocks_; // each larger than those before, which commands recorded earlier use
};

} // namespace vellum::layer
