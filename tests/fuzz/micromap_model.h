// SPDX-License-Identifier: Apache-2.0
// The expected result of a micromap build. It is written from the specification, docs/design/structures.md and
// core/records.h, and on purpose shares no code with the layer.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace vellum::fuzz
{

struct SourceTriangle {
    uint32_t dataOffset = 0;
    uint16_t level = 0;
    uint16_t format = 0;
};
static_assert(sizeof(SourceTriangle) == 8);

// A build's input without the array that the triangles lie in.
struct BuildModel {
    std::vector<SourceTriangle> triangles;
    uint32_t readable = UINT32_MAX; // triangles that may be read
    std::span<const uint8_t> data;
    uint32_t capacityUnits = 0;
    uint32_t maxLevel = 12;
};

// For each triangle, whether all of it is unknown-opaque: the input is invalid, or the data does not fit.
std::vector<bool> unknownOf(const BuildModel &model);

// Bytes of data of a triangle, and 16-byte units that it takes of a micromap.
uint64_t dataBytes(const SourceTriangle &triangle);
uint64_t dataUnits(const SourceTriangle &triangle);
// The state of one micro-triangle, by the data as the application gave it.
uint32_t sourceState(const BuildModel &model, uint32_t triangle, uint32_t index);

// The state that a lookup finds at micro-triangle `index` of `level`. Fails the run where the micromap has it nowhere
// in the bytes that are in use, or where it is not the same in all of the micro-triangle.
uint32_t builtState(std::span<const uint8_t> micromap, uint32_t triangle, uint32_t level, uint32_t index);

// Compares all that was built with what it was built from, and the library's curve and model with them.
void checkBuilt(const BuildModel &model, std::span<const uint8_t> micromap);
// Checks that no lookup leaves a micromap whose records are arbitrary bytes.
void checkStaysInside(std::span<const uint8_t> micromap);

} // namespace vellum::fuzz
