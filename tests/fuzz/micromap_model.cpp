// SPDX-License-Identifier: Apache-2.0
#include "micromap_model.h"

#include <algorithm>
#include <cstring>

#include "check.h"
#include "core/curve.h"
#include "core/micromap.h"
#include "core/records.h"

namespace vellum::fuzz
{
namespace
{

using namespace shared;

// Micro-triangles that are looked at: all of them up to level 6, some above.
constexpr uint32_t kMostStates = 4096;
constexpr uint32_t kMostPoints = 64;

uint32_t stateCount(uint32_t level)
{
    return 1u << (2 * level);
}

uint32_t stepOf(uint32_t count, uint32_t most)
{
    return count <= most ? 1 : count / most | 1;
}

bool isValid(const BuildModel &model, uint32_t i)
{
    const SourceTriangle &t = model.triangles[i];
    return i < model.readable && (t.format == 1 || t.format == 2) && t.level <= std::min(12u, model.maxLevel) &&
           t.dataOffset + dataBytes(t) <= model.data.size();
}

uint32_t wordAt(std::span<const uint8_t> bytes, uint64_t at)
{
    FUZZ_CHECK(at + 4 <= bytes.size());
    uint32_t word = 0;
    std::memcpy(&word, bytes.data() + at, sizeof word);
    return word;
}

struct Data {
    uint32_t level;
    uint32_t bits;  // per state
    uint64_t begin; // byte, from the first data unit
};

// The data of a triangle record. From level 3 on there are two kinds of each level.
Data dataOf(uint32_t word0, uint32_t word1)
{
    const bool far = (word0 & 31) == 31;
    const uint32_t n = far ? word0 >> 5 & 31 : (word0 & 31) - 1;
    FUZZ_CHECK(n < 20);
    return {3 + n / 2, 1 + n % 2, far ? uint64_t{word1} * 16 + (word0 >> 10 & 15) : uint64_t{word0 >> 5} * 16};
}

uint64_t unitsBegin(std::span<const uint8_t> micromap)
{
    const uint64_t triangles = wordAt(micromap, kMicromapHeaderTriangles * 4);
    return 64 + (triangles + triangles % 2) * 8;
}

} // namespace

uint64_t dataBytes(const SourceTriangle &triangle)
{
    return (uint64_t{stateCount(triangle.level)} * triangle.format + 7) / 8;
}

uint64_t dataUnits(const SourceTriangle &triangle)
{
    return triangle.level <= 2 ? 0 : (dataBytes(triangle) + 15) / 16;
}

uint32_t sourceState(const BuildModel &model, uint32_t triangle, uint32_t index)
{
    const SourceTriangle &t = model.triangles[triangle];
    const uint32_t bit = index * t.format;
    return model.data[t.dataOffset + bit / 8] >> bit % 8 & ((1u << t.format) - 1);
}

// Data stays where it lies if that is possible for all of it. Else each triangle's follows the one before, and what
// does not fit is unknown.
std::vector<bool> unknownOf(const BuildModel &model)
{
    std::vector<bool> unknown(model.triangles.size());
    bool stays = true;
    for (uint32_t i = 0; i < unknown.size(); ++i) {
        unknown[i] = !isValid(model, i);
        const SourceTriangle &t = model.triangles[i];
        if (!unknown[i] && dataUnits(t) > 0)
            stays &= t.dataOffset + dataBytes(t) <= uint64_t{model.capacityUnits} * 16;
    }
    uint64_t next = 0;
    for (uint32_t i = 0; i < unknown.size() && !stays; ++i) {
        const uint64_t units = unknown[i] ? 0 : dataUnits(model.triangles[i]);
        unknown[i] = unknown[i] || (units > 0 && next + units > model.capacityUnits);
        next += units;
    }
    return unknown;
}

uint32_t builtState(std::span<const uint8_t> micromap, uint32_t triangle, uint32_t level, uint32_t index)
{
    const uint64_t record = 64 + uint64_t{triangle} * 8;
    const uint32_t word0 = wordAt(micromap, record);
    const uint32_t word1 = wordAt(micromap, record + 4);
    const uint32_t kind = word0 & 31;
    const bool far = kind == 31;
    if (!far) {
        // The states or summaries of level 2 that the micro-triangle covers, or is part of.
        const uint32_t first = level < 2 ? index << (4 - 2 * level) : index >> (2 * level - 4);
        const uint32_t covered = level < 2 ? 1u << (4 - 2 * level) : 1;
        const uint32_t coarse = word1 >> (2 * first) & 3;
        for (uint32_t i = 1; i < covered; ++i)
            FUZZ_CHECK((word1 >> (2 * (first + i)) & 3) == coarse);
        if (kind == 0 || coarse < 2)
            return coarse;
        FUZZ_CHECK(coarse == 2);
    }
    const Data data = dataOf(word0, word1);
    FUZZ_CHECK(level == data.level);
    const uint64_t bits = data.bits;
    const uint64_t byte = data.begin + index * bits / 8;
    FUZZ_CHECK(byte / 16 < wordAt(micromap, kMicromapHeaderUnits * 4));
    const uint64_t at = unitsBegin(micromap) + byte;
    FUZZ_CHECK(at < micromap.size());
    return micromap[at] >> (index * bits % 8) & ((1u << bits) - 1);
}

void checkBuilt(const BuildModel &model, std::span<const uint8_t> micromap)
{
    const std::vector<bool> unknown = unknownOf(model);
    FUZZ_CHECK(wordAt(micromap, kMicromapHeaderTriangles * 4) == unknown.size());
    FUZZ_CHECK(wordAt(micromap, kMicromapHeaderUnits * 4) <= model.capacityUnits);
    Micromap library;
    library.data.assign(model.data.begin(), model.data.end());
    for (uint32_t i = 0; i < unknown.size(); ++i) {
        const SourceTriangle &t = model.triangles[i];
        if (unknown[i]) {
            for (uint32_t k = 0; k < 16; ++k)
                FUZZ_CHECK(builtState(micromap, i, 2, k) == kStateUnknownOpaque);
            continue;
        }
        const uint32_t count = stateCount(t.level);
        for (uint32_t k = 0; k < count; k += stepOf(count, kMostStates))
            FUZZ_CHECK(builtState(micromap, i, t.level, k) == sourceState(model, i, k));

        library.indices = {0};
        library.triangles = {{t.dataOffset, t.level, static_cast<Format>(t.format)}};
        FUZZ_CHECK(!library.validate());
        for (uint32_t k = 0; k < count; k += stepOf(count, kMostPoints)) {
            const auto [a, b, c] = microTriangleCorners(k, t.level);
            const float u = (a.u + b.u + c.u) / 3, v = (a.v + b.v + c.v) / 3;
            FUZZ_CHECK(curveIndex(u, v, t.level) == k);
            FUZZ_CHECK(static_cast<uint32_t>(library.stateAt(0, u, v)) == sourceState(model, i, k));
        }
    }
}

void checkStaysInside(std::span<const uint8_t> micromap)
{
    const uint32_t triangles = wordAt(micromap, kMicromapHeaderTriangles * 4);
    for (uint32_t i = 0; i < triangles; ++i) {
        const uint32_t word0 = wordAt(micromap, 64 + uint64_t{i} * 8);
        const uint32_t kind = word0 & 31;
        if (kind == 0)
            continue;
        const Data data = dataOf(word0, wordAt(micromap, 64 + uint64_t{i} * 8 + 4));
        const uint64_t end = data.begin + (uint64_t{stateCount(data.level)} * data.bits + 7) / 8;
        FUZZ_CHECK(end <= uint64_t{wordAt(micromap, kMicromapHeaderUnits * 4)} * 16);
        FUZZ_CHECK(unitsBegin(micromap) + end <= micromap.size());
    }
}

} // namespace vellum::fuzz
