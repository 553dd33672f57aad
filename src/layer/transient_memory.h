// Memory for what the layer's work in one recording of a command buffer leaves for the commands after it.
#pragma once

#include <vector>

#include "layer/gpu_memory.h"

namespace vellum::layer
{

class TransientMemory
{
public:
    // Address of `bytes` bytes, a multiple of 256; 0 where memory is used up. Contents are undefined.
    VkDeviceAddress allocate(const GpuContext &context, VkDeviceSize bytes);
    // Everything may be used again.
    void reset();

private:
    struct Block {
        GpuBuffer buffer;
        VkDeviceSize size = 0;
    };
    std::vector<Block> blocks_;
    size_t current_ = 0;
    VkDeviceSize used_ = 0; // of the current block
};

} // namespace vellum::layer
