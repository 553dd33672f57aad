// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Lossy micromap build: clears the counters that the other passes add to.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"

void main()
{
    const uint i = globalInvocation();
    if (i < kScratchCounterWords)
        Words(push.scratch).w[i] = 0u;
}
