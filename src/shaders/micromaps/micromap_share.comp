// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build that shares identical data, one invocation per triangle: folds triangles that their coarse mask describes,
// and assigns the others a slot of the hash table, one for all triangles of the same format, level and data. All triangles
// of a slot equal its first, so the lowest of them is the same in every run.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"
#include "micromap_data.glsl"

bool sameData(Source a, uint other)
{
    const Source b = readSource(other);
    if (a.level != b.level || a.bitsPerState != b.bitsPerState || !b.valid)
        return false;
    if (a.dataOffset == b.dataOffset)
        return true;
    const uint units = unitsOf(a);
    if (units > kMaxComparedUnits)
        return false;
    const uint bytes = min(sourceBytes(a.level, a.bitsPerState), 16u);
    const uvec2 from = addressPlus(push.data, a.dataOffset);
    const uvec2 to = addressPlus(push.data, b.dataOffset);
    for (uint i = 0u; i < units; ++i) {
        if (loadUnit(addressPlus(from, i * 16u), bytes) != loadUnit(addressPlus(to, i * 16u), bytes))
            return false;
    }
    return true;
}

void main()
{
    const uint triangle = globalInvocation();
    if (triangle >= push.triangleCount)
        return;
    Words record = recordOf(triangle);
    Words slots = Words(slotsAddress());
    slots.w[triangle] = kNoSlot;
    const uint word0 = record.w[0];
    if ((word0 & kKindMask) == kKindInline)
        return;
    if (Words(push.scratch).w[kScratchPartsFull] != 0u) {
        if (unitsOf(readSource(triangle)) > kPartUnits) {
            record.w[0] = kRejected;
            record.w[1] = ~0u;
            return;
        }
    }
    const uint mask = coarseMask(record.w[1]);
    record.w[1] = mask;
    if (describesAll(mask)) {
        record.w[0] = kKindInline;
        return;
    }
    const Source s = readSource(triangle);
    Words hashes = Words(hashesAddress());
    Words table = Words(tableAddress());
    const uint hash = hashes.w[triangle];
    // Only crafted data fills all slots that are probed; the triangle then does not share its data.
    for (uint probe = 0u; probe < kMaxProbes; ++probe) {
        const uint slot = (hash + probe) & push.tableMask;
        const uint held = atomicCompSwap(table.w[slot], 0u, triangle + 1u);
        const bool mine = held == 0u;
        if (mine || (hashes.w[held - 1u] == hash && sameData(s, held - 1u))) {
            if (!mine)
                atomicMin(table.w[slot], triangle + 1u);
            slots.w[triangle] = slot;
            return;
        }
    }
}
