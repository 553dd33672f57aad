// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Lossy micromap build, after the parts were measured: chooses the level of each triangle on the list, and writes the states
// of those that are coarser than a part.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "opacity.h"
#include "micromap_lossy.glsl"

// The number of levels by which a triangle may be lowered.
uint riseOf(Source s, uint i, uint parts)
{
    uint known[7] = uint[7](0u, 0u, 0u, 0u, 0u, 0u, 0u);
    Climb above = Climb(uvec4(0u), uvec4(0u));
    for (uint p = 0u; p < parts; ++p) {
        Words part = partOf(i + p);
        for (uint j = 0u; j < 3u; ++j) {
            known[2u * j] += part.w[j] & 0xffffu;
            known[2u * j + 1u] += part.w[j] >> 16u;
        }
        const uint code = part.w[3] >> 16u;
        known[6] += code != kCodeMixed ? 1u : 0u;
        climb(above, p, code);
    }
    uint best = 0u;
    uint least = ~0u;
    for (uint k = 0u; k <= s.level - kCoarseLevel; ++k) {
        const uint cost = costOf(s.level, k, known[0], k <= kPartLevels ? known[k] : above.known[k - kPartLevels - 1u]);
        best = cost <= least ? k : best;
        least = min(cost, least);
    }
    return best;
}

// States of a level that is k >= kPartLevels lower, and so at least 2: whole words.
void writeStates(uint triangle, uint i, uint level, uint k)
{
    const uint each = 1u << (2u * (k - kPartLevels));
    Words target = Words(addressPlus(push.micromap, entryOf(triangle).w[0]));
    uint states = 0u;
    for (uint node = 0u; node < 1u << (2u * level); ++node) {
        uint low = 0u;
        uint code = 0u;
        for (uint p = 0u; p < each; ++p) {
            const uint part = partOf(i + node * each + p).w[3];
            low += part & 0xffffu;
            code |= part >> 16u;
        }
        states |= stateOf(code, low, 1u << (2u * k)) << (2u * (node & 15u));
        if ((node & 15u) == 15u) {
            target.w[node >> 4u] = states;
            states = 0u;
        }
    }
}

void main()
{
    const uint i = globalInvocation();
    if (i >= min(Words(push.scratch).w[kScratchPartCount], push.partCapacity))
        return;
    if (Words(partsAddress()).w[2u * i + 1u] != 0u)
        return;
    const uint triangle = Words(partsAddress()).w[2u * i];
    const Source s = readSource(triangle);
    if (!s.valid || s.bitsPerState == 1u || entryOf(triangle).w[1] == 0u)
        return;
    const uint k = riseOf(s, i, unitsOf(s) / kPartUnits);
    if (writeEntry(triangle, s, s.level - k) && k >= kPartLevels)
        writeStates(triangle, i, s.level - k, k);
}
