#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build, first pass, one workgroup: gives every triangle its place in the micromap's data by a prefix sum over
// the sizes, in the order of the triangles. Each invocation owns one run of triangles.
#include "micromap_source.glsl"

layout(local_size_x = 256) in;

shared uint sums[256];

void writeRecord(uint triangle, Source s, inout uint unit)
{
    const uint units = unitsOf(s);
    uint word0 = kKindInline;
    uint word1 = 0u;
    if (!s.valid || units > push.capacityUnits - unit) {
        word0 = kRejected;
        word1 = ~0u;
    } else if (units > 0u) {
        const uint n = (s.level - kCoarseLevel - 1u) * 2u + (s.bitsPerState - 1u);
        if (unit <= kMaxNearUnit) {
            word0 = (kKindData + n) | (unit << kUnitShift);
        } else {
            word0 = kKindFar | (n << kUnitShift);
            word1 = unit;
        }
        unit += units;
    }
    Words record = recordOf(triangle);
    record.w[0] = word0;
    record.w[1] = word1;
}

void main()
{
    const uint me = gl_LocalInvocationIndex;
    const uint run = (push.triangleCount + 255u) / 256u;
    const uint first = min(me * run, push.triangleCount);
    const uint last = min(first + run, push.triangleCount);

    // Saturating: a sum beyond the capacity is rejected below, however far beyond it is.
    uint sum = 0u;
    for (uint t = first; t < last; ++t)
        sum = min(sum + unitsOf(readSource(t)), push.capacityUnits + 1u);
    sums[me] = sum;
    barrier();
    for (uint step = 1u; step < 256u; step *= 2u) {
        const uint other = me >= step ? sums[me - step] : 0u;
        barrier();
        sums[me] = min(sums[me] + other, push.capacityUnits + 1u);
        barrier();
    }

    uint unit = min(me > 0u ? sums[me - 1u] : 0u, push.capacityUnits);
    for (uint t = first; t < last; ++t)
        writeRecord(t, readSource(t), unit);
    if (me == 255u) {
        Words header = Words(push.micromap);
        header.w[kMicromapHeaderMagic] = kMicromapMagic;
        header.w[kMicromapHeaderTriangles] = push.triangleCount;
        header.w[kMicromapHeaderUnits] = min(sums[255], push.capacityUnits);
    }
}
