// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build that shares identical data, one workgroup for each block of kPlaceBlock triangles: counts the data units of the
// block; or, once the units before each block are known, assigns them to every triangle, in their order, writes its record and
// copies its data. micromap_parts.comp copies that of triangles with many units.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "micromap_data.glsl"

shared uint sums[64];

// Data units that the triangle does not share with a lower one.
uint ownUnits(uint triangle, Source s)
{
    return (recordOf(triangle).w[0] & kKindMask) == kKindInline || ownerOf(triangle) != triangle ? 0u : unitsOf(s);
}

// Inline records have been written, and micromap_owners.comp copies those of triangles that share.
void writeRecord(uint triangle, Source s, uint units, uint unit)
{
    if (units == 0u)
        return;
    if (units > push.capacityUnits - min(unit, push.capacityUnits)) {
        storeRecord(triangle, uvec2(kRejected, ~0u));
        return;
    }
    if (units > kPartUnits)
        listParts(triangle, units);
    else
        copyUnits(s, 0u, units, 1u, elementAddress(micromapUnits(push.micromap, push.triangleCount), unit, kDataUnitBytes));
    storeRecord(triangle, recordAt(kindOf(s), unit, 0u, recordOf(triangle).w[1]));
}

void main()
{
    const uint me = gl_LocalInvocationIndex;
    const uint block = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint run = kPlaceBlock / gl_WorkGroupSize.x;
    const uint first = block * kPlaceBlock + me * run;
    const uint last = min(first + run, push.triangleCount);
    uint sum = 0u;
    for (uint t = first; t < last; ++t)
        sum += ownUnits(t, readSource(t));
    sums[me] = sum;
    barrier();
    const bool counts = (push.flags & kBuildAnalysing) != 0u;
    if (me == 0u && block * kPlaceBlock < push.triangleCount) {
        Words blockSums = Words(sumsAddress());
        uint before = counts ? 0u : blockSums.w[block]; // at most kPlaceBlock * 2^18 in a block
        for (uint i = 0u; i < gl_WorkGroupSize.x; ++i) {
            const uint own = sums[i];
            sums[i] = before;
            before += own;
        }
        if (counts)
            blockSums.w[block] = before;
    }
    barrier();
    if (counts)
        return;
    uint unit = sums[me];
    for (uint t = first; t < last; ++t) {
        const Source s = readSource(t);
        const uint units = ownUnits(t, s);
        writeRecord(t, s, units, unit);
        unit += units;
    }
}
