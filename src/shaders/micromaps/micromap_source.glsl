// SPDX-License-Identifier: Apache-2.0
// The application's input of a micromap build, and the locations of its triangles. Included by all passes of the build.
#include "shared.h"
#include "curve.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/micromap_layout.glsl"

layout(push_constant, std430) uniform Push
{
    MicromapPush push;
};

// Word 0 of the record of an invalid triangle, which is unknown-opaque. No later pass changes it.
const uint kRejected = kKindInline | ~kKindMask;

struct Source {
    bool valid;
    uint dataOffset;
    uint level;
    uint bitsPerState; // 1 or 2
};

uint sourceBytes(uint level, uint bitsPerState)
{
    return (bitsPerState << (2u * level)) + 7u >> 3u;
}

// Reads one triangle, and checks what would read or write outside the buffers.
Source readSource(uint triangle)
{
    Source s;
    s.valid = false;
    s.dataOffset = 0u;
    s.level = 0u;
    s.bitsPerState = 1u;
    if (triangle >= push.readable)
        return s;
    const uvec2 address = elementAddress(push.triangleArray, triangle, push.triangleArrayStride);
    uint levelAndFormat;
    if (((push.triangleArray.x | push.triangleArrayStride) & 3u) == 0u) {
        Words words = Words(address);
        s.dataOffset = words.w[0];
        levelAndFormat = words.w[1];
    } else {
        s.dataOffset = loadBytes(address, 4u);
        levelAndFormat = loadBytes(addressPlus(address, 4u), 4u);
    }
    s.level = levelAndFormat & 0xffffu;
    s.bitsPerState = levelAndFormat >> 16u; // VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT is 1, 4_STATE 2
    if (s.bitsPerState - 1u > 1u || s.level > min(kMaxSubdivisionLevel, (push.flags >> kBuildMaxLevelShift) & 15u))
        return s;
    const uint bytes = sourceBytes(s.level, s.bitsPerState);
    s.valid = bytes <= push.dataBytes && s.dataOffset <= push.dataBytes - bytes;
    return s;
}

uint unitsOf(Source s)
{
    if (!s.valid || s.level <= kCoarseLevel)
        return 0u;
    return (sourceBytes(s.level, s.bitsPerState) + kDataUnitBytes - 1u) / kDataUnitBytes;
}

// The kind of a triangle's data, less kKindData: the low bits of word 0 of its record.
uint kindOf(Source s)
{
    return (s.level - kCoarseLevel - 1u) * 2u + (s.bitsPerState - 1u);
}

Words recordOf(uint triangle)
{
    return micromapRecord(push.micromap, triangle);
}

// The alignment of data in place: the data of level 3 of the 2-state format can be either half of a data unit.
uint alignmentInPlace(uint level, uint bitsPerState)
{
    return level == kCoarseLevel + 1u && bitsPerState == 1u ? kDataUnitBytes / 2u : kDataUnitBytes;
}

// Returns whether a triangle can use its data in place.
bool fitsInPlace(Source s)
{
    const uint units = unitsOf(s);
    return units == 0u || ((s.dataOffset & (alignmentInPlace(s.level, s.bitsPerState) - 1u)) == 0u &&
                           (s.dataOffset >> 4u) + units <= push.capacityUnits);
}

// kindOf() of data in place.
uint kindInPlace(Source s)
{
    return kindOf(s) + ((s.dataOffset & 15u) != 0u ? kKindUpperHalf : 0u);
}

// Returns whether every triangle uses its data in place; known after micromap_check.comp.
bool verbatim()
{
    return (push.flags & kBuildVerbatim) != 0u && Words(push.scratch).w[kScratchElsewhere] == 0u;
}

// The coarse mask by which lookup reads the data of every sub-triangle of level 2; the build need not read the data for it.
const uint kLookEverywhere = 0xaaaaaaaau;

// Tables of the scratch memory.
uvec2 sumsAddress()
{
    return addressPlus(push.scratch, kScratchTables * 4u);
}

uvec2 partsAddress()
{
    return elementAddress(sumsAddress(), (push.triangleCount + kPlaceBlock - 1u) / kPlaceBlock, 4u);
}

uvec2 hashesAddress()
{
    return elementAddress(partsAddress(), push.partCapacity, 8u);
}

uvec2 slotsAddress()
{
    return elementAddress(hashesAddress(), push.triangleCount, 4u);
}

uvec2 tableAddress()
{
    return elementAddress(slotsAddress(), push.triangleCount, 4u);
}

// The triangle whose data a triangle uses: the lowest of those with the same data; itself, unless data is shared and the
// tables are filled.
uint ownerOf(uint triangle)
{
    if ((push.flags & kBuildShare) == 0u)
        return triangle;
    const uint slot = Words(slotsAddress()).w[triangle];
    return slot == kNoSlot ? triangle : Words(tableAddress()).w[slot] - 1u;
}

// Puts a triangle with so many units on the list of parts, which other invocations process. False if the list is full:
// then there is more data than the usage counts declare.
bool listParts(uint triangle, uint units)
{
    const uint parts = (units + kPartUnits - 1u) / kPartUnits;
    const uint first = atomicAdd(Words(push.scratch).w[kScratchPartCount], parts);
    Words list = Words(partsAddress());
    for (uint i = 0u; i < parts && first + i < push.partCapacity; ++i) {
        list.w[2u * (first + i)] = triangle;
        list.w[2u * (first + i) + 1u] = i;
    }
    return first <= push.partCapacity && parts <= push.partCapacity - first;
}

// The workgroup size must be declared before this file is included: otherwise the constant gl_WorkGroupSize is 1, without an
// error.
uint globalInvocation()
{
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return group * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}
