// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build, one workgroup: turns the sums of the blocks into exclusive prefix sums, and writes the micromap's header.
// Sums saturate beyond the capacity: data there is rejected, however far beyond it is.
const uint kThreads = 128u; // the least maxComputeWorkGroupInvocations
layout(local_size_x = kThreads) in;

#include "micromap_source.glsl"

shared uint sums[kThreads];

void main()
{
    const uint me = gl_LocalInvocationIndex;
    const uint blocks = verbatim() ? 0u : (push.triangleCount + kPlaceBlock - 1u) / kPlaceBlock;
    const uint run = (blocks + kThreads - 1u) / kThreads;
    const uint first = min(me * run, blocks);
    const uint last = min(first + run, blocks);
    const uint limit = push.capacityUnits + 1u;
    Words table = Words(sumsAddress());
    uint sum = 0u;
    for (uint b = first; b < last; ++b)
        sum = min(sum + table.w[b], limit);
    sums[me] = sum;
    barrier();
    for (uint step = 1u; step < kThreads; step *= 2u) {
        const uint other = me >= step ? sums[me - step] : 0u;
        barrier();
        sums[me] = min(sums[me] + other, limit);
        barrier();
    }
    sum = me > 0u ? sums[me - 1u] : 0u;
    for (uint b = first; b < last; ++b) {
        const uint own = table.w[b];
        table.w[b] = min(sum, push.capacityUnits);
        sum = min(sum + own, limit);
    }
    if (me != kThreads - 1u)
        return;
    const uint units = verbatim() ? Words(push.scratch).w[kScratchLastUnit] : min(sums[kThreads - 1u], push.capacityUnits);
    Words header = Words(push.micromap);
    header.w[kMicromapHeaderMagic] = kMicromapMagic;
    header.w[kMicromapHeaderTriangles] = push.triangleCount;
    header.w[kMicromapHeaderUnits] = units;
    header.w[kMicromapHeaderFlags] = push.flags & kBuildFlagsMask;
    for (uint i = kMicromapHeaderFlags + 1u; i < kMicromapHeaderWords; ++i)
        header.w[i] = 0u;
    // The record that pads their number to an even one.
    if ((push.triangleCount & 1u) != 0u) {
        Words padding = recordOf(push.triangleCount);
        padding.w[0] = 0u;
        padding.w[1] = 0u;
    }
    if (push.triangleCount > 0u) // without triangles there need not be scratch memory
        Words(push.scratch).w[kScratchPartCount] = 0u;
}
