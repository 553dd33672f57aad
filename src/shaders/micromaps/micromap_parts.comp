// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build that shares identical data, one invocation for each part of the triangles on the list: analyses the part, or
// copies it to its data units.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "micromap_data.glsl"

void main()
{
    const uint i = globalInvocation();
    if (i >= min(Words(push.scratch).w[kScratchPartCount], push.partCapacity))
        return;
    const uint triangle = Words(partsAddress()).w[2u * i];
    const uint part = Words(partsAddress()).w[2u * i + 1u];
    const Source s = readSource(triangle);
    Words record = recordOf(triangle);
    const uint word0 = record.w[0];
    if (!s.valid || word0 == kRejected)
        return;
    const uint first = part * kPartUnits;
    const uint last = min(first + kPartUnits, unitsOf(s));
    if ((push.flags & kBuildAnalysing) == 0u) {
        const uint unit = (word0 & kKindMask) == kKindFar ? record.w[1] : word0 >> kUnitShift;
        copyUnits(s, first, last, 1u, elementAddress(micromapUnits(push.micromap, push.triangleCount), unit, kDataUnitBytes));
        return;
    }
    const Walk walk = walkUnits(s, first, last);
    atomicAdd(Words(hashesAddress()).w[triangle], walk.hash);
    atomicOr(record.w[1], walk.gathered);
}
