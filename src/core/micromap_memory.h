// SPDX-License-Identifier: Apache-2.0
// A micromap as it lies in memory (records.h), written by the host: the twin of the build's shaders, bit for bit.
#pragma once

#include <cstdint>
#include <vector>

#include "core/records.h"

namespace vellum
{

// The input of a build, as VkMicromapBuildInfoEXT gives it.
struct MicromapBuildInput {
    const uint8_t *triangles = nullptr; // VkMicromapTriangleEXT, each `stride` bytes
    uint64_t stride = 8;
    uint32_t triangleCount = 0;
    uint32_t readable = 0xffffffffu; // triangles that may be read
    const uint8_t *data = nullptr;
    uint64_t dataBytes = 0xffffffffu; // bytes of data that may be read, at most 2^32 - 1 of which are used
    uint32_t capacityUnits = 0;       // data units by the usage counts
    uint32_t maxLevel = 0;            // highest level of the usage counts
    uint32_t buildFlags = 0;          // VkBuildMicromapFlagsEXT, kept in the header
    // Bytes of data that the device copies to where data goes, before it knows whether they can stay there. Only to
    // write what the device does where no triangle has its data, too.
    uint64_t copiedAhead = 0;
};

// Bytes in use of a micromap of that many triangles and data units.
constexpr uint64_t micromapMemoryBytes(uint64_t triangles, uint64_t units)
{
    return shared::kMicromapHeaderWords * 4ull + (triangles + 1) / 2 * 16 + units * shared::kDataUnitBytes;
}

// Writes a micromap to `out`, which has a capacity of micromapMemoryBytes(triangleCount, capacityUnits) bytes. What
// lies behind the units in use, and between data that stay where they lie, stays as it is. Triangles whose input is
// wrong become unknown-opaque.
void writeMicromapMemory(const MicromapBuildInput &input, uint8_t *out);

// Bytes in use of the micromap at `memory`; 0 if there is none.
uint64_t micromapMemoryInUse(const uint8_t *memory);

struct CompactedTriangle; // micromap_memory.cpp

// The compacted copy of a micromap (core/compaction.h). Uniform triangles take no data, and identical data is kept
// once. A micromap that was built without VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT, or that would not become smaller,
// is copied as it is.
class CompactedMicromap
{
public:
    // `memory` must stay as it is until the copy is written.
    explicit CompactedMicromap(const uint8_t *memory);
    ~CompactedMicromap();
    CompactedMicromap(const CompactedMicromap &) = delete;
    CompactedMicromap &operator=(const CompactedMicromap &) = delete;

    [[nodiscard]] uint64_t bytes() const { return bytes_; }
    void write(uint8_t *out) const;

private:
    const uint8_t *memory_;
    uint64_t bytes_;
    std::vector<CompactedTriangle> triangles_; // none if it is copied as it is
};

// Makes every record of a micromap that points outside the micromap's own units unknown.
void distrustMicromapRecords(uint8_t *memory);

} // namespace vellum
