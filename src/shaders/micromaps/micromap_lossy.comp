// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Lossy micromap build, first pass, one invocation per triangle: chooses its level and coarsens its data.
// micromap_lossy_parts.comp does this for triangles with many units.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "opacity.h"
#include "micromap_lossy.glsl"

uint levelFor(Source s, uvec2 data)
{
    if (s.bitsPerState == 1u)
        return s.level;
    const Measured found = measure(data, 0u, sourceBytes(s.level, 2u) >> 2u);
    uint best = 0u;
    uint least = ~0u;
    for (uint k = 0u; k <= s.level - kCoarseLevel; ++k) {
        const uint cost = costOf(s.level, k, found.known[0], found.known[k]);
        best = cost <= least ? k : best;
        least = min(cost, least);
    }
    return s.level - best;
}

void main()
{
    const uint triangle = globalInvocation();
    if (triangle >= push.triangleCount)
        return;
    Source s = readSource(triangle);
    const uint units = unitsOf(s);
    const uvec2 data = addressPlus(push.data, s.dataOffset);
    if (units > kPartUnits) {
        if (!listParts(triangle, units))
            s.valid = false;
        // 4-state triangles get their entry once their parts are known.
        if (!s.valid || s.bitsPerState == 1u)
            writeEntry(triangle, s, s.level);
        else
            entryOf(triangle).w[1] = s.level | s.bitsPerState << 16u;
        return;
    }
    const uint level = units == 0u ? s.level : levelFor(s, data);
    if (!writeEntry(triangle, s, level))
        return;
    Words entry = entryOf(triangle);
    if (units == 0u) {
        entry.w[2] = loadBytes(data, sourceBytes(level, s.bitsPerState));
        return;
    }
    Words target = Words(addressPlus(push.micromap, entry.w[0]));
    for (uint i = 0u; i < sourceBytes(level, s.bitsPerState) >> 2u; ++i)
        target.w[i] = coarsenedWord(data, i, s.level - level);
}
