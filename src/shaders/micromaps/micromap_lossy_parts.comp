// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Lossy micromap build, one invocation for each part of the triangles on the list: measures the part (kBuildAnalysing), or
// writes its coarsened data.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "opacity.h"
#include "micromap_lossy.glsl"

const uint kWords = kPartUnits * 4u;

void main()
{
    const uint i = globalInvocation();
    if (i >= min(Words(push.scratch).w[kScratchPartCount], push.partCapacity))
        return;
    const uint triangle = Words(partsAddress()).w[2u * i];
    const uint part = Words(partsAddress()).w[2u * i + 1u];
    const Source s = readSource(triangle);
    Words entry = entryOf(triangle);
    if (!s.valid || entry.w[1] == 0u)
        return;
    const uvec2 data = addressPlus(push.data, s.dataOffset);
    if ((push.flags & kBuildAnalysing) != 0u) {
        if (s.bitsPerState == 1u)
            return;
        const Measured found = measure(data, part * kWords, kWords);
        Words result = partOf(i);
        result.w[0] = found.known[0] | found.known[1] << 16u;
        result.w[1] = found.known[2] | found.known[3] << 16u;
        result.w[2] = found.known[4] | found.known[5] << 16u;
        result.w[3] = found.low | found.code << 16u;
        return;
    }
    const uint k = s.level - (entry.w[1] & 0xffffu);
    if (k >= kPartLevels)
        return; // written by micromap_lossy_choose.comp
    // Parts of less than a word are written together, by the first of them.
    const uint words = max(kWords >> (2u * k), 1u);
    if (kWords >> (2u * k) == 0u && (part & 3u) != 0u)
        return;
    const uint first = part * kWords >> (2u * k);
    Words target = Words(addressPlus(push.micromap, entry.w[0]));
    for (uint w = first; w < first + words; ++w)
        target.w[w] = coarsenedWord(data, w, k);
}
