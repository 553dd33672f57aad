// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build without sharing, after micromap_parts.comp: turns the gathered bits of the triangles on the list of parts
// into coarse masks.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "micromap_data.glsl"

void main()
{
    const uint i = globalInvocation();
    if (i >= min(Words(push.scratch).w[kScratchPartCount], push.partCapacity))
        return;
    if (Words(partsAddress()).w[2u * i + 1u] != 0u)
        return;
    Words record = recordOf(Words(partsAddress()).w[2u * i]);
    const uint word0 = record.w[0];
    if (word0 == kRejected || (word0 & kKindMask) == kKindFar)
        return;
    const uint mask = coarseMask(record.w[1]);
    record.w[1] = mask;
    if (describesAll(mask))
        record.w[0] = kKindInline;
}
