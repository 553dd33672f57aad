// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build whose data cannot be used in place, or is lossy: three passes (push.pack) assign data units to every triangle,
// in their order, write its record and copy its data. They read the data only to copy it. One shader, without barriers of a
// workgroup, because drivers compile it for first builds, of which hardly any runs it.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"

// Turns the units of the blocks into those before each block, and writes the micromap's header. Sums saturate beyond the
// capacity: data there is rejected, however far beyond it is.
void scan()
{
    Words sums = Words(sumsAddress());
    uint sum = 0u;
    for (uint b = 0u; b < blocks(); ++b) {
        const uint own = sums.w[b];
        sums.w[b] = min(sum, push.capacityUnits);
        sum = min(sum + own, push.capacityUnits + 1u);
    }
    writeHeader(min(sum, push.capacityUnits));
}

// Copies every `step`-th word of a triangle's data to its units. Words are enough for a pass that hardly any build needs.
void copyWords(Source s, uint first, uint step, uvec2 target)
{
    const uint bytes = sourceBytes(s.level, s.bitsPerState);
    const uint words = unitsOf(s) * (kDataUnitBytes / 4u);
    const uvec2 source = addressPlus(push.data, s.dataOffset);
    Words to = Words(target);
    for (uint w = first; w < words; w += step)
        to.w[w] = w * 4u < bytes ? loadBytes(addressPlus(source, w * 4u), 4u) : 0u;
}

void main()
{
    const uint i = globalInvocation();
    if (push.pack == kPackScan) {
        if (i == 0u)
            scan();
        return;
    }
    // In the last pass, several invocations copy the data of a block in turns.
    const bool copies = push.pack == kPackCopies;
    const uint copiers = copies ? 1u << push.copiersLog2 : 1u;
    const uint block = copies ? i >> push.copiersLog2 : i;
    const uint me = i & (copiers - 1u);
    const uint first = block * kPlaceBlock;
    if (first >= push.triangleCount)
        return;
    Words sums = Words(sumsAddress());
    uint unit = copies ? sums.w[block] : 0u;
    for (uint t = first; t < min(first + kPlaceBlock, push.triangleCount); ++t) {
        const Source s = readSource(t);
        const uint units = unitsOf(s);
        if (copies) {
            const bool overflows = units > push.capacityUnits - min(unit, push.capacityUnits);
            if ((t & (copiers - 1u)) == me) {
                uvec2 record = recordAt(kindOf(s), unit, 0u, kLookEverywhere);
                if (units == 0u)
                    record = recordWithoutData(s);
                else if (overflows)
                    record = uvec2(kRejected, ~0u);
                storeRecord(t, record);
            }
            if (!overflows)
                copyWords(s, me, copiers, elementAddress(micromapUnits(push.micromap, push.triangleCount), unit, kDataUnitBytes));
        }
        unit += units;
    }
    if (!copies)
        sums.w[block] = unit; // at most kPlaceBlock * 2^18
}
