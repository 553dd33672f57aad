// SPDX-License-Identifier: Apache-2.0
#include "core/micromap_memory.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "core/curve.h"
#include "core/micromap.h"

namespace vellum
{
namespace
{

using namespace shared;

constexpr uint32_t kUnknown = 0xffffffffu;

struct Record {
    uint32_t word0 = kKindInline;
    uint32_t word1 = 0;
};

struct Triangle {
    bool valid = true;
    uint32_t dataOffset = 0;
    uint32_t level = 0;
    uint32_t bits = 1; // per state
    uint32_t mask = 0; // sub-triangles of level 2; their states up to that level
    uint32_t owner = 0;

    [[nodiscard]] Format format() const { return static_cast<Format>(bits); }
    [[nodiscard]] uint32_t bytes() const { return packedBytes(level, format()); }
    [[nodiscard]] uint32_t units() const
    {
        return !valid || level <= kCoarseLevel ? 0 : (bytes() + kDataUnitBytes - 1) / kDataUnitBytes;
    }
    [[nodiscard]] uint32_t kind() const { return (level - kCoarseLevel - 1) * 2 + (bits - 1); }
};

bool describesAll(uint32_t mask)
{
    return (mask & 0xaaaaaaaau) == 0;
}

// The states of level 2, or for each of its sub-triangles 0 transparent, 1 opaque, 2 both.
uint32_t maskOf(const Triangle &t, const uint8_t *data)
{
    const uint32_t states = microTriangleCount(t.level);
    uint32_t mask = 0;
    for (uint32_t sub = 0; sub < 16; ++sub) {
        if (t.level <= kCoarseLevel) {
            mask |= static_cast<uint32_t>(readState(data, sub * states / 16, t.format())) << (2 * sub);
            continue;
        }
        const uint32_t each = states / 16;
        bool transparent = true;
        bool opaque = true;
        const auto look = [&](uint32_t state) {
            transparent &= state == kStateTransparent;
            opaque &= state == kStateOpaque;
        };
        if (each * t.bits >= 8) {
            const uint8_t solid = t.bits == 1 ? 0xff : 0x55;
            const uint32_t bytes = each * t.bits / 8;
            for (uint32_t i = sub * bytes; i < (sub + 1) * bytes; ++i) {
                transparent &= data[i] == 0;
                opaque &= data[i] == solid;
            }
        } else {
            for (uint32_t i = 0; i < each; ++i)
                look(static_cast<uint32_t>(readState(data, sub * each + i, t.format())));
        }
        mask |= (transparent ? 0u : opaque ? 1u : kCoarseLook) << (2 * sub);
    }
    return mask;
}

Triangle readTriangle(const MicromapBuildInput &input, uint32_t i)
{
    Triangle t;
    t.owner = i;
    if (i >= input.readable) {
        t.valid = false;
        return t;
    }
    MicromapTriangle source;
    std::memcpy(&source, input.triangles + i * input.stride, sizeof source);
    const auto format = static_cast<uint32_t>(source.format);
    t.dataOffset = source.dataOffset;
    t.level = source.subdivisionLevel;
    t.bits = format;
    t.valid = (format == 1 || format == 2) && t.level <= std::min(kMaxSubdivisionLevel, input.maxLevel) &&
              uint64_t{t.dataOffset} + t.bytes() <= std::min<uint64_t>(input.dataBytes, kUnknown);
    // Without sharing, data is not read.
    if (t.valid)
        t.mask = input.share || t.level <= kCoarseLevel ? maskOf(t, input.data + t.dataOffset) : 0xaaaaaaaau;
    return t;
}

// The lowest triangle with the same data becomes the owner of it.
class Owners
{
public:
    explicit Owners(const MicromapBuildInput &input) : input_(input) {}
    uint32_t of(const Triangle &t, uint32_t self)
    {
        const auto *begin = reinterpret_cast<const char *>(input_.data) + t.dataOffset;
        // Beyond the limit, only the same place counts as the same data (kMaxComparedUnits).
        if (t.units() > kMaxComparedUnits)
            return places_.try_emplace(uint64_t{t.kind()} << 32 | t.dataOffset, self).first->second;
        return owners_[t.kind()].try_emplace(std::string_view(begin, t.bytes()), self).first->second;
    }

private:
    const MicromapBuildInput &input_;
    std::unordered_map<uint32_t, std::unordered_map<std::string_view, uint32_t>> owners_;
    std::unordered_map<uint64_t, uint32_t> places_;
};

// Returns whether every triangle can use its data where it lies; `last`: the unit behind the last one that does.
bool staysInPlace(const MicromapBuildInput &input, const std::vector<Triangle> &triangles, uint64_t &last)
{
    last = 0;
    for (const Triangle &t : triangles) {
        if (t.units() == 0)
            continue;
        const uint64_t end = (uint64_t{t.dataOffset} + t.bytes() + kDataUnitBytes - 1) / kDataUnitBytes;
        if (end > input.capacityUnits)
            return false;
        last = std::max(last, end);
    }
    return true;
}

Record readRecord(const uint8_t *memory, uint64_t i)
{
    Record record;
    std::memcpy(&record, memory + kMicromapHeaderWords * 4 + i * sizeof record, sizeof record);
    return record;
}

void writeRecord(uint8_t *memory, uint64_t i, Record record)
{
    std::memcpy(memory + kMicromapHeaderWords * 4 + i * sizeof record, &record, sizeof record);
}

} // namespace

void writeMicromapMemory(const MicromapBuildInput &input, uint8_t *out)
{
    const uint32_t count = input.triangleCount;
    uint8_t *units = out + micromapMemoryBytes(count, 0);
    Owners owners(input);
    std::vector<Triangle> triangles;
    triangles.reserve(count);
    for (uint32_t i = 0; i < count; ++i)
        triangles.push_back(readTriangle(input, i));
    uint64_t last = 0;
    const bool stays = !input.share && staysInPlace(input, triangles, last);
    if (input.copiedAhead > 0)
        std::memcpy(
            units, input.data,
            static_cast<size_t>(std::min<uint64_t>(input.copiedAhead, uint64_t{input.capacityUnits} * kDataUnitBytes)));
    uint64_t next = 0;
    for (uint32_t i = 0; i < count; ++i) {
        Triangle &t = triangles[i];
        if (stays)
            next = t.dataOffset / kDataUnitBytes;
        const bool fold = t.level > kCoarseLevel && describesAll(t.mask);
        if (input.share && t.units() > 0 && !fold)
            t.owner = owners.of(t, i);
        const uint64_t own = t.owner != i || fold ? 0 : t.units();
        const bool overflows =
            own > 0 && !stays && own > input.capacityUnits - std::min<uint64_t>(next, input.capacityUnits);
        if (!t.valid || overflows) {
            t.valid = false;
            writeRecord(out, i, {kKindInline | ~kKindMask, kUnknown});
            if (overflows)
                next += own;
            continue;
        }
        if (t.owner != i) {
            writeRecord(out, i, readRecord(out, t.owner));
            continue;
        }
        const uint32_t byte = stays ? t.dataOffset % kDataUnitBytes : 0;
        if (stays) { // also what nothing refers to, as on the device, so that data without gaps has the same bytes
            const uint64_t at = std::min<uint64_t>(t.dataOffset, last * kDataUnitBytes);
            std::memcpy(units + at, input.data + t.dataOffset,
                        static_cast<size_t>(std::min<uint64_t>(t.bytes(), last * kDataUnitBytes - at)));
        } else if (own > 0) {
            std::memset(units + next * kDataUnitBytes, 0, static_cast<size_t>(own * kDataUnitBytes));
            std::memcpy(units + next * kDataUnitBytes, input.data + t.dataOffset, t.bytes());
        }
        const auto unit = static_cast<uint32_t>(next);
        if (own == 0)
            writeRecord(out, i, {kKindInline, t.mask});
        else if (byte == 0 && next <= kMaxNearUnit)
            writeRecord(out, i, {(kKindData + t.kind()) | unit << kUnitShift, t.mask});
        else
            writeRecord(out, i, {kKindFar | t.kind() << kUnitShift | byte << kFarByteShift, unit});
        next += own;
    }
    if (stays)
        next = last;
    if (count % 2 != 0)
        writeRecord(out, count, {0, 0});
    uint32_t header[kMicromapHeaderWords] = {};
    header[kMicromapHeaderMagic] = kMicromapMagic;
    header[kMicromapHeaderTriangles] = count;
    header[kMicromapHeaderUnits] = static_cast<uint32_t>(std::min<uint64_t>(next, input.capacityUnits));
    header[kMicromapHeaderFlags] = input.buildFlags & kBuildFlagsMask;
    std::memcpy(out, header, sizeof header);
}

uint64_t micromapMemoryInUse(const uint8_t *memory)
{
    uint32_t header[kMicromapHeaderWords];
    std::memcpy(header, memory, sizeof header);
    return header[kMicromapHeaderMagic] == kMicromapMagic
               ? micromapMemoryBytes(header[kMicromapHeaderTriangles], header[kMicromapHeaderUnits])
               : 0;
}

void distrustMicromapRecords(uint8_t *memory)
{
    uint32_t header[kMicromapHeaderWords];
    std::memcpy(header, memory, sizeof header);
    const uint64_t records = (uint64_t{header[kMicromapHeaderTriangles]} + 1) / 2 * 2;
    for (uint64_t i = 0; i < records; ++i) {
        const Record record = readRecord(memory, i);
        const uint32_t kind = record.word0 & kKindMask;
        if (kind == kKindInline)
            continue;
        const bool far = kind == kKindFar;
        const uint32_t n = far ? record.word0 >> kUnitShift & kKindMask : kind - kKindData;
        const uint32_t unit = far ? record.word1 : record.word0 >> kUnitShift;
        if (n < kDataKinds) {
            const uint32_t before = far ? (record.word0 >> kFarByteShift & kFarByteMask) * 8 : 0;
            const uint64_t bits = before + (uint64_t{1 + (n & 1)} << (2 * (kCoarseLevel + 1 + n / 2)));
            if (unit + (bits + 127) / 128 <= header[kMicromapHeaderUnits])
                continue;
        }
        writeRecord(memory, i, {kKindInline, kUnknown});
    }
}

} // namespace vellum
