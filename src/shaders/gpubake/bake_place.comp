// SPDX-License-Identifier: Apache-2.0
// Puts each triangle of the list in its place; of the second list, also its record and its index, and the special
// indices of those that are not on it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_list.glsl"

layout(local_size_x = 128) in;

shared uint levels[kBakeBlock];

void setSpecialIndex(uint triangle, uint state)
{
    Words(scratchAddress(kBakeSpecialIndices)).w[triangle] = ~state;
    const uint ignored = atomicAdd(SCRATCH(kBakeSpecials + state), 1u);
}

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    const uint triangle = INVOCATION;
    const uint level = listedLevel(triangle);
    levels[lane] = level;
    barrier();
    const uint triangles = SCRATCH(kBakeTriangles);
    if (triangle >= triangles)
        return;
    if (level == kNotListed) {
        if (push.first != 0u)
            setSpecialIndex(triangle, uint(findLSB(statesOf(triangle))));
        return;
    }
    uint rank = SCRATCH(bakeBlockStart(triangles) + workgroup() * 16u + level);
    for (uint i = 0u; i < lane; ++i)
        rank += levels[i] == level ? 1u : 0u;
    uint before = 0u; // listed triangles of lower levels
    for (uint i = 0u; i < level; ++i)
        before += SCRATCH(kBakeWork + i);
    if (push.first != 0u) {
        if (rank >= SCRATCH(kBakeWork + level)) {
            setSpecialIndex(triangle, kStateUnknownOpaque);
            return;
        }
        uint record = rank;
        for (uint i = 0u; i < level; ++i)
            record += SCRATCH(kBakeCapacity + i);
        Words(scratchAddress(kBakeSpecialIndices)).w[triangle] = record;
    }
    SCRATCH(bakeListStart(triangles) + before + rank) = triangle;
}
