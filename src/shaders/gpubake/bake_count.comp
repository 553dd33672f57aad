// SPDX-License-Identifier: Apache-2.0
// Counts the triangles of a list by level, for each block of triangles.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_list.glsl"

layout(local_size_x = 128) in;

shared uint counts[16];

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    if (lane < 16u)
        counts[lane] = 0u;
    barrier();
    const uint level = listedLevel(INVOCATION);
    if (level != kNotListed)
        atomicAdd(counts[level], 1u);
    barrier();
    const uint triangles = SCRATCH(kBakeTriangles);
    if (lane < 16u && workgroup() < bakeBlocks(triangles))
        SCRATCH(bakeBlockStart(triangles) + workgroup() * 16u + lane) = counts[lane];
}
