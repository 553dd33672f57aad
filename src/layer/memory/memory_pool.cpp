#include "layer/memory/memory_pool.h"

#include <algorithm>
#include <iterator>
#include <new>

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kLeastBlock = VkDeviceSize{1} << 20;
constexpr VkDeviceSize kMostSpare = VkDeviceSize{256} << 20; // in a block, beyond what it is made for

} // namespace

MemoryPool::Piece MemoryPool::take(VkDeviceSize bytes)
{
    const VkDeviceSize needed = alignUp(std::max<VkDeviceSize>(bytes, 1));
    std::lock_guard lock(mutex_);
    auto found = freeBySize_.lower_bound({needed, 0});
    if (found == freeBySize_.end()) {
        // Where there is no memory for more than this, there may be for this.
        if (!addBlock(std::max({needed, kLeastBlock, alignUp(std::min(total_ / 2, kMostSpare))})) && !addBlock(needed))
            return {};
        found = freeBySize_.lower_bound({needed, 0});
    }
    const auto [room, address] = *found;
    removeFree(free_.find(address));
    if (room > needed)
        addFree(address + needed, room - needed);
    Block &block = std::prev(blocks_.upper_bound(address))->second;
    block.used += needed;
    const VkDeviceSize offset = address - block.buffer.address();
    uint32_t *words = block.buffer.words() ? block.buffer.words() + offset / 4 : nullptr;
    return {address, needed, block.buffer.buffer(), offset, words};
}

void MemoryPool::giveBack(const Piece &piece)
{
    std::lock_guard lock(mutex_);
    const auto at = std::prev(blocks_.upper_bound(piece.address));
    Block &block = at->second;
    VkDeviceAddress begin = piece.address;
    VkDeviceAddress end = begin + piece.bytes;
    const auto after = free_.lower_bound(begin);
    if (after != free_.begin()) {
        const auto before = std::prev(after);
        if (before->first >= block.begin && before->first + before->second == begin) {
            begin = before->first;
            removeFree(before);
        }
    }
    if (const auto next = free_.find(end); next != free_.end() && end < block.begin + block.bytes) {
        end += next->second;
        removeFree(next);
    }
    block.used -= piece.bytes;
    // One is kept, so that a single user does not make and free it all the time.
    if (block.used == 0 && blocks_.size() > 1) {
        total_ -= block.bytes;
        blocks_.erase(at);
        return;
    }
    addFree(begin, end - begin);
}

bool MemoryPool::addBlock(VkDeviceSize bytes)
{
    Block block;
    if (block.buffer.create(context_, bytes + granularity_, usage_(context_), content_) != VK_SUCCESS)
        return false;
    const VkDeviceAddress begin = alignUp(block.buffer.address());
    block.begin = begin;
    block.bytes = bytes;
    total_ += bytes;
    addFree(begin, bytes);
    blocks_.emplace(begin, std::move(block));
    return true;
}

void MemoryPool::addFree(VkDeviceAddress begin, VkDeviceSize bytes)
{
    free_.emplace(begin, bytes);
    freeBySize_.emplace(bytes, begin);
}

void MemoryPool::removeFree(std::map<VkDeviceAddress, VkDeviceSize>::iterator range)
{
    freeBySize_.erase({range->second, range->first});
    free_.erase(range);
}

PooledMemory &PooledMemory::operator=(PooledMemory &&other) noexcept
{
    if (this != &other) {
        reset();
        pool_ = other.pool_;
        piece_ = std::exchange(other.piece_, {});
    }
    return *this;
}

void PooledMemory::reset()
{
    if (!piece_.address)
        return;
    try {
        pool_->giveBack(std::exchange(piece_, {}));
    } catch (const std::bad_alloc &) { // the piece is lost, and nothing else
    }
}

} // namespace vellum::layer
