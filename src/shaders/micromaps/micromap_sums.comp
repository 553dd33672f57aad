// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build that shares identical data: counts the data units of each block of kPlaceBlock triangles.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"

shared uint total;

void main()
{
    const uint block = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (gl_LocalInvocationIndex == 0u)
        total = 0u;
    barrier();
    const uint run = kPlaceBlock / gl_WorkGroupSize.x;
    const uint first = block * kPlaceBlock + gl_LocalInvocationIndex * run;
    uint sum = 0u; // at most kPlaceBlock * 2^18 in a block
    for (uint t = first; t < min(first + run, push.triangleCount); ++t) {
        if ((recordOf(t).w[0] & kKindMask) == kKindInline || ownerOf(t) != t)
            continue;
        sum += unitsOf(readSource(t));
    }
    atomicAdd(total, sum);
    barrier();
    if (gl_LocalInvocationIndex == 0u && block * kPlaceBlock < push.triangleCount)
        Words(sumsAddress()).w[block] = total;
}
