// SPDX-License-Identifier: Apache-2.0
// Sums the blocks' counts, and says how much work the list is.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_list.glsl"

// Each level has that many segments of blocks.
layout(local_size_x = 128) in;
const uint kSegments = kBakeBlock / 16u;

shared uint sums[kBakeBlock];
shared uint totals[16];

void setGroups(uint at, uint groups)
{
    SCRATCH(at) = min(groups, kBakeMostGroups);
    SCRATCH(at + 1u) = (groups + kBakeMostGroups - 1u) / kBakeMostGroups;
    SCRATCH(at + 2u) = 1u;
}

void finish()
{
    uint triangles = 0u;
    uint units = 0u;
    bool tooMuch = false;
    bool isFull = false;
    for (uint level = 0u; level < kBakeLevels; ++level) {
        uint count = totals[level];
        if (push.first != 0u) {
            const uint capacity = SCRATCH(kBakeCapacity + level);
            isFull = isFull || count > capacity;
            count = min(count, capacity);
        }
        uint high, low, carry;
        umulExtended(count, bakeUnits(level), high, low);
        units = uaddCarry(units, low, carry);
        tooMuch = tooMuch || high != 0u || carry != 0u;
        triangles += count;
        SCRATCH(kBakeWork + level) = count;
    }
    tooMuch = tooMuch || units > 0xffffff00u;
    const uint groups = tooMuch ? 0u : (units + 63u) / 64u;
    if (push.first == 0u) {
        SCRATCH(kBakeTooMuch) = tooMuch ? 1u : 0u;
        setGroups(kBakeProbeGroups, tooMuch ? 0u : (triangles + 15u) / 16u);
        setGroups(kBakeMeasureGroups, groups);
        return;
    }
    setGroups(kBakeWriteGroups, groups);
    const bool sizesOnly = flagSet(kBakeSizesOnly);
    Words result = Words(scratchAddress(kBakeResult));
    result.w[0] = (isFull && !sizesOnly ? 1u : 0u) | (SCRATCH(kBakeTooMuch) != 0u ? 2u : 0u);
    for (uint level = 0u; level < kBakeLevels; ++level)
        result.w[1u + level] = totals[level];
}

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    const uint level = lane % 16u;
    const uint segment = lane / 16u;
    const uint triangles = SCRATCH(kBakeTriangles);
    const uint blocks = bakeBlocks(triangles);
    const uint start = bakeBlockStart(triangles);
    const uint each = (blocks + kSegments - 1u) / kSegments;
    const uint first = min(segment * each, blocks);
    const uint last = min(first + each, blocks);
    uint sum = 0u;
    for (uint block = first; block < last; ++block)
        sum += SCRATCH(start + block * 16u + level);
    sums[lane] = sum;
    barrier();
    sum = 0u;
    for (uint i = 0u; i < segment; ++i)
        sum += sums[i * 16u + level];
    for (uint block = first; block < last; ++block) {
        const uint at = start + block * 16u + level;
        const uint count = SCRATCH(at);
        SCRATCH(at) = sum;
        sum += count;
    }
    if (segment == kSegments - 1u)
        totals[level] = sum;
    barrier();
    if (lane == 0u)
        finish();
}
