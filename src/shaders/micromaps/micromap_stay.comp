#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build whose data was copied as it lies: writes the records of triangles that use it there, which is what most
// micromaps have and all that there is to do then. One that cannot starts the other passes, which write all records anew.
//
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "micromap_data.glsl"

// So many invocations take triangles that follow each other, 64 bytes of them, and then the next ones: memory is walked
// through in its order by a CPU, whose vectors are that short, and in whole sectors by a GPU.
const uint kTogether = 8u;
const uint kAtOnce = 4u;

struct Stay {
    bool fails;
    uint end; // of the data in use, in data units
};

// All triangles are to have this level and format. Several are loaded at once: a CPU's driver gathers and scatters, which
// keeps the processor from seeing ahead what memory comes next.
Stay stayAlike(uint first, uint last)
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
            // 16-byte units, so the offset is the shifted index of the unit but for one bit.
            const uint word0 = (offset & ~15u) << (kUnitShift - 4u) | (kind + (offset >> 3u & 1u) * kKindUpperHalf);
            if (t + i * kTogether < last)
                records.at[t + i * kTogether].words = Eight(uvec2(word0, kLookEverywhere));
        }
    }
    Stay stay;
    stay.fails = wrong != 0u;
    stay.end = first < last ? (furthest + sourceBytes(level, bitsPerState) + kDataUnitBytes - 1u) / kDataUnitBytes : 0u;
    return stay;
}

Stay stayMixed(uint first, uint last)
{
    Stay stay;
    stay.fails = false;
    stay.end = 0u;
    for (uint t = first; t < last; t += kTogether) {
        const Source s = readSource(t);
        const uint unit = s.dataOffset >> 4u;
        const uint units = unitsOf(s);
        uvec2 record = uvec2((kKindData + kindInPlace(s)) | unit << kUnitShift, kLookEverywhere);
        if (units == 0u && s.problem == 0u)
            record = uvec2(kKindInline, coarseStates(s));
        else
            stay.end = max(stay.end, unit + units);
        stay.fails = stay.fails || s.problem != 0u || unit > kMaxNearUnit || !fitsInPlace(s);
        Words to = recordOf(t);
        to.w[0] = record.x;
        to.w[1] = record.y;
    }
    return stay;
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
    const uint run = gl_WorkGroupSize.x * push.staysPerInvocation;
    if (group > push.triangleCount / run)
        return;
    const uint own = kTogether * push.staysPerInvocation;
    const uint begin = group * run + gl_LocalInvocationIndex / kTogether * own;
    const uint first = begin + gl_LocalInvocationIndex % kTogether;
    const uint last = min(begin + own, push.triangleCount);
    Stay stay;
    if (push.alike != 0u)
        stay = stayAlike(first, last);
    else
        stay = stayMixed(first, last);
    if (stay.fails)
        startOtherPasses();
    Words header = Words(push.micromap);
    if (stay.end != 0u)
        atomicMax(header.w[kMicromapHeaderUnits], stay.end);
}
