// SPDX-License-Identifier: Apache-2.0
// Pieces of a few memory allocations. A device may allow no more than 4096 allocations (maxMemoryAllocationCount),
// which are for the application, and an application may have more command buffers and query pools than that. Each new
// block is half as large as all existing ones, so the number of blocks grows with the logarithm of the memory in use.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <utility>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

class MemoryPool
{
public:
    using Usage = VkBufferUsageFlags (*)(const GpuContext &); // of the buffers of blocks
    // `granularity`: a power of two, of which addresses and sizes of pieces are multiples. `content`: Undefined or
    // DevicesOnly.
    MemoryPool(const GpuContext &context, VkDeviceSize granularity, Usage usage, GpuBuffer::Content content)
        : context_(context), granularity_(granularity), usage_(usage), content_(content)
    {
    }
    MemoryPool(const MemoryPool &) = delete;
    MemoryPool &operator=(const MemoryPool &) = delete;

    struct Piece {
        VkDeviceAddress address = 0; // 0: there is no memory
        VkDeviceSize bytes = 0;      // at least as many as requested
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
        uint32_t *words = nullptr; // mapped; null with DevicesOnly
    };
    // The content of the piece is undefined.
    Piece take(VkDeviceSize bytes);
    void giveBack(const Piece &piece);
    // Frees the unused blocks.
    void trim();

private:
    struct Block {
        GpuBuffer buffer;
        VkDeviceAddress begin = 0;
        VkDeviceSize bytes = 0;
        VkDeviceSize used = 0;
    };
    [[nodiscard]] VkDeviceSize alignUp(VkDeviceSize bytes) const
    {
        return (bytes + granularity_ - 1) & ~(granularity_ - 1);
    }
    bool addBlock(VkDeviceSize bytes);
    using Free = std::map<VkDeviceAddress, VkDeviceSize>;
    void addFree(VkDeviceAddress begin, VkDeviceSize bytes);
    // The following do not allocate.
    std::map<VkDeviceAddress, Block>::iterator removeUnused(std::map<VkDeviceAddress, Block>::iterator block);
    Free::iterator resizeFree(Free::iterator range, VkDeviceAddress begin, VkDeviceSize bytes);
    Free::iterator joinFree(Free::iterator first, Free::iterator second);
    void removeFree(Free::iterator range);

    const GpuContext &context_;
    const VkDeviceSize granularity_;
    const Usage usage_;
    const GpuBuffer::Content content_;
    std::mutex mutex_; // guards what is below
    std::map<VkDeviceAddress, Block> blocks_;
    VkDeviceSize total_ = 0;
    VkDeviceSize unused_ = 0; // in unused blocks
    Free free_;               // never adjacent within a block
    std::set<std::pair<VkDeviceSize, VkDeviceAddress>> freeBySize_;
};

// A piece that its destructor frees.
class PooledMemory
{
public:
    PooledMemory() = default;
    PooledMemory(MemoryPool &pool, VkDeviceSize bytes) : pool_(&pool), piece_(pool.take(bytes)) {}
    ~PooledMemory() { reset(); }
    PooledMemory(PooledMemory &&other) noexcept { *this = std::move(other); }
    PooledMemory &operator=(PooledMemory &&other) noexcept;
    PooledMemory(const PooledMemory &) = delete;
    PooledMemory &operator=(const PooledMemory &) = delete;
    void reset();

    [[nodiscard]] VkDeviceAddress address() const { return piece_.address; } // 0: there is no memory
    [[nodiscard]] VkDeviceSize bytes() const { return piece_.bytes; }
    [[nodiscard]] VkBuffer buffer() const { return piece_.buffer; }
    [[nodiscard]] VkDeviceSize offset() const { return piece_.offset; }
    [[nodiscard]] uint32_t *words() const { return piece_.words; }

private:
    MemoryPool *pool_ = nullptr;
    MemoryPool::Piece piece_;
};

} // namespace vellum::layer
