// SPDX-License-Identifier: Apache-2.0
#include "bake/packed.h"

#include <algorithm>
#include <cstring>

namespace vellum
{
namespace
{

constexpr uint64_t kLowBits = 0x5555555555555555;

// Sums of the even bits of some words: up to 63 words fit.
class BitSum
{
public:
    void add(uint64_t evenBits)
    {
        const uint64_t pairs = (evenBits & 0x3333333333333333) + (evenBits >> 2 & 0x3333333333333333);
        bytes_ += (pairs + (pairs >> 4)) & 0x0f0f0f0f0f0f0f0f;
    }
    [[nodiscard]] uint64_t sum() const
    {
        // Bytes are at most 4 * 63; their sum needs more than a byte.
        const uint64_t words = (bytes_ & 0x00ff00ff00ff00ff) + (bytes_ >> 8 & 0x00ff00ff00ff00ff);
        return words * 0x0001000100010001 >> 48;
    }

private:
    uint64_t bytes_ = 0;
};

// Compacts the even bits of a byte.
constexpr uint8_t squeeze(unsigned byte)
{
    return static_cast<uint8_t>((byte & 1) | (byte >> 1 & 2) | (byte >> 2 & 4) | (byte >> 3 & 8));
}

// The state of a sub-triangle by those of its four parts, a byte of 4-state data.
constexpr std::array<uint8_t, 256> kFolded = [] {
    std::array<uint8_t, 256> folded{};
    for (unsigned byte = 0; byte < 256; ++byte) {
        const unsigned opaque = (byte & 1) + (byte >> 2 & 1) + (byte >> 4 & 1) + (byte >> 6 & 1);
        const auto unknown = static_cast<uint8_t>(opaque >= 2 ? State::UnknownOpaque : State::UnknownTransparent);
        folded[byte] = byte == 0x00   ? static_cast<uint8_t>(State::Transparent)
                       : byte == 0x55 ? static_cast<uint8_t>(State::Opaque)
                                      : unknown;
    }
    return folded;
}();

} // namespace

StateCounts countStates(const uint8_t *data, uint32_t level)
{
    const size_t bytes = packedBytes(level, Format::FourState);
    uint64_t unknown = 0;
    uint64_t low = 0;
    uint64_t both = 0;
    constexpr size_t kWords = 63;
    for (size_t at = 0; at < bytes;) {
        BitSum unknownSum;
        BitSum lowSum;
        BitSum bothSum;
        for (size_t n = 0; n < kWords && at < bytes; ++n, at += 8) {
            uint64_t word = 0;
            std::memcpy(&word, data + at, std::min<size_t>(8, bytes - at));
            const uint64_t high = word >> 1 & kLowBits;
            unknownSum.add(high);
            lowSum.add(word & kLowBits);
            bothSum.add(word & high);
        }
        unknown += unknownSum.sum();
        low += lowSum.sum();
        both += bothSum.sum();
    }
    const uint64_t count = microTriangleCount(level);
    return {count - unknown - low + both, low - both, unknown - both, both};
}

std::optional<State> uniformState(const StateCounts &counts)
{
    for (size_t s = 0; s < counts.size(); ++s)
        if (counts[s] != 0)
            return counts[s] == counts[0] + counts[1] + counts[2] + counts[3] ? std::optional(static_cast<State>(s))
                                                                              : std::nullopt;
    return std::nullopt;
}

void toTwoState(uint8_t *data, uint32_t level, TwoStateRule rule)
{
    const size_t bytes = packedBytes(level, Format::FourState);
    const auto half = [&](size_t at) -> unsigned {
        if (at >= bytes)
            return 0;
        const unsigned low = data[at];
        const unsigned high = low >> 1;
        switch (rule) {
        case TwoStateRule::UnknownIsOpaque: return squeeze(low | high);
        case TwoStateRule::UnknownIsTransparent: return squeeze(low & ~high);
        case TwoStateRule::Nearest: break;
        }
        return squeeze(low);
    };
    for (size_t at = 0; at < bytes; at += 2)
        data[at / 2] = static_cast<uint8_t>(half(at) | half(at + 1) << 4);
}

void swapOutcomes(uint8_t *data, uint32_t level)
{
    const uint8_t used = level == 0 ? 0x01 : 0x55;
    const size_t bytes = packedBytes(level, Format::FourState);
    for (size_t i = 0; i < bytes; ++i)
        data[i] = static_cast<uint8_t>(data[i] ^ used);
}

void keepCommon(uint8_t *data, const uint8_t *other, uint32_t level)
{
    const size_t bytes = packedBytes(level, Format::FourState);
    for (size_t i = 0; i < bytes; ++i) {
        const unsigned either = data[i] | other[i];
        const unsigned differ = data[i] ^ other[i];
        const unsigned unknown = (either & 0xaa) | (differ << 1 & 0xaa);
        data[i] = static_cast<uint8_t>((data[i] & 0x55) | unknown);
    }
}

void foldOnce(uint8_t *data, uint32_t level)
{
    const size_t count = microTriangleCount(level - 1);
    for (size_t i = 0; i < count; i += 4) {
        unsigned byte = 0;
        for (size_t k = 0; k < 4 && i + k < count; ++k)
            byte |= unsigned{kFolded[data[i + k]]} << (2 * k);
        data[i / 4] = static_cast<uint8_t>(byte);
    }
}

} // namespace vellum
