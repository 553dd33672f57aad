// SPDX-License-Identifier: Apache-2.0
#include "core/micromap_memory.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "core/compaction.h"
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
    if (t.valid) // larger data is not read
        t.mask = t.level <= kCoarseLevel ? maskOf(t, input.data + t.dataOffset) : 0xaaaaaaaau;
    return t;
}

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

Record recordAt(const Triangle &t, uint64_t unit, uint32_t byte)
{
    if (byte == 0 && unit <= kMaxNearUnit)
        return {(kKindData + t.kind()) | static_cast<uint32_t>(unit) << kUnitShift, t.mask};
    return {kKindFar | t.kind() << kUnitShift | byte << kFarByteShift, static_cast<uint32_t>(unit)};
}

} // namespace

// A triangle of a micromap, by its record: its data is at `offset` of the data units. Without data it is invalid.
struct CompactedTriangle : Triangle {
    Record record;
    uint64_t offset = 0;
    uint32_t hash = 0;
    uint32_t owner = kNoData;
};

namespace
{

uint32_t hashOf(const CompactedTriangle &t, const uint8_t *data)
{
    uint32_t hash = mixBits(t.kind()) + (t.units() > kMaxComparedUnits ? mixBits(static_cast<uint32_t>(t.offset)) : 0);
    for (uint32_t u = 0; u < t.units(); ++u) {
        uint32_t words[4] = {};
        std::memcpy(words, data + uint64_t{u} * kDataUnitBytes, std::min(t.bytes(), kDataUnitBytes));
        hash += hashUnit(words[0], words[1], words[2], words[3], u);
    }
    return hash;
}

CompactedTriangle readBuilt(const uint8_t *memory, uint32_t i, const uint8_t *units, uint32_t unitCount)
{
    CompactedTriangle t;
    t.record = readRecord(memory, i);
    if (!staysInside(t.record.word0, t.record.word1, unitCount))
        t.record = {kKindInline, kUnknown};
    const uint32_t kind = t.record.word0 & kKindMask;
    t.valid = kind != kKindInline;
    if (!t.valid)
        return t;
    const bool far = kind == kKindFar;
    const uint32_t n = far ? t.record.word0 >> kUnitShift & kKindMask : kind - kKindData;
    t.level = kCoarseLevel + 1 + n / 2;
    t.bits = 1 + n % 2;
    t.offset = uint64_t{far ? t.record.word1 : t.record.word0 >> kUnitShift} * kDataUnitBytes +
               (far ? t.record.word0 >> kFarByteShift & kFarByteMask : 0);
    t.mask = maskOf(t, units + t.offset);
    if (describesAll(t.mask)) {
        t.record = {kKindInline, t.mask};
        t.valid = false;
        return t;
    }
    t.hash = hashOf(t, units + t.offset);
    t.owner = kNoTriangle;
    return t;
}

bool sameData(const CompactedTriangle &a, const CompactedTriangle &b, const uint8_t *units)
{
    if (a.kind() != b.kind() || a.offset == b.offset)
        return a.kind() == b.kind();
    return a.units() <= kMaxComparedUnits && std::memcmp(units + a.offset, units + b.offset, a.bytes()) == 0;
}

// The rounds of core/compaction.h.
void findOwners(std::vector<CompactedTriangle> &triangles, const uint8_t *units)
{
    const auto count = static_cast<uint32_t>(triangles.size());
    for (uint32_t round = 0; round < kShareRounds; ++round) {
        std::vector<uint32_t> table(shareSlots(count, round), kNoTriangle);
        const auto slotOf = [&](const CompactedTriangle &t) -> uint32_t & {
            return table[shareSlot(count, round, t.hash)];
        };
        for (uint32_t i = 0; i < count; ++i) {
            if (triangles[i].owner == kNoTriangle)
                slotOf(triangles[i]) = std::min(slotOf(triangles[i]), i);
        }
        for (CompactedTriangle &t : triangles) {
            if (t.owner == kNoTriangle && sameData(t, triangles[slotOf(t)], units))
                t.owner = slotOf(t);
        }
    }
    for (uint32_t i = 0; i < count; ++i) {
        if (triangles[i].owner == kNoTriangle)
            triangles[i].owner = i;
    }
}

} // namespace

CompactedMicromap::CompactedMicromap(const uint8_t *memory) : memory_(memory), bytes_(micromapMemoryInUse(memory))
{
    uint32_t header[kMicromapHeaderWords];
    std::memcpy(header, memory, sizeof header);
    const uint32_t count = header[kMicromapHeaderTriangles];
    if ((header[kMicromapHeaderFlags] & kBuildAllowsCompaction) == 0 || header[kMicromapHeaderCompacted] != 0 ||
        count > kMostSharing)
        return;
    const uint8_t *units = memory + micromapMemoryBytes(count, 0);
    triangles_.reserve(count);
    for (uint32_t i = 0; i < count; ++i)
        triangles_.push_back(readBuilt(memory, i, units, header[kMicromapHeaderUnits]));
    findOwners(triangles_, units);
    uint64_t needed = 0;
    for (uint32_t i = 0; i < count; ++i)
        needed += triangles_[i].owner == i ? triangles_[i].units() : 0;
    if (count == 0 || needed > header[kMicromapHeaderUnits])
        triangles_.clear();
    else
        bytes_ = micromapMemoryBytes(count, needed);
}

CompactedMicromap::~CompactedMicromap() = default;

void CompactedMicromap::write(uint8_t *out) const
{
    if (triangles_.empty()) {
        std::memcpy(out, memory_, static_cast<size_t>(bytes_));
        return;
    }
    const auto count = static_cast<uint32_t>(triangles_.size());
    const uint8_t *units = memory_ + micromapMemoryBytes(count, 0);
    uint8_t *target = out + micromapMemoryBytes(count, 0);
    uint32_t next = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const CompactedTriangle &t = triangles_[i];
        if (t.owner != i) {
            writeRecord(out, i, t.owner == kNoData ? t.record : readRecord(out, t.owner));
            continue;
        }
        uint8_t *to = target + uint64_t{next} * kDataUnitBytes;
        std::memset(to, 0, size_t{t.units()} * kDataUnitBytes);
        std::memcpy(to, units + t.offset, t.bytes());
        writeRecord(out, i, recordAt(t, next, 0));
        next += t.units();
    }
    if (count % 2 != 0)
        writeRecord(out, count, {0, 0});
    uint32_t header[kMicromapHeaderWords];
    std::memcpy(header, memory_, sizeof header);
    header[kMicromapHeaderUnits] = next;
    header[kMicromapHeaderCompacted] = 1;
    std::memcpy(out, header, sizeof header);
}

void writeMicromapMemory(const MicromapBuildInput &input, uint8_t *out)
{
    const uint32_t count = input.triangleCount;
    uint8_t *units = out + micromapMemoryBytes(count, 0);
    std::vector<Triangle> triangles;
    triangles.reserve(count);
    for (uint32_t i = 0; i < count; ++i)
        triangles.push_back(readTriangle(input, i));
    uint64_t last = 0;
    const bool stays = staysInPlace(input, triangles, last);
    if (input.copiedAhead > 0)
        std::memcpy(
            units, input.data,
            static_cast<size_t>(std::min<uint64_t>(input.copiedAhead, uint64_t{input.capacityUnits} * kDataUnitBytes)));
    uint64_t next = 0;
    for (uint32_t i = 0; i < count; ++i) {
        Triangle &t = triangles[i];
        if (stays)
            next = t.dataOffset / kDataUnitBytes;
        const uint64_t own = t.units();
        const bool overflows =
            own > 0 && !stays && own > input.capacityUnits - std::min<uint64_t>(next, input.capacityUnits);
        if (!t.valid || overflows) {
            t.valid = false;
            writeRecord(out, i, {kKindInline | ~kKindMask, kUnknown});
            if (overflows)
                next += own;
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
        writeRecord(out, i, own == 0 ? Record{kKindInline, t.mask} : recordAt(t, next, byte));
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
        if (const Record record = readRecord(memory, i);
            !staysInside(record.word0, record.word1, header[kMicromapHeaderUnits]))
            writeRecord(memory, i, {kKindInline, kUnknown});
    }
}

} // namespace vellum
