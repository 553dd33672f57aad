// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build, one invocation for each part of the triangles on the list: analyses the part, or copies it to its data
// units.
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
    const uint units = unitsOf(s);
    const bool analysing = (push.flags & kBuildAnalysing) != 0u;
    const bool far = (word0 & kKindMask) == kKindFar;
    uvec2 target = uvec2(0u);
    if (!analysing) {
        const uint unit = far ? record.w[1] : word0 >> kUnitShift;
        target = elementAddress(micromapUnits(push.micromap, push.triangleCount), unit, kDataUnitBytes);
    }
    const Walk walk = walkUnits(s, part * kPartUnits, min((part + 1u) * kPartUnits, units), !analysing, target);
    if (analysing)
        atomicAdd(Words(hashesAddress()).w[triangle], walk.hash);
    if (analysing || (!far && (push.flags & kBuildShare) == 0u))
        atomicOr(record.w[1], walk.gathered);
}
