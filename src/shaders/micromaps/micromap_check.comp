// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build: determines whether the data can be used in place: the data of each triangle begins at a data unit, and
// ends within the capacity of the micromap.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"

void main()
{
    const uint i = globalInvocation();
    const uint run = kCheckedPerInvocation;
    uint last = 0u;
    bool elsewhere = false;
    for (uint t = i * run; t < min((i + 1u) * run, push.triangleCount); ++t) {
        const Source s = readSource(t);
        const uint units = unitsOf(s);
        if (units == 0u)
            continue;
        elsewhere = elsewhere || !fitsInPlace(s);
        last = max(last, (s.dataOffset >> 4u) + units);
    }
    if (elsewhere)
        Words(push.scratch).w[kScratchElsewhere] = 1u;
    if (last > 0u)
        atomicMax(Words(push.scratch).w[kScratchLastUnit], last);
}
