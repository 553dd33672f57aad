// Memory that recorded commands use for themselves: scratch memory of builds that the application did not ask for,
// results that are put together before they are copied, hit records that were changed.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

// Of a device: pieces of few allocations, since a device may allow no more than 4096 (maxMemoryAllocationCount), and an
// application may have more command buffers. Each new block is as large as half of those there are, so their number
// grows with the logarithm of what is used.
class ScratchPool
{
public:
    explicit ScratchPool(const GpuContext &context) : context_(context) {}
    ScratchPool(const ScratchPool &) = delete;
    ScratchPool &operator=(const ScratchPool &) = delete;

    static constexpr VkDeviceSize kAlignment = 256; // of pieces; shaderGroupBaseAlignment is at most 64
    struct Piece {
        VkDeviceAddress address = 0; // 0: there is no memory
        VkDeviceSize bytes = 0;
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
    };
    // `bytes` is a multiple of kAlignment.
    Piece take(VkDeviceSize bytes);
    void giveBack(const Piece &piece);

private:
    struct Block {
        GpuBuffer buffer;
        VkDeviceAddress begin = 0;
        VkDeviceSize bytes = 0;
        VkDeviceSize used = 0;
    };
    bool addBlock(VkDeviceSize bytes);
    void addFree(VkDeviceAddress begin, VkDeviceSize bytes);
    void removeFree(std::map<VkDeviceAddress, VkDeviceSize>::iterator range);

    const GpuContext &context_;
    std::mutex mutex_; // guards what is below
    std::map<VkDeviceAddress, Block> blocks_;
    VkDeviceSize total_ = 0;
    std::map<VkDeviceAddress, VkDeviceSize> free_; // never adjacent within a block
    std::set<std::pair<VkDeviceSize, VkDeviceAddress>> freeBySize_;
};

// Of one command buffer. The commands that use it have full barriers around them, so they use the same memory.
class ScratchMemory
{
public:
    explicit ScratchMemory(ScratchPool &pool) : pool_(pool) {}
    ~ScratchMemory();
    ScratchMemory(const ScratchMemory &) = delete;
    ScratchMemory &operator=(const ScratchMemory &) = delete;

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
    void keepLast(std::size_t count);

    ScratchPool &pool_;
    std::vector<ScratchPool::Piece> pieces_; // the last one is in use
    VkDeviceSize next_ = 0;                  // in the last one
};

} // namespace vellum::layer
