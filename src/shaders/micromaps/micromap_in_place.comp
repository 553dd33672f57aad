// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build in place: the data was copied as it is, and this pass writes the records of triangles that use it there.
// For most micromaps nothing else is needed. A triangle that cannot use its data in place starts the other passes, which
// write all records again.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "micromap_data.glsl"

// So many invocations process adjacent triangles, 64 bytes of them, and then the next ones: a CPU, whose vectors are that
// short, reads memory in its order, and a GPU reads whole sectors.
const uint kTogether = 8u;
const uint kAtOnce = 4u;

struct InPlace {
    bool fails; // for some triangle
    uint end; // of the data in use, in data units
};

// Writes records of triangles that should all have the level and format push.alike. Several are loaded at once: a CPU driver
// gathers and scatters, so that the processor cannot prefetch.
InPlace writeAlike(uint first, uint last)
{
    const uint bitsPerState = push.alike >> 16u;
    const uint level = push.alike & 0xffffu;
    const uint misaligned = alignmentInPlace(level, bitsPerState) - 1u;
    const uint kind = kKindData + (level - kCoarseLevel - 1u) * 2u + (bitsPerState - 1u);
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
            wrong |= (triangles[i].y ^ push.alike) | (offset & misaligned) | (uint(offset > push.lastOffset));
            furthest = max(furthest, offset);
            // Units have 16 bytes, so the offset is the index of the unit, shifted, except for one bit.
            const uint word0 = (offset & ~15u) << (kUnitShift - 4u) | (kind + (offset >> 3u & 1u) * kKindUpperHalf);
            if (t + i * kTogether < last)
                records.at[t + i * kTogether].words = Eight(uvec2(word0, kLookEverywhere));
        }
    }
    InPlace result;
    result.fails = wrong != 0u;
    result.end = first < last ? (furthest + sourceBytes(level, bitsPerState) + kDataUnitBytes - 1u) / kDataUnitBytes : 0u;
    return result;
}

InPlace writeMixed(uint first, uint last)
{
    InPlace result;
    result.fails = false;
    result.end = 0u;
    for (uint t = first; t < last; t += kTogether) {
        const Source s = readSource(t);
        const uint unit = s.dataOffset >> 4u;
        const uint units = unitsOf(s);
        uvec2 record = uvec2((kKindData + kindInPlace(s)) | unit << kUnitShift, kLookEverywhere);
        if (units == 0u && s.valid)
            record = uvec2(kKindInline, coarseStates(s));
        else
            result.end = max(result.end, unit + units);
        result.fails = result.fails || !s.valid || unit > kMaxNearUnit || !fitsInPlace(s);
        Words to = recordOf(t);
        to.w[0] = record.x;
        to.w[1] = record.y;
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
    if (push.alike != 0u)
        result = writeAlike(first, last);
    else
        result = writeMixed(first, last);
    if (result.fails)
        startOtherPasses();
    Words header = Words(push.micromap);
    if (result.end != 0u)
        atomicMax(header.w[kMicromapHeaderUnits], result.end);
}
