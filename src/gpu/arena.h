// SPDX-License-Identifier: Apache-2.0
// Memory as an application with an allocator packs it: everything side by side in few buffers, at the smallest allowed
// alignments, and used again as soon as it is free. Every byte outside the pieces is a guard byte, which must not
// change.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "gpu/device.h"
#include "gpu/pieces.h"

namespace vellum::gpu
{

// The buffers of a device with Options::memory other than Memory::Apart.
class Arena
{
public:
    struct Place {
        size_t block = 0; // index of the arena's buffer
        VkDeviceSize offset = 0;
        const Buffer *buffer = nullptr;
    };
    struct Range {
        VkDeviceAddress address = 0;
        VkDeviceSize size = 0;
    };

    explicit Arena(Device &gpu) : gpu_(gpu) {}

    // Returns whether the arena can hold buffers with that usage.
    [[nodiscard]] bool packs(VkBufferUsageFlags usage) const { return (usage & ~this->usage()) == 0; }
    Place take(VkDeviceSize size, VkDeviceSize alignment);
    // Frees the memory at once: no work that uses it may be pending. Expects that the guard bytes around it are intact.
    void give(const Place &place);
    [[nodiscard]] bool intactBeside(const Place &place) const;
    // Expects that the address of a GENERIC structure differs from those of others in its buffer as their offsets do.
    void expectConsistent(const Place &place, VkDeviceAddress address);
    void expectIntact(const std::string &when) const;

    // The contents of the arena before an operation, to compare with those afterwards: all but the ranges that the
    // operation may write to must be unchanged.
    class Snapshot
    {
    public:
        explicit Snapshot(const Arena &arena);
        void expectOnlyChanged(std::span<const Range> ranges, const std::string &operation);

    private:
        const Arena &arena_;
        std::vector<std::vector<uint8_t>> bytes_;
    };

    struct Counts {
        uint64_t buffers = 0, pieces = 0, operations = 0;
        uint64_t bytes = 0;                      // of the buffers
        uint64_t guardBytes = 0, otherBytes = 0; // bytes checked so far
    };
    [[nodiscard]] Counts counts() const;

private:
    struct Block {
        Block(Device &gpu, VkDeviceSize size, VkBufferUsageFlags usage)
            : buffer(gpu, size, usage), pieces({buffer.bytes(), static_cast<size_t>(size)}, buffer.address())
        {
        }
        Buffer buffer;
        Pieces pieces;
        std::optional<VkDeviceAddress> generic; // of GENERIC structures: address - offset
    };
    [[nodiscard]] VkBufferUsageFlags usage() const;

    Device &gpu_;
    mutable std::mutex mutex_;
    std::vector<std::unique_ptr<Block>> blocks_;
    mutable Counts counts_;
};

// A piece of given size and alignment with guard bytes around it: of the arena where the device has one, else in the
// middle of a buffer of its own, or `last` in it, without guard bytes behind. Memory::DeviceLocal has no guard bytes.
class Guarded
{
public:
    Guarded() = default;
    Guarded(Device &gpu, VkDeviceSize size, VkDeviceSize alignment, VkBufferUsageFlags usage, bool last = false);
    Guarded(Guarded &&other) noexcept { swap(other); }
    Guarded &operator=(Guarded &&other) noexcept
    {
        Guarded(std::move(other)).swap(*this);
        return *this;
    }
    ~Guarded();

    [[nodiscard]] VkBuffer buffer() const { return whole().handle(); }
    [[nodiscard]] VkDeviceSize offset() const { return place_.offset; }
    [[nodiscard]] VkDeviceSize size() const { return size_; }
    // The size for a handle to this piece: no more than it needs; or all to the end of the buffer, or a part of that.
    [[nodiscard]] VkDeviceSize handleSize() const
    {
        const VkDeviceSize end = whole().size() - place_.offset;
        return !toTheEnd_ ? size_ : place_.offset / 512 % 2 == 0 ? end : std::min(end, size_ + size_ / 4);
    }
    [[nodiscard]] VkDeviceAddress address() const { return whole().address() + place_.offset; }
    // Null on the device.
    [[nodiscard]] uint8_t *bytes() const
    {
        return whole().bytes() != nullptr ? whole().bytes() + place_.offset : nullptr;
    }
    void write(VkDeviceSize offset, const void *content, size_t size);
    // Makes a second buffer, in the same memory, which has about the first half of the piece.
    void alias(Device &gpu, VkBufferUsageFlags usage);
    [[nodiscard]] VkDeviceMemory memory() const { return whole().memory(); }
    [[nodiscard]] Arena::Range range() const { return {address(), size_}; }
    // Expects what Arena::expectConsistent does, where memory is packed.
    void expectConsistent(VkDeviceAddress address) const
    {
        if (arena_ != nullptr)
            arena_->expectConsistent(place_, address);
    }
    [[nodiscard]] bool intact() const;
    // Describes, in parentheses, the writes to memory around it.
    [[nodiscard]] std::string damage() const;

private:
    void swap(Guarded &other) noexcept;
    [[nodiscard]] const Buffer &whole() const { return arena_ != nullptr ? *place_.buffer : own_; }

    Buffer own_, alias_;
    Arena *arena_ = nullptr;
    Arena::Place place_;
    VkDeviceSize size_ = 0;
    bool toTheEnd_ = false;
};

// Content at an address that is a multiple of 256, or of what is said. Nothing of its buffer is behind it, unless
// memory is packed: no build may read, or demand, more than what it is given.
Guarded uploadAligned(Device &gpu, const void *content, VkDeviceSize size, VkBufferUsageFlags usage,
                      VkDeviceSize alignment = 256);

// Scratch memory that builds use one after the other, with a barrier between them. Each holds the memory it was
// recorded with for as long as it needs it.
class SharedScratch
{
public:
    explicit SharedScratch(Device &gpu) : gpu_(gpu) {}
    std::shared_ptr<Guarded> ofSize(VkDeviceSize size);

private:
    Device &gpu_;
    std::shared_ptr<Guarded> piece_;
};
// Scratch memory, not shared where `shared` is null.
std::shared_ptr<Guarded> scratchOf(Device &gpu, SharedScratch *shared, VkDeviceSize size);

// The memory of what builds read, in arrangements that an application may choose.
class BuildInputs
{
public:
    struct Plan {
        bool shared = false;  // content that other content begins with has no memory of its own
        bool aliased = false; // a second buffer has the first half of each piece of memory
        bool late = false;    // memory has its content from write() on, and garbage before
    };

    BuildInputs(Device &gpu, Plan plan) : gpu_(gpu), plan_(plan) {}
    // Memory that begins with the content, and is freed when nobody holds it.
    std::shared_ptr<Guarded> upload(const void *content, VkDeviceSize size, VkBufferUsageFlags usage,
                                    VkDeviceSize alignment);
    // Writes what is not written yet. Called when commands are recorded, before they are submitted.
    void write();

private:
    struct Piece {
        std::vector<uint8_t> content;
        VkBufferUsageFlags usage = 0;
        std::weak_ptr<Guarded> memory;
    };

    Device &gpu_;
    Plan plan_;
    std::mutex mutex_;
    std::vector<Piece> shared_, late_;
};

} // namespace vellum::gpu
