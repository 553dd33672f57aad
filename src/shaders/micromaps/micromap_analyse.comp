// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build that shares identical data, first pass, one invocation per triangle: computes coarse mask and hash.
// micromap_parts.comp does this for triangles with many units.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "micromap_data.glsl"

void main()
{
    const uint triangle = globalInvocation();
    if (triangle >= push.triangleCount)
        return;
    Source s = readSource(triangle);
    const uint units = unitsOf(s);
    uint word0 = kKindInline;
    uint word1 = 0u;
    uint hash = 0u;
    if (!s.valid) {
        word0 = kRejected;
        word1 = ~0u;
    } else if (units == 0u) {
        word1 = coarseStates(s);
    } else {
        word0 = kKindData + kindOf(s);
        if (units > kPartUnits) {
            // Which triangle finds the list full differs from run to run: micromap_share.comp then rejects all of them.
            if (!listParts(triangle, units))
                Words(push.scratch).w[kScratchPartsFull] = 1u;
        } else {
            const Walk walk = walkUnits(s, 0u, units);
            word1 = walk.gathered;
            hash = walk.hash;
        }
    }
    Words record = recordOf(triangle);
    record.w[0] = word0;
    record.w[1] = word1;
    Words(hashesAddress()).w[triangle] = hash;
}
