// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build that shares identical data, one workgroup: turns the sums of the blocks into exclusive prefix sums, and writes
// the micromap's header. Sums saturate beyond the capacity: data there is rejected, however far beyond it is.
const uint kThreads = 128u; // the least maxComputeWorkGroupInvocations
layout(local_size_x = kThreads) in;

#include "micromap_source.glsl"

shared uint sums[kThreads];

void main()
{
    const uint me = gl_LocalInvocationIndex;
    const uint run = (blocks() + kThreads - 1u) / kThreads;
    const uint first = min(me * run, blocks());
    const uint last = min(first + run, blocks());
    const uint limit = push.capacityUnits + 1u;
    Words table = Words(sumsAddress());
    uint sum = 0u;
    for (uint b = first; b < last; ++b)
        sum = min(sum + table.w[b], limit);
    sums[me] = sum;
    barrier();
    // Not by steps with barriers between: a CPU driver takes four times as long to compile this with barriers in a loop.
    sum = 0u;
    for (uint i = 0u; i < me; ++i)
        sum += min(sums[i], limit - sum);
    for (uint b = first; b < last; ++b) {
        const uint own = table.w[b];
        table.w[b] = min(sum, push.capacityUnits);
        sum = min(sum + own, limit);
    }
    if (me != kThreads - 1u)
        return;
    writeHeader(min(sum, push.capacityUnits));
    Words(push.scratch).w[kScratchPartCount] = 0u;
}
