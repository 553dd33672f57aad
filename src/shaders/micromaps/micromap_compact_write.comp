// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Compacting copy of a micromap: writes the records, and the data of the triangles that own it. That of triangles with many
// units is written by the next pass, of the list of parts.
layout(local_size_x = 64) in;

#include "micromap_compact.glsl"

// The first data unit that a triangle owns.
uint unitOf(uint triangles, uint triangle)
{
    return Words(sumsAddress()).w[triangle / kPlaceBlock] + wordsOf(triangles, triangle).w[0];
}

// The record of a triangle whose data is at a unit. A far record has no mask.
uvec2 recordAt(Data d, uint unit, uint mask)
{
    return unit <= kMaxNearUnit ? uvec2((kKindData + d.kind) | unit << kUnitShift, mask)
                                : uvec2(kKindFar | d.kind << kUnitShift, unit);
}

void main()
{
    if (Words(push.scratch).w[kCompactionOutcome] != kCompactionWrites)
        return;
    const uint triangles = compactedTriangles();
    const uint count = itemCount(triangles);
    const uvec2 records = addressPlus(push.target, kMicromapHeaderWords * 4u);
    for (uint i = globalInvocation(); i < count; i += push.invocations) {
        const Item item = itemAt(triangles, i);
        if (item.triangle == kNoTriangle)
            continue;
        const uvec2 record = recordOf(item.triangle);
        const Data d = dataOf(triangles, record);
        Words words = wordsOf(triangles, item.triangle);
        const uint owner = words.w[2];
        const uint unit = owner == kNoData ? 0u : unitOf(triangles, owner);
        uint last = item.first + kPartUnits;
        if (!ofParts()) {
            const uvec2 inlined = uvec2((record.x & kKindMask) == kKindInline ? record.x : kKindInline, words.w[1]);
            storePair(records, item.triangle, owner == kNoData ? inlined : recordAt(d, unit, words.w[1]));
            last = owner != item.triangle || listParts(triangles, item.triangle, d.units) ? 0u : d.units;
        }
        const uint bytes = unitBytes(d);
        Quads to = Quads(elementAddress(micromapUnits(push.target, triangles), unit, kDataUnitBytes));
        for (uint u = item.first; u < last; ++u)
            to.at[u] = loadUnit(addressPlus(d.address, u * 16u), bytes);
    }
}
