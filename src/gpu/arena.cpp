// SPDX-License-Identifier: Apache-2.0
#include "gpu/arena.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/align.h"

namespace vellum::gpu
{
namespace
{

constexpr VkDeviceSize kGuard = 256;          // of a piece in a buffer of its own
constexpr VkDeviceSize kBlockBytes = 2 << 20; // of the first buffer; the next ones are larger
constexpr VkBufferUsageFlags kScratch = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

} // namespace

VkBufferUsageFlags Arena::usage() const
{
    VkBufferUsageFlags usage = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                               VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                               VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                               VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    if (gpu_.has(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME))
        usage |= VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;
    return usage;
}

Arena::Place Arena::take(VkDeviceSize size, VkDeviceSize alignment)
{
    const std::lock_guard lock(mutex_);
    ++counts_.pieces;
    for (size_t b = 0;; ++b) {
        if (b == blocks_.size())
            blocks_.push_back(std::make_unique<Block>(
                gpu_, std::max(kBlockBytes << std::min<size_t>(b, 5), size + 4 * alignment + 4096), usage()));
        if (const auto offset = blocks_[b]->pieces.take(static_cast<size_t>(size), static_cast<size_t>(alignment)))
            return {b, *offset, &blocks_[b]->buffer};
    }
}

void Arena::give(const Place &place)
{
    if (!intactBeside(place))
        gpu_.fault("guard bytes have changed (next to offset " + std::to_string(place.offset) + " of buffer " +
                   std::to_string(place.block) + ")");
    const std::lock_guard lock(mutex_);
    blocks_[place.block]->pieces.give(static_cast<size_t>(place.offset));
}

bool Arena::intactBeside(const Place &place) const
{
    const std::lock_guard lock(mutex_);
    return !blocks_[place.block]->pieces.damageBeside(static_cast<size_t>(place.offset));
}

void Arena::expectConsistent(const Place &place, VkDeviceAddress address)
{
    const std::lock_guard lock(mutex_);
    const VkDeviceAddress begin = address - place.offset;
    const VkDeviceAddress others = blocks_[place.block]->generic.value_or(begin);
    blocks_[place.block]->generic = begin;
    if (begin != others)
        gpu_.fault("addresses of GENERIC structures in one buffer do not differ as their offsets do "
                   "(vkGetAccelerationStructureDeviceAddressKHR): the structure at offset " +
                   std::to_string(place.offset) + " is " + std::to_string(static_cast<int64_t>(begin - others)) +
                   " bytes from where it should be");
}

void Arena::expectIntact(const std::string &when) const
{
    const std::lock_guard lock(mutex_);
    for (size_t b = 0; b < blocks_.size(); ++b) {
        const Pieces &pieces = blocks_[b]->pieces;
        counts_.guardBytes += pieces.guardBytes();
        if (const auto damage = pieces.damage()) {
            gpu_.fault(when + ": a guard byte has changed (at offset " + std::to_string(*damage) + " of buffer " +
                       std::to_string(b) + ")");
        }
    }
}

Arena::Snapshot::Snapshot(const Arena &arena) : arena_(arena)
{
    const std::lock_guard lock(arena.mutex_);
    for (const auto &block : arena.blocks_) {
        const std::span<uint8_t> bytes = block->pieces.bytes();
        // The bytes behind are guard bytes, which are checked when the arena's are.
        const size_t size = std::min(bytes.size(), block->pieces.reached() + 4096);
        bytes_.emplace_back(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(size));
    }
}

void Arena::Snapshot::expectOnlyChanged(std::span<const Range> ranges, const std::string &operation)
{
    const std::lock_guard lock(arena_.mutex_);
    ++arena_.counts_.operations;
    for (size_t b = 0; b < bytes_.size(); ++b) {
        std::vector<uint8_t> &before = bytes_[b];
        const Pieces &pieces = arena_.blocks_[b]->pieces;
        const uint8_t *const now = pieces.bytes().data();
        size_t checked = before.size();
        for (const Range &range : ranges) {
            const uint64_t offset = range.address - pieces.address();
            if (range.address < pieces.address() || offset >= before.size())
                continue;
            const size_t size = std::min<size_t>(range.size, before.size() - offset);
            std::memcpy(before.data() + offset, now + offset, size);
            checked -= size;
        }
        arena_.counts_.otherBytes += checked;
        const auto [was, is] = std::mismatch(before.begin(), before.end(), now);
        if (was == before.end())
            continue;
        const auto offset = static_cast<size_t>(was - before.begin());
        size_t changed = 0, last = offset;
        for (size_t i = offset; i < before.size(); ++i) {
            changed += before[i] != now[i] ? 1u : 0u;
            last = before[i] != now[i] ? i : last;
        }
        const auto piece = pieces.upTo(offset).value_or(std::pair<size_t, size_t>{});
        std::string given; // the memory before that, if the operation may write to it
        for (const Range &range : ranges)
            if (pieces.address() + piece.first == range.address)
                given = ", right behind the " + std::to_string(range.size) +
                        " bytes that it may write to, a size that Vulkan reported";
        arena_.gpu_.fault(operation + ": bytes changed that it may not write to (" + std::to_string(changed) +
                          " bytes from offset " + std::to_string(offset) + " to " + std::to_string(last) +
                          " of buffer " + std::to_string(b) + "; the piece before begins at " +
                          std::to_string(piece.first) + " and has " + std::to_string(piece.second) + " bytes" + given +
                          ")");
    }
}

Arena::Counts Arena::counts() const
{
    const std::lock_guard lock(mutex_);
    Counts counts = counts_;
    counts.buffers = blocks_.size();
    for (const auto &block : blocks_)
        counts.bytes += block->buffer.size();
    return counts;
}

Guarded::Guarded(Device &gpu, VkDeviceSize size, VkDeviceSize alignment, VkBufferUsageFlags usage, bool last)
    : size_(size)
{
    if (gpu.arena() != nullptr && gpu.arena()->packs(usage)) {
        arena_ = gpu.arena();
        place_ = arena_->take(size, alignment);
        toTheEnd_ = gpu.options().memory == Memory::PackedToTheEnd;
        return;
    }
    if (gpu.options().memory == Memory::DeviceLocal) {
        const auto create = [&](VkDeviceSize bytes) {
            own_ = Buffer(gpu, bytes, usage | VK_BUFFER_USAGE_TRANSFER_DST_BIT, Buffer::Place::Device);
        };
        create(last && size > 0 ? size : size + alignment);
        if (own_.size() == size && own_.address() % alignment != 0)
            create(size + alignment);
        place_.offset = alignUp(own_.address(), alignment) - own_.address();
        return;
    }
    last = last && size > 0;
    const auto offset = [&] { return alignUp(own_.address() + kGuard, alignment) - own_.address(); };
    own_ = Buffer(gpu, size + kGuard + (last ? 0 : kGuard + alignment), usage);
    // The address of a buffer is known when it exists.
    for (int attempt = 0; last && offset() + size != own_.size() && attempt < 4; ++attempt)
        own_ = Buffer(gpu, offset() + size, usage);
    if (offset() + size > own_.size())
        own_ = Buffer(gpu, size + kGuard + alignment, usage);
    place_.offset = offset();
    std::memset(own_.bytes(), kGuardByte, static_cast<size_t>(own_.size()));
}

Guarded::~Guarded()
{
    // What still refers to it then reads something else.
    if (size_ > 0 && whole().bytes() != nullptr)
        std::memset(bytes(), 0xa5, static_cast<size_t>(size_));
    if (arena_ != nullptr)
        arena_->give(place_);
}

bool Guarded::intact() const
{
    if (arena_ != nullptr)
        return arena_->intactBeside(place_);
    const uint8_t *const bytes = own_.bytes();
    if (bytes == nullptr)
        return true;
    const auto guard = [](uint8_t b) { return b == kGuardByte; };
    return std::all_of(bytes, bytes + place_.offset, guard) &&
           std::all_of(bytes + place_.offset + size_, bytes + own_.size(), guard);
}

std::string Guarded::damage() const
{
    std::string text = " (the size that Vulkan reported is " + std::to_string(size_) + " bytes";
    if (arena_ == nullptr) {
        const uint8_t *const bytes = own_.bytes(), *const end = bytes + own_.size();
        const auto written = [](uint8_t b) { return b != kGuardByte; };
        const uint8_t *const behind = bytes + place_.offset + size_;
        const uint8_t *last = end;
        while (last > behind && !written(last[-1]))
            --last;
        text += last > behind ? ", and it wrote up to byte " +
                                    std::to_string(last - bytes - static_cast<ptrdiff_t>(place_.offset))
                              : ", and it wrote before them";
    }
    return text + ")";
}

void Guarded::write(VkDeviceSize offset, const void *content, size_t size)
{
    if (bytes() != nullptr && size > 0)
        std::memcpy(bytes() + offset, content, size);
    else
        own_.write(place_.offset + offset, content, size);
}

void Guarded::alias(Device &gpu, VkBufferUsageFlags usage)
{
    if (whole().memory() != VK_NULL_HANDLE)
        alias_ = Buffer(gpu, whole(), place_.offset, std::max<VkDeviceSize>(size_ / 2, 1), usage);
}

void Guarded::swap(Guarded &other) noexcept
{
    std::swap(own_, other.own_);
    std::swap(alias_, other.alias_);
    std::swap(arena_, other.arena_);
    std::swap(place_, other.place_);
    std::swap(size_, other.size_);
    std::swap(toTheEnd_, other.toTheEnd_);
}

Guarded uploadAligned(Device &gpu, const void *content, VkDeviceSize size, VkBufferUsageFlags usage,
                      VkDeviceSize alignment)
{
    Guarded buffer(gpu, size, alignment, usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT, true);
    buffer.write(0, content, static_cast<size_t>(size));
    return buffer;
}

std::shared_ptr<Guarded> SharedScratch::ofSize(VkDeviceSize size)
{
    if (!piece_ || piece_->size() < size)
        piece_ = scratchOf(gpu_, nullptr, size);
    return piece_;
}

std::shared_ptr<Guarded> scratchOf(Device &gpu, SharedScratch *shared, VkDeviceSize size)
{
    return shared != nullptr ? shared->ofSize(size)
                             : std::make_shared<Guarded>(gpu, size, gpu.scratchAlignment(), kScratch);
}

std::shared_ptr<Guarded> BuildInputs::upload(const void *content, VkDeviceSize size, VkBufferUsageFlags usage,
                                             VkDeviceSize alignment)
{
    const std::lock_guard lock(mutex_);
    std::erase_if(shared_, [](const Piece &piece) { return piece.memory.expired(); });
    const std::span bytes(static_cast<const uint8_t *>(content), static_cast<size_t>(size));
    for (const Piece &piece : shared_) {
        const std::shared_ptr<Guarded> memory = piece.memory.lock();
        if (memory && piece.usage == usage && piece.content.size() >= bytes.size() &&
            std::equal(bytes.begin(), bytes.end(), piece.content.begin()) && memory->address() % alignment == 0)
            return memory;
    }
    auto memory = std::make_shared<Guarded>(uploadAligned(gpu_, content, size, usage, alignment));
    if (plan_.aliased)
        memory->alias(gpu_, usage);
    if (plan_.shared)
        shared_.push_back({{bytes.begin(), bytes.end()}, usage, memory});
    if (plan_.late && memory->bytes() != nullptr) {
        late_.push_back({{bytes.begin(), bytes.end()}, usage, memory});
        std::memset(memory->bytes(), 0x5a, bytes.size());
    }
    return memory;
}

void BuildInputs::write()
{
    const std::lock_guard lock(mutex_);
    for (const Piece &piece : std::exchange(late_, {}))
        if (const std::shared_ptr<Guarded> memory = piece.memory.lock())
            memory->write(0, piece.content.data(), piece.content.size());
}

} // namespace vellum::gpu
