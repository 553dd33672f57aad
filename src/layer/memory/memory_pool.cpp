// SPDX-License-Identifier: Apache-2.0
#include "layer/memory/memory_pool.h"

#include <algorithm>
#include <iterator>
#include <new>

#include "layer/base/undo.h"

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kLeastBlock = VkDeviceSize{1} << 20;
constexpr VkDeviceSize kMostSpare = VkDeviceSize{256} << 20; // in a block, beyond the piece it is created for
constexpr VkDeviceSize kMostUnused = VkDeviceSize{64} << 20; // in unused blocks, except the largest

} // namespace

MemoryPool::Piece MemoryPool::take(VkDeviceSize bytes)
{
    const VkDeviceSize needed = alignUp(std::max<VkDeviceSize>(bytes, 1));
    std::lock_guard lock(mutex_);
    auto found = freeBySize_.lower_bound({needed, 0});
    if (found == freeBySize_.end()) {
        // If there is no memory for a larger block, there may be enough for this piece.
        if (!addBlock(std::max({needed, kLeastBlock, alignUp(std::min(total_ / 2, kMostSpare))})) && !addBlock(needed))
            return {};
        found = freeBySize_.lower_bound({needed, 0});
    }
    const auto [capacity, address] = *found;
    if (capacity > needed)
        resizeFree(free_.find(address), address + needed, capacity - needed);
    else
        removeFree(free_.find(address));
    Block &block = std::prev(blocks_.upper_bound(address))->second;
    if (block.used == 0)
        unused_ -= block.bytes;
    block.used += needed;
    const VkDeviceSize offset = address - block.buffer.address();
    uint32_t *words = block.buffer.words() ? block.buffer.words() + offset / 4 : nullptr;
    return {address, needed, block.buffer.buffer(), offset, words};
}

void MemoryPool::giveBack(const Piece &piece)
{
    std::lock_guard lock(mutex_);
    addFree(piece.address, piece.bytes); // the only step that may fail; then nothing has changed
    const auto at = std::prev(blocks_.upper_bound(piece.address));
    Block &block = at->second;
    auto range = free_.find(piece.address);
    if (range != free_.begin()) {
        const auto before = std::prev(range);
        if (before->first >= block.begin && before->first + before->second == range->first)
            range = joinFree(before, range);
    }
    if (const auto next = std::next(range);
        next != free_.end() && next->first < block.begin + block.bytes && range->first + range->second == next->first)
        range = joinFree(range, next);
    block.used -= piece.bytes;
    if (block.used > 0)
        return;
    // The largest and some small ones are kept, so that users that come and go do not allocate and free them
    // repeatedly.
    unused_ += block.bytes;
    auto largest = at, next = blocks_.end(); // the next largest
    for (auto other = blocks_.begin(); other != blocks_.end(); ++other) {
        if (other->second.used != 0 || other == largest)
            continue;
        if (other->second.bytes > largest->second.bytes)
            next = std::exchange(largest, other);
        else if (next == blocks_.end() || other->second.bytes > next->second.bytes)
            next = other;
    }
    if (unused_ - largest->second.bytes > kMostUnused)
        removeUnused(next);
}

void MemoryPool::trim()
{
    std::lock_guard lock(mutex_);
    for (auto block = blocks_.begin(); block != blocks_.end();)
        block = block->second.used == 0 ? removeUnused(block) : std::next(block);
}

bool MemoryPool::addBlock(VkDeviceSize bytes)
{
    Block block;
    if (block.buffer.create(context_, bytes + granularity_, usage_(context_), content_) != VK_SUCCESS)
        return false;
    const VkDeviceAddress begin = alignUp(block.buffer.address());
    block.begin = begin;
    block.bytes = bytes;
    const auto at = blocks_.emplace(begin, std::move(block)).first;
    Undo undo([&] { blocks_.erase(at); });
    addFree(begin, bytes);
    undo.keep();
    total_ += bytes;
    unused_ += bytes;
    return true;
}

void MemoryPool::addFree(VkDeviceAddress begin, VkDeviceSize bytes)
{
    const auto range = free_.emplace(begin, bytes).first;
    Undo undo([&] { free_.erase(range); });
    freeBySize_.emplace(bytes, begin);
    undo.keep();
}

MemoryPool::Free::iterator MemoryPool::resizeFree(Free::iterator range, VkDeviceAddress begin, VkDeviceSize bytes)
{
    auto bySize = freeBySize_.extract({range->second, range->first});
    bySize.value() = {bytes, begin};
    freeBySize_.insert(std::move(bySize));
    auto node = free_.extract(range);
    node.key() = begin;
    node.mapped() = bytes;
    return free_.insert(std::move(node)).position;
}

MemoryPool::Free::iterator MemoryPool::joinFree(Free::iterator first, Free::iterator second)
{
    const VkDeviceSize bytes = first->second + second->second;
    removeFree(second);
    return resizeFree(first, first->first, bytes);
}

std::map<VkDeviceAddress, MemoryPool::Block>::iterator
MemoryPool::removeUnused(std::map<VkDeviceAddress, Block>::iterator block)
{
    removeFree(free_.find(block->first));
    total_ -= block->second.bytes;
    unused_ -= block->second.bytes;
    return blocks_.erase(block);
}

void MemoryPool::removeFree(Free::iterator range)
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
    } catch (const std::bad_alloc &) { // only the piece is lost
    }
}

} // namespace vellum::layer
