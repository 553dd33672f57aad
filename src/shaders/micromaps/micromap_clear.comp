// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build: clears the counters and tables that the other passes add to.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"

void main()
{
    const uint i = globalInvocation();
    if ((push.flags & kBuildShare) != 0u && i <= push.tableMask)
        Words(tableAddress()).w[i] = 0u;
    if (i < kScratchCounterWords)
        Words(push.scratch).w[i] = 0u;
}
