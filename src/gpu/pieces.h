// SPDX-License-Identifier: Apache-2.0
// Packs pieces into a stretch of memory: the allocator of arena.h and of the fuzz targets, which have no device.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <span>

namespace vellum::gpu
{

inline constexpr uint8_t kGuardByte = 0xa5;

class Pieces
{
public:
    // The least number of guard bytes between two pieces.
    static constexpr size_t kGap = 16;

    Pieces(std::span<uint8_t> bytes, uint64_t address) : bytes_(bytes), address_(address)
    {
        std::memset(bytes.data(), kGuardByte, bytes.size());
    }

    // The offset of a new piece: the lowest free one whose address is a multiple of `alignment`, if possible not of
    // twice that, so that no object has a larger alignment by chance. Nothing if there is no space.
    std::optional<size_t> take(size_t size, size_t alignment)
    {
        for (const size_t better : {2 * alignment, alignment}) {
            size_t begin = kGap;
            auto next = pieces_.begin();
            for (;; ++next) {
                const size_t end = next == pieces_.end() ? bytes_.size() : next->first;
                size_t offset = begin + (alignment - (address_ + begin) % alignment) % alignment;
                if ((address_ + offset) % better == 0 && better != alignment)
                    offset += alignment;
                if (offset + size + kGap <= end) {
                    pieces_.emplace(offset, size);
                    reached_ = std::max(reached_, offset + size);
                    return offset;
                }
                if (next == pieces_.end())
                    break;
                begin = next->first + next->second + kGap;
            }
        }
        return {};
    }
    void give(size_t offset)
    {
        const auto piece = pieces_.find(offset);
        std::memset(bytes_.data() + offset, kGuardByte, piece->second);
        pieces_.erase(piece);
    }

    // The first byte that changed in the free memory on both sides of a piece, in all free memory up to the highest
    // address that ever was in use, and behind that.
    [[nodiscard]] std::optional<size_t> damageBeside(size_t offset) const
    {
        const auto piece = pieces_.find(offset);
        const auto next = std::next(piece);
        const size_t before = piece == pieces_.begin() ? 0 : std::prev(piece)->first + std::prev(piece)->second;
        const size_t behind = next == pieces_.end() ? reached_ + kGap : next->first;
        const auto damage = damageIn(before, offset);
        return damage ? damage : damageIn(offset + piece->second, behind);
    }
    [[nodiscard]] std::optional<size_t> damage() const
    {
        size_t begin = 0;
        for (const auto &[offset, size] : pieces_) {
            if (const auto damage = damageIn(begin, offset))
                return damage;
            begin = offset + size;
        }
        return damageIn(begin, bytes_.size());
    }

    // The number of bytes that damage() checks.
    [[nodiscard]] size_t guardBytes() const
    {
        size_t bytes = bytes_.size();
        for (const auto &[offset, size] : pieces_)
            bytes -= size;
        return bytes;
    }
    [[nodiscard]] size_t reached() const { return reached_; }
    [[nodiscard]] std::span<uint8_t> bytes() const { return bytes_; }
    [[nodiscard]] uint64_t address() const { return address_; }
    // The piece that holds a byte, or the last one before it: its offset and size.
    [[nodiscard]] std::optional<std::pair<size_t, size_t>> upTo(size_t offset) const
    {
        const auto next = pieces_.upper_bound(offset);
        if (next == pieces_.begin())
            return {};
        return *std::prev(next);
    }

private:
    [[nodiscard]] std::optional<size_t> damageIn(size_t begin, size_t end) const
    {
        const uint8_t *const bytes = bytes_.data();
        // A byte equals the one before it, all along; memcmp is fast.
        if (begin >= end ||
            (bytes[begin] == kGuardByte && std::memcmp(bytes + begin, bytes + begin + 1, end - begin - 1) == 0))
            return {};
        return static_cast<size_t>(std::find_if(bytes + begin, bytes + end, [](uint8_t b) { return b != kGuardByte; }) -
                                   bytes);
    }

    std::span<uint8_t> bytes_;
    uint64_t address_;
    std::map<size_t, size_t> pieces_; // sizes by offsets
    size_t reached_ = 0;
};

} // namespace vellum::gpu
