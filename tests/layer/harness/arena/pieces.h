// Packs pieces into a stretch of memory: the allocator of arena.h and of the fuzz targets, which have no device.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <span>

namespace vt
{

inline constexpr std::uint8_t kGuardByte = 0xa5;

class Pieces
{
public:
    // At least so many guard bytes lie between two pieces.
    static constexpr std::size_t kGap = 16;

    Pieces(std::span<std::uint8_t> bytes, std::uint64_t address) : bytes_(bytes), address_(address)
    {
        std::memset(bytes.data(), kGuardByte, bytes.size());
    }

    // The offset of a new piece: the lowest free place whose address is a multiple of `alignment`, if possible not one
    // of twice that, so that nobody gets a better alignment by chance. Nothing where there is no room.
    std::optional<std::size_t> take(std::size_t size, std::size_t alignment)
    {
        for (const std::size_t better : {2 * alignment, alignment}) {
            std::size_t begin = kGap;
            auto next = pieces_.begin();
            for (;; ++next) {
                const std::size_t end = next == pieces_.end() ? bytes_.size() : next->first;
                std::size_t offset = begin + (alignment - (address_ + begin) % alignment) % alignment;
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
    void give(std::size_t offset)
    {
        const auto piece = pieces_.find(offset);
        std::memset(bytes_.data() + offset, kGuardByte, piece->second);
        pieces_.erase(piece);
    }

    // Of the free room on both sides of a piece, of all free room up to the highest place that ever was in use, and
    // behind that: the first byte that changed.
    [[nodiscard]] std::optional<std::size_t> damageBeside(std::size_t offset) const
    {
        const auto piece = pieces_.find(offset);
        const auto next = std::next(piece);
        const std::size_t before = piece == pieces_.begin() ? 0 : std::prev(piece)->first + std::prev(piece)->second;
        const std::size_t behind = next == pieces_.end() ? reached_ + kGap : next->first;
        const auto damage = damageIn(before, offset);
        return damage ? damage : damageIn(offset + piece->second, behind);
    }
    [[nodiscard]] std::optional<std::size_t> damage() const
    {
        std::size_t begin = 0;
        for (const auto &[offset, size] : pieces_) {
            if (const auto damage = damageIn(begin, offset))
                return damage;
            begin = offset + size;
        }
        return damageIn(begin, bytes_.size());
    }

    // How many bytes damage() looks at.
    [[nodiscard]] std::size_t guardBytes() const
    {
        std::size_t bytes = bytes_.size();
        for (const auto &[offset, size] : pieces_)
            bytes -= size;
        return bytes;
    }
    [[nodiscard]] std::size_t reached() const { return reached_; }
    [[nodiscard]] std::span<std::uint8_t> bytes() const { return bytes_; }
    [[nodiscard]] std::uint64_t address() const { return address_; }
    // The piece that holds a byte, or the last one before it: its offset and size.
    [[nodiscard]] std::optional<std::pair<std::size_t, std::size_t>> upTo(std::size_t offset) const
    {
        const auto next = pieces_.upper_bound(offset);
        if (next == pieces_.begin())
            return {};
        return *std::prev(next);
    }

private:
    [[nodiscard]] std::optional<std::size_t> damageIn(std::size_t begin, std::size_t end) const
    {
        const std::uint8_t *const bytes = bytes_.data();
        // A byte equals the one before it, all along; memcmp is fast.
        if (begin >= end ||
            (bytes[begin] == kGuardByte && std::memcmp(bytes + begin, bytes + begin + 1, end - begin - 1) == 0))
            return {};
        return static_cast<std::size_t>(
            std::find_if(bytes + begin, bytes + end, [](std::uint8_t b) { return b != kGuardByte; }) - bytes);
    }

    std::span<std::uint8_t> bytes_;
    std::uint64_t address_;
    std::map<std::size_t, std::size_t> pieces_; // sizes by offsets
    std::size_t reached_ = 0;
};

} // namespace vt
