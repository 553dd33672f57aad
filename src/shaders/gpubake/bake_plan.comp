// SPDX-License-Identifier: Apache-2.0
// Reads each triangle's texture coordinates, chooses its level, and finds those that are one state because no cell
// around them is another.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_scratch.glsl"
#include "opacity.h"
#include "gpubake/bake_word.glsl"

layout(local_size_x = 64) in;

// The vertex of a corner; one that does not exist where the index is out of range.
uint vertexOf(uint triangle, uint corner)
{
    const uint at = triangle * 3u + corner;
    const uint bytes = SCRATCH(kBakeIndexBytes);
    if (bytes == 0u)
        return at;
    return loadBytes(elementAddress(readable(scratchAddress(kBakeIndices), push.scratch), at, bytes), bytes);
}

vec2 uvOf(uint vertex)
{
    const uvec2 at = elementAddress(scratchAddress(kBakeUvs), vertex, SCRATCH(kBakeUvStride));
    const uint format = SCRATCH(kBakeUvFormat);
    const uint low = loadBytes(at, 4u);
    if (format == kBakeUvFloat)
        return uintBitsToFloat(uvec2(low, loadBytes(addressPlus(at, 4u), 4u)));
    if (format == kBakeUvUnorm16)
        return vec2(low & 0xffffu, low >> 16u) / 65535.0;
    // unpackHalf2x16 may flush denormal numbers, which are up to 2^-14 here.
    vec2 uv = unpackHalf2x16(low);
    for (uint i = 0u; i < 2u; ++i) {
        const uint bits = low >> (16u * i);
        if ((bits & 0x7c00u) == 0u)
            uv[i] = float(bits & 0x3ffu) * ((bits & 0x8000u) != 0u ? -1.0 : 1.0) / 16777216.0;
    }
    return uv;
}

uint levelOf(Uvs uvs, uvec2 size)
{
    const uint most = SCRATCH(kBakeLevel);
    if (!flagSet(kBakeAutomatic))
        return most;
    const vec2 i = (uvs.b - uvs.a) * vec2(size);
    const vec2 j = (uvs.c - uvs.a) * vec2(size);
    const float area = abs(i.x * j.y - i.y * j.x);
    float enough = scratchFloat(kBakeTexelsPerEdge);
    uint level = 0u;
    for (; level < most && area > enough; ++level)
        enough *= 4.0;
    return level;
}

void main()
{
    const uint triangle = INVOCATION;
    if (triangle >= SCRATCH(kBakeTriangles))
        return;
    loadAlpha();
    const uint at = triangleAt(triangle);
    bool known = true;
    Uvs uvs = Uvs(vec2(0.0), vec2(0.0), vec2(0.0));
    for (uint corner = 0u; corner < 3u; ++corner) {
        const uint vertex = vertexOf(triangle, corner);
        if (vertex >= SCRATCH(kBakeVertices)) {
            known = false;
            break;
        }
        const vec2 uv = uvOf(vertex);
        SCRATCH(at + 2u * corner) = floatBitsToUint(uv.x);
        SCRATCH(at + 2u * corner + 1u) = floatBitsToUint(uv.y);
        if (corner == 0u)
            uvs.a = uv;
        else if (corner == 1u)
            uvs.b = uv;
        else
            uvs.c = uv;
    }
    const uvec2 size = uvec2(SCRATCH(kBakeWidth), SCRATCH(kBakeHeight));
    uint flags = kMayBeBoth;
    uint level = flagSet(kBakeAutomatic) ? 0u : SCRATCH(kBakeLevel);
    known = known && usable(uvs, size);
    if (known) {
        level = levelOf(uvs, size);
        flags = 0u;
        for (uint number = 0u; number < SCRATCH(kBakeMips); ++number) {
            const Mip mip = makeMip(number);
            const Placement p = place(uvs, mip, 0u);
            // With tolerances of millions of texels no state can be known, and coordinates would exceed integers.
            if (!all(lessThan(p.margin, vec2(4194304.0)))) {
                known = false;
                break;
            }
            const ivec4 box = cellsAround(shapeAt(p, 0, 0, 1));
            flags |= boxFlags(mip, box.xy, box.zw);
        }
    }
    flags = known ? flags : kMayBeBoth;
    const bool resolved = flags != kMayBeBoth || !known;
    SCRATCH(at + kBakeInfo) = level | (resolved ? kBakeInfoResolved : 0u);
    SCRATCH(at + kBakeStates) = resolved ? 1u << stateOf(flags, true) : 0u;
}
