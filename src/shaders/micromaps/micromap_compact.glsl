// SPDX-License-Identifier: Apache-2.0
// Compaction of a micromap (core/compaction.h), by a query of the compacted size and by a compacting copy. Both only read the
// micromap: others may use it at the same time. Included by all passes; each invocation processes every push.invocations-th
// triangle, because only the device knows how many there are.
#include "shared.h"
#include "curve.h"
#include "records.h"
#include "compaction.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/micromap_layout.glsl"

layout(push_constant, std430) uniform Push
{
    MicromapCompactPush push;
};

layout(buffer_reference, std430, buffer_reference_align = 16) buffer Quads { uvec4 at[]; };

// The workgroup size must be declared before this file is included.
uint globalInvocation()
{
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return group * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

// Triangles of the micromap; 0 if it is copied as it is.
uint compactedTriangles()
{
    if (!holdsMicromap(push.source, push.sourceUnits))
        return 0u;
    Words header = Words(push.source);
    const uint triangles = header.w[kMicromapHeaderTriangles];
    const bool compacts = (header.w[kMicromapHeaderFlags] & kBuildAllowsCompaction) != 0u &&
                          header.w[kMicromapHeaderCompacted] == 0u && triangles <= push.most;
    return compacts ? triangles : 0u;
}

uint blocksOf(uint triangles)
{
    return (triangles + kPlaceBlock - 1u) / kPlaceBlock;
}

// Tables of the scratch memory.
uvec2 sumsAddress()
{
    return addressPlus(push.scratch, kCompactionTables * 4u);
}

uvec2 partsAddress(uint triangles)
{
    return elementAddress(sumsAddress(), blocksOf(triangles), 4u);
}

uvec2 trianglesAddress(uint triangles)
{
    return elementAddress(partsAddress(triangles), push.partCapacity, 8u);
}

uvec2 tablesAddress(uint triangles)
{
    return elementAddress(trianglesAddress(triangles), triangles, kTriangleWords * 4u);
}

// The words of a triangle: hash or units, mask, owner.
Words wordsOf(uint triangles, uint triangle)
{
    return Words(elementAddress(trianglesAddress(triangles), triangle, kTriangleWords * 4u));
}

uvec2 recordOf(uint triangle)
{
    return pairAt(addressPlus(push.source, kMicromapHeaderWords * 4u), triangle);
}

struct Data {
    uint units; // 0: there is no data, and the others are undefined
    uint kind;
    uint level;
    uint bitsPerState; // 1 or 2
    uint location; // byte in the micromap's data units, modulo 2^32
    uvec2 address;
};

Data dataOf(uint triangles, uvec2 record)
{
    Data d;
    d.units = 0u;
    d.kind = 0u;
    d.level = kCoarseLevel + 1u;
    d.bitsPerState = 1u;
    d.location = 0u;
    d.address = push.source;
    const uint kind = record.x & kKindMask;
    if (kind == kKindInline)
        return d;
    const bool far = kind == kKindFar;
    d.kind = far ? record.x >> kUnitShift & kKindMask : kind - kKindData;
    d.level = kCoarseLevel + 1u + (d.kind >> 1u);
    d.bitsPerState = 1u + (d.kind & 1u);
    d.units = max((d.bitsPerState << (2u * d.level)) >> 7u, 1u);
    const uint unit = far ? record.y : record.x >> kUnitShift;
    const uint byte = far ? record.x >> kFarByteShift & kFarByteMask : 0u;
    d.location = unit * kDataUnitBytes + byte;
    d.address = addressPlus(elementAddress(micromapUnits(push.source, triangles), unit, kDataUnitBytes), byte);
    return d;
}

// Bytes of each of its units: 8 if it has only so many.
uint unitBytes(Data d)
{
    return min((d.bitsPerState << (2u * d.level)) >> 3u, kDataUnitBytes);
}

// Puts a triangle with many units on the list of parts, which other invocations process. False if the list is full.
bool listParts(uint triangles, uint triangle, uint units)
{
    Words counter = Words(push.scratch);
    if (units <= kPartUnits || atomicAdd(counter.w[kCompactionParts], 0u) >= push.partCapacity)
        return false; // a full list is not added to, so that the number does not overflow
    const uint parts = units / kPartUnits;
    const uint first = atomicAdd(counter.w[kCompactionParts], parts);
    const bool fits = first <= push.partCapacity && parts <= push.partCapacity - first;
    Words list = Words(partsAddress(triangles));
    for (uint i = 0u; i < parts && first + i < push.partCapacity; ++i) {
        list.w[2u * (first + i)] = fits ? triangle : kNoTriangle;
        list.w[2u * (first + i) + 1u] = i;
    }
    return fits;
}

// What an invocation processes: a triangle, or the units of one of its parts.
struct Item {
    uint triangle; // kNoTriangle: nothing
    uint first;
};

bool ofParts()
{
    return push.pass == kCompactAnalyseParts || push.pass == kCompactWriteParts;
}

uint itemCount(uint triangles)
{
    return ofParts() ? min(Words(push.scratch).w[kCompactionParts], push.partCapacity) : triangles;
}

Item itemAt(uint triangles, uint i)
{
    if (!ofParts())
        return Item(i, 0u);
    Words list = Words(partsAddress(triangles));
    return Item(list.w[2u * i], list.w[2u * i + 1u] * kPartUnits);
}

// A data unit at an address that is a multiple of 4; `bytes` is 8 or 16.
uvec4 loadAlignedUnit(uvec2 address, uint bytes)
{
    Words words = Words(address);
    uvec4 v = uvec4(words.w[0], words.w[1], 0u, 0u);
    if (bytes == 16u)
        v.zw = uvec2(words.w[2], words.w[3]);
    return v;
}

// Loads a unit at any other address. Reads only words that hold one of the bytes.
uvec4 loadShiftedUnit(uvec2 address, uint bytes)
{
    const uint shift = (address.x & 3u) * 8u;
    const uvec2 aligned = uvec2(address.x & ~3u, address.y);
    const uvec4 v = loadAlignedUnit(aligned, bytes);
    const uint last = Words(aligned).w[bytes >> 2u];
    const uvec4 next = bytes == 16u ? uvec4(v.yzw, last) : uvec4(v.y, last, 0u, 0u);
    const uvec4 both = v >> shift | next << (32u - shift);
    return bytes == 16u ? both : uvec4(both.xy, 0u, 0u);
}

uvec4 loadUnit(uvec2 address, uint bytes)
{
    return (address.x & 3u) == 0u ? loadAlignedUnit(address, bytes) : loadShiftedUnit(address, bytes);
}
