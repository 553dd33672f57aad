// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build in place: the data was copied as it is, and this pass writes the records of triangles that use it there.
// For most micromaps nothing else is needed. A triangle whose data lies behind the micromap's capacity starts the passes of
// micromap_pack.comp, which write everything again.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"

// This many invocations process adjacent triangles, 64 bytes of them, and then the next ones: a CPU, whose vectors are
// that short, reads memory in its order, and a GPU reads whole sectors.
const uint kTogether = 8u;
const uint kAtOnce = 4u;

struct InPlace {
    bool fails; // for some triangle
    uint end; // of the data in use, in data units
};

// The data units in use if the data of a triangle, with at least one byte, is the last.
uint unitsBehind(uint offset, uint bytes)
{
    return (offset + bytes - 1u) / kDataUnitBytes + 1u;
}

// Writes records of triangles that should all have the level and format push.alike; fails if one has not. Several are loaded
// at once: a CPU driver gathers and scatters, so that the processor cannot prefetch.
InPlace writeAlike(uint first, uint last)
{
    const uint bitsPerState = push.alike >> 16u;
    const uint level = push.alike & 0xffffu;
    const uint kind = (level - kCoarseLevel - 1u) * 2u + (bitsPerState - 1u);
    Pairs source = Pairs(push.triangleArray);
    Pairs records = Pairs(addressPlus(push.micromap, kMicromapHeaderWords * 4u));
    uint wrong = 0u;
    uint furthest = 0u;
    for (uint t = first; t < last; t += kAtOnce * kTogether) {
        uvec2 triangles[kAtOnce];
        for (uint i = 0u; i < kAtOnce; ++i) {
            const uint next = t + i * kTogether;
            triangles[i] = uvec2(source.at[next < last ? next : t].words);
        }
        for (uint i = 0u; i < kAtOnce; ++i) {
            const uint offset = triangles[i].x;
            wrong |= (triangles[i].y ^ push.alike) | uint(offset > push.lastOffset);
            furthest = max(furthest, offset);
            if (t + i * kTogether < last)
                records.at[t + i * kTogether].words = Eight(recordAt(kind, offset >> 4u, offset & 15u, kLookEverywhere));
        }
    }
    InPlace result;
    result.fails = wrong != 0u;
    result.end = first < last ? unitsBehind(furthest, sourceBytes(level, bitsPerState)) : 0u;
    return result;
}

InPlace writeMixed(uint first, uint last)
{
    InPlace result;
    result.fails = false;
    result.end = 0u;
    for (uint t = first; t < last; t += kTogether) {
        const Source s = readSource(t);
        uvec2 record = recordWithoutData(s);
        if (unitsOf(s) != 0u) {
            record = recordAt(kindOf(s), s.dataOffset >> 4u, s.dataOffset & 15u, kLookEverywhere);
            const uint end = unitsBehind(s.dataOffset, sourceBytes(s.level, s.bitsPerState));
            result.fails = result.fails || end > push.capacityUnits;
            result.end = max(result.end, end);
        }
        storeRecord(t, record);
    }
    return result;
}

void startOtherPasses()
{
    Words arguments = Words(addressPlus(push.scratch, kScratchArguments * 4u));
    for (uint i = 0u; i < kArgumentWords; ++i)
        arguments.w[i] = arguments.w[kArgumentWords + i];
}

void main()
{
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint run = gl_WorkGroupSize.x * push.trianglesPerInvocation;
    if (group > push.triangleCount / run)
        return;
    const uint own = kTogether * push.trianglesPerInvocation;
    const uint begin = group * run + gl_LocalInvocationIndex / kTogether * own;
    const uint first = begin + gl_LocalInvocationIndex % kTogether;
    const uint last = min(begin + own, push.triangleCount);
    InPlace result;
    result.fails = true;
    if (push.alike != 0u)
        result = writeAlike(first, last);
    if (result.fails)
        result = writeMixed(first, last);
    if (result.fails)
        startOtherPasses();
    Words header = Words(push.micromap);
    if (result.end != 0u)
        atomicMax(header.w[kMicromapHeaderUnits], result.end);
}
