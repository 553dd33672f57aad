#include "layer/memory/scratch_memory.h"

#include <algorithm>
#include <iterator>
#include <new>

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kLeastBlock = VkDeviceSize{1} << 20;
constexpr VkDeviceSize kMostSpare = VkDeviceSize{256} << 20; // in a block, beyond what it is made for
constexpr VkDeviceSize kLeastPiece = 1024;
constexpr VkDeviceSize kKept = 32 * 1024 * 1024; // between recordings

VkBufferUsageFlags usageOn(const GpuContext &context)
{
    VkBufferUsageFlags usage =
        VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR | VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    // A flag of the extension, that has to be enabled for it.
    if (context.next->CreateRayTracingPipelinesKHR)
        usage |= VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
    return usage;
}

constexpr VkDeviceSize alignUp(VkDeviceSize bytes)
{
    return (bytes + ScratchPool::kAlignment - 1) / ScratchPool::kAlignment * ScratchPool::kAlignment;
}

} // namespace

ScratchPool::Piece ScratchPool::take(VkDeviceSize bytes)
{
    std::lock_guard lock(mutex_);
    auto found = freeBySize_.lower_bound({bytes, 0});
    if (found == freeBySize_.end()) {
        // Where there is no memory for more than this, there may be for this.
        if (!addBlock(std::max({bytes, kLeastBlock, std::min(total_ / 2, kMostSpare)})) && !addBlock(bytes))
            return {};
        found = freeBySize_.lower_bound({bytes, 0});
    }
    const auto [room, address] = *found;
    removeFree(free_.find(address));
    if (room > bytes)
        addFree(address + bytes, room - bytes);
    Block &block = std::prev(blocks_.upper_bound(address))->second;
    block.used += bytes;
    return {address, bytes, block.buffer.buffer(), address - block.buffer.address()};
}

void ScratchPool::giveBack(const Piece &piece)
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

bool ScratchPool::addBlock(VkDeviceSize bytes)
{
    Block block;
    if (block.buffer.create(context_, bytes + kAlignment, usageOn(context_), GpuBuffer::Content::Undefined) !=
        VK_SUCCESS)
        return false;
    block.begin = alignUp(block.buffer.address());
    block.bytes = bytes / kAlignment * kAlignment;
    const VkDeviceAddress begin = block.begin;
    total_ += block.bytes;
    addFree(begin, block.bytes);
    blocks_.emplace(begin, std::move(block));
    return true;
}

void ScratchPool::addFree(VkDeviceAddress begin, VkDeviceSize bytes)
{
    free_.emplace(begin, bytes);
    freeBySize_.emplace(bytes, begin);
}

void ScratchPool::removeFree(std::map<VkDeviceAddress, VkDeviceSize>::iterator range)
{
    freeBySize_.erase({range->second, range->first});
    free_.erase(range);
}

ScratchMemory::~ScratchMemory()
{
    try {
        keepLast(0);
    } catch (const std::bad_alloc &) { // the pieces are lost, and nothing else
    }
}

ScratchMemory::Place ScratchMemory::place(VkDeviceSize bytes)
{
    const VkDeviceSize needed = alignUp(bytes);
    const VkDeviceSize had = pieces_.empty() ? 0 : pieces_.back().bytes;
    if (had - next_ < needed) {
        // Larger by half than the last one, so that copies of growing structures make few.
        const ScratchPool::Piece piece = pool_.take(alignUp(std::max(needed + had + had / 2, kLeastPiece)));
        if (!piece.address)
            return {};
        pieces_.push_back(piece);
        next_ = 0;
    }
    const ScratchPool::Piece &piece = pieces_.back();
    const Place place{piece.address + next_, piece.buffer, piece.offset + next_};
    next_ += needed;
    return place;
}

void ScratchMemory::keepLast(std::size_t count)
{
    while (pieces_.size() > count) {
        pool_.giveBack(pieces_.front());
        pieces_.erase(pieces_.begin());
    }
}

void ScratchMemory::reset()
{
    keepLast(!pieces_.empty() && pieces_.back().bytes <= kKept ? 1 : 0);
    next_ = 0;
}

} // namespace vellum::layer
