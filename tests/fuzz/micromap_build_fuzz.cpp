// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <vector>

#include "check.h"
#include "core/curve.h"
#include "core/micromap.h"
#include "core/micromap_memory.h"
#include "core/records.h"
#include "micromap_fuzz.h"
#include "micromap_model.h"
#include "reader.h"

namespace vellum::fuzz
{
namespace
{

constexpr uint32_t kPreferFastBuild = 2;
constexpr uint8_t kUntouched = 0xc5;
// An arbitrary level, also an invalid one. Those above 7 are rare: they need much data.
uint32_t anyLevel(Reader &input)
{
    return input.oneIn(8) ? input.below(20) : input.below(7);
}

uint32_t anyOffset(Reader &input, size_t dataSize)
{
    switch (input.below(5)) {
    case 0: return input.take<uint32_t>();
    case 1: return input.take<uint16_t>();
    case 2: return static_cast<uint32_t>(dataSize - std::min<size_t>(dataSize, input.byte()));
    case 3: return input.byte() * 8u;
    default: return input.byte() * 16u;
    }
}

// The bytes of the micromap that are in use, after a second hand went through them, are in use in the same place or no
// micromap at all; once records are not trusted, none leads outside.
void damage(Reader &input, std::vector<uint8_t> memory)
{
    uint32_t header[4];
    std::memcpy(header, memory.data(), sizeof header);
    const uint32_t records = header[shared::kMicromapHeaderTriangles];
    const uint32_t units = header[shared::kMicromapHeaderUnits];
    for (uint32_t changes = 1 + input.below(8); changes > 0; --changes) {
        if (records == 0 || input.oneIn(4)) {
            memory[input.below(static_cast<uint32_t>(memory.size()))] = input.byte();
            continue;
        }
        // A record of any kind whose data end about where the micromap does.
        const bool far = input.oneIn(3);
        const uint32_t n = input.below(22);
        const SourceTriangle like{0, static_cast<uint16_t>(3 + n / 2), static_cast<uint16_t>(1 + n % 2)};
        const auto length = static_cast<uint32_t>(dataUnits(like));
        const uint32_t unit = units + 2 - input.below(5) - (input.flag() ? length : input.below(units + 1));
        const uint32_t record[2] = {far ? 31 | n << 5 : (1 + n) | unit << 5, unit};
        std::memcpy(memory.data() + 64 + size_t{input.below(records)} * 8, record, sizeof record);
    }
    const uint64_t used = micromapMemoryInUse(memory.data());
    if (used == 0 || used > memory.size())
        return; // rejected by the layer
    memory.resize(used);
    memory.shrink_to_fit();
    const CompactedMicromap compacted(memory.data());
    std::vector<uint8_t> copy(compacted.bytes());
    compacted.write(copy.data());
    distrustMicromapRecords(memory.data());
    FUZZ_CHECK(micromapMemoryInUse(memory.data()) == used);
    checkStaysInside(memory);
}

} // namespace

void buildMemory(Reader &input)
{
    std::array<uint8_t, 32> hands; // for damage()
    input.part(hands.size()).fill(hands);
    BuildModel model;
    model.triangles.resize(input.oneIn(16) ? input.below(600) : input.below(24));
    model.maxLevel = input.oneIn(4) ? input.below(13) : 12;
    if (input.oneIn(8))
        model.readable = input.below(40);
    MicromapBuildInput build;
    build.stride = input.oneIn(4) ? input.below(64) : 8;
    build.buildFlags = (input.oneIn(4) ? kPreferFastBuild : 0) | (input.flag() ? shared::kBuildAllowsCompaction : 0);
    const bool ahead = input.oneIn(4);
    const uint32_t capacityMode = input.below(4);
    const uint32_t capacity = input.take<uint16_t>();
    // Up to level 12 with 4 states; seldom, since it takes long.
    std::vector<uint8_t> data(input.oneIn(128) ? (4u << 20) + input.byte() : input.below(1u << 13));

    for (SourceTriangle &t : model.triangles) {
        t.level = static_cast<uint16_t>(anyLevel(input));
        t.format = static_cast<uint16_t>(input.oneIn(16) ? input.take<uint16_t>() : 1 + input.byte() % 2);
        t.dataOffset = anyOffset(input, data.size());
    }
    // Exactly what may be read.
    const auto count = static_cast<uint32_t>(model.triangles.size());
    const uint32_t readable = std::min(model.readable, count);
    std::vector<uint8_t> array(readable == 0 ? 0 : (readable - 1) * build.stride + 8);
    for (uint32_t i = 0; i < readable; ++i)
        std::memcpy(array.data() + i * build.stride, &model.triangles[i], 8);
    // A stride of less than a triangle makes them overlap.
    for (uint32_t i = 0; i < readable; ++i)
        std::memcpy(&model.triangles[i], array.data() + i * build.stride, 8);
    input.fill(data);
    model.data = data;

    uint64_t enough = 0;
    for (uint32_t i = 0; i < count; ++i)
        if (model.triangles[i].level <= 12 && model.triangles[i].format >= 1 && model.triangles[i].format <= 2)
            enough += dataUnits(model.triangles[i]);
    // Enough for all, just not, or anything; and no more memory than a test machine has.
    enough = std::min<uint64_t>(enough, 1u << 21);
    model.capacityUnits = static_cast<uint32_t>(capacityMode < 2    ? enough
                                                : capacityMode == 2 ? enough - std::min<uint64_t>(enough, 1)
                                                                    : capacity);
    build.triangles = array.data();
    build.triangleCount = count;
    build.readable = model.readable;
    build.data = data.data();
    build.dataBytes = data.size();
    build.capacityUnits = model.capacityUnits;
    build.maxLevel = model.maxLevel;
    build.copiedAhead = ahead ? data.size() : 0;

    const uint64_t size = micromapMemoryBytes(count, model.capacityUnits);
    std::vector<uint8_t> memory(size, kUntouched);
    writeMicromapMemory(build, memory.data());

    const uint64_t used = micromapMemoryInUse(memory.data());
    FUZZ_CHECK(used >= micromapMemoryBytes(count, 0) && used <= size);
    if (build.copiedAhead == 0)
        FUZZ_CHECK(std::all_of(memory.begin() + static_cast<ptrdiff_t>(used), memory.end(),
                               [](uint8_t byte) { return byte == kUntouched; }));
    const std::span<const uint8_t> inUse(memory.data(), used);
    checkBuilt(model, inUse);

    const CompactedMicromap compactedCopy(memory.data());
    FUZZ_CHECK(compactedCopy.bytes() <= used);
    std::vector<uint8_t> compacted(compactedCopy.bytes());
    compactedCopy.write(compacted.data());
    FUZZ_CHECK(micromapMemoryInUse(compacted.data()) == compacted.size());
    checkBuilt(model, compacted);
    checkStaysInside(compacted);
    FUZZ_CHECK(CompactedMicromap(compacted.data()).bytes() == compacted.size());

    // Valid records are unchanged.
    std::vector<uint8_t> copy(inUse.begin(), inUse.end());
    distrustMicromapRecords(copy.data());
    checkBuilt(model, copy);
    Reader anything(hands);
    damage(anything, std::move(copy));
}

void model(Reader &input)
{
    Micromap micromap;
    micromap.baseTriangle = input.oneIn(4) ? input.take<uint32_t>() : input.below(4);
    micromap.triangles.resize(input.below(16));
    micromap.indices.resize(input.below(32));
    micromap.data.resize(input.below(4096));
    for (MicromapTriangle &t : micromap.triangles) {
        t.subdivisionLevel = static_cast<uint16_t>(anyLevel(input));
        t.format = static_cast<Format>(input.oneIn(16) ? input.take<uint16_t>() : 1 + input.byte() % 2);
        t.dataOffset = anyOffset(input, micromap.data.size());
    }
    for (int32_t &index : micromap.indices)
        index = input.oneIn(8) ? input.take<int32_t>() : static_cast<int32_t>(input.below(24)) - 4;
    const auto u = input.take<float>(), v = input.take<float>();
    input.fill(micromap.data);

    // Whatever the point is, and whatever the level: on the curve.
    for (uint32_t level = 0; level <= 12; ++level)
        FUZZ_CHECK(shared::curveIndex(u, v, level) < 1u << (2 * level));

    const uint64_t count = micromap.triangles.size();
    bool valid = true;
    for (const MicromapTriangle &t : micromap.triangles) {
        const SourceTriangle source{t.dataOffset, t.subdivisionLevel, static_cast<uint16_t>(t.format)};
        valid = valid && (source.format == 1 || source.format == 2) && source.level <= 12 &&
                source.dataOffset + dataBytes(source) <= micromap.data.size();
    }
    for (const int32_t index : micromap.indices) {
        const uint64_t target = static_cast<uint32_t>(index) + uint64_t{micromap.baseTriangle};
        valid = valid && index >= -4 && (index < 0 || target < count);
    }
    FUZZ_CHECK(micromap.validate().has_value() == !valid);
    uint64_t built = 0;
    for (const MicromapUsage &usage : usageOf(micromap.triangles))
        built += usage.count;
    FUZZ_CHECK(built == count);
    if (!valid)
        return;
    uint64_t used = 0;
    for (const MicromapUsage &usage : usageOf(micromap.triangles, micromap.indices, micromap.baseTriangle))
        used += usage.count;
    for (uint32_t i = 0; i < micromap.indices.size(); ++i) {
        const auto state = static_cast<uint32_t>(micromap.stateAt(i, u, v));
        const int32_t index = micromap.indices[i];
        used -= index >= 0 ? 1 : 0;
        if (index < 0) {
            FUZZ_CHECK(state == static_cast<uint32_t>(-1 - index));
            continue;
        }
        const MicromapTriangle &t = micromap.triangles[static_cast<uint32_t>(index) + micromap.baseTriangle];
        BuildModel source;
        source.triangles = {{t.dataOffset, t.subdivisionLevel, static_cast<uint16_t>(t.format)}};
        source.data = micromap.data;
        FUZZ_CHECK(state == sourceState(source, 0, shared::curveIndex(u, v, t.subdivisionLevel)));
    }
    FUZZ_CHECK(used == 0);
}

} // namespace vellum::fuzz
