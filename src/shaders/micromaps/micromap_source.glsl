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

// Word 0 of the record of an invalid triangle, which is unknown-opaque.
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
    Words words = Words(uvec2(address.x & ~3u, address.y));
    const uint shift = (address.x & 3u) * 8u;
    uvec2 triangleWords = uvec2(words.w[0], words.w[1]);
    if (shift != 0u)
        triangleWords = triangleWords >> shift | uvec2(triangleWords.y, words.w[2]) << 32u - shift;
    s.dataOffset = triangleWords.x;
    const uint levelAndFormat = triangleWords.y;
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

// The sixteen states of level 2 of a triangle of level 0 to 2, two bits each.
uint coarseStates(Source s)
{
    const uint bits = s.bitsPerState << (2u * s.level);
    uint x = loadBytes(addressPlus(push.data, s.dataOffset), bits + 7u >> 3u);
    x = bits >= 32u ? x : x & ((1u << bits) - 1u);
    if (s.bitsPerState == 1u) {
        x = (x | x << 8u) & 0x00ff00ffu;
        x = (x | x << 4u) & 0x0f0f0f0fu;
        x = (x | x << 2u) & 0x33333333u;
        x = (x | x << 1u) & 0x55555555u;
    }
    if (s.level == 0u)
        return x * 0x55555555u;
    if (s.level == 1u)
        return ((x & 3u) | (x >> 2u & 3u) << 8u | (x >> 4u & 3u) << 16u | (x >> 6u & 3u) << 24u) * 0x55u;
    return x;
}

// The record of a triangle without data units.
uvec2 recordWithoutData(Source s)
{
    return s.valid ? uvec2(kKindInline, coarseStates(s)) : uvec2(kRejected, ~0u);
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

// The coarse mask by which lookup reads the data of every sub-triangle of level 2; the build need not read the data for it.
const uint kLookEverywhere = 0xaaaaaaaau;

void storeRecord(uint triangle, uvec2 record)
{
    Words words = recordOf(triangle);
    words.w[0] = record.x;
    words.w[1] = record.y;
}

// The record of data at a byte of the micromap's data, with a coarse mask, which is omitted if the data is far.
uvec2 recordAt(uint kind, uint unit, uint byte, uint mask)
{
    const bool near = byte == 0u && unit <= kMaxNearUnit;
    return near ? uvec2((kKindData + kind) | unit << kUnitShift, mask)
                : uvec2(kKindFar | kind << kUnitShift | byte << kFarByteShift, unit);
}

// Writes the micromap's header, and the record that pads their number to an even one.
void writeHeader(uint units)
{
    Words header = Words(push.micromap);
    header.w[kMicromapHeaderMagic] = kMicromapMagic;
    header.w[kMicromapHeaderTriangles] = push.triangleCount;
    header.w[kMicromapHeaderUnits] = units;
    header.w[kMicromapHeaderFlags] = push.flags & kBuildFlagsMask;
    for (uint i = kMicromapHeaderFlags + 1u; i < kMicromapHeaderWords; ++i)
        header.w[i] = 0u;
    if ((push.triangleCount & 1u) != 0u)
        storeRecord(push.triangleCount, uvec2(0u));
}

uint blocks()
{
    return (push.triangleCount + kPlaceBlock - 1u) / kPlaceBlock;
}

// Tables of the scratch memory.
uvec2 sumsAddress()
{
    return addressPlus(push.scratch, kScratchTables * 4u);
}

uvec2 partsAddress()
{
    return elementAddress(sumsAddress(), blocks(), 4u);
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
