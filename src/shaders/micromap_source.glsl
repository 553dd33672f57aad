// The application's input of a micromap build, and where its triangles go. Included by both passes of the build.
#include "shared.h"
#include "curve.h"
#include "records.h"
#include "memory.glsl"
#include "micromap_layout.glsl"

layout(push_constant, std430) uniform Push
{
    uvec2 micromap;      // destination
    uvec2 triangleArray; // VkMicromapTriangleEXT, each triangleArrayStride bytes
    uvec2 data;
    uint triangleArrayStride;
    uint triangleCount; // records in the destination
    uint readable;      // elements of triangleArray that lie inside its buffer
    uint dataBytes;     // bytes of data that lie inside its buffer
    uint capacityUnits; // data units in the destination
} push;

// A record that no pass may change any more: its input was wrong, and unknown is the one safe answer.
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

Source readSource(uint triangle)
{
    Source s;
    s.valid = false;
    if (triangle >= push.readable)
        return s;
    const uvec2 address = elementAddress(push.triangleArray, triangle, push.triangleArrayStride);
    s.dataOffset = loadBytes(address, 4u);
    const uint levelAndFormat = loadBytes(addressPlus(address, 4u), 4u);
    s.level = levelAndFormat & 0xffffu;
    s.bitsPerState = levelAndFormat >> 16u; // VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT is 1, 4_STATE 2
    if (s.level > kMaxSubdivisionLevel || s.bitsPerState < 1u || s.bitsPerState > 2u)
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

Words recordOf(uint triangle)
{
    return micromapRecord(push.micromap, triangle);
}
