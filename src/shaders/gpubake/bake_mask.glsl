// SPDX-License-Identifier: Apache-2.0
// Masks of cells: two bits for each stored cell of a mip level, and for each block of 2^step x 2^step of them. One says
// that some value in it may not be opaque, the other that some may not be transparent.
#include "gpubake/bake_axis.glsl"

const uint kMayNotBeOpaque = 1u;
const uint kMayNotBeTransparent = 2u;
const uint kMayBeBoth = 3u;

struct Mip {
    int number;
    Axis x;
    Axis y;
    bool bilinear;
    uint mask; // of its cells
    uint pitch;
};

uint mipTable(uint number)
{
    return kBakeMipTable + number * kBakeMipWords;
}

Mip makeMip(uint number)
{
    const uint flags = SCRATCH(kBakeFlags);
    const bool bilinear = (flags & kBakeNearest) == 0u;
    Mip mip;
    mip.number = int(number);
    mip.bilinear = bilinear;
    mip.x = makeAxis(bakeMipSize(SCRATCH(kBakeWidth), number), (flags >> kBakeWrapUShift) & 7u, bilinear);
    mip.y = makeAxis(bakeMipSize(SCRATCH(kBakeHeight), number), (flags >> kBakeWrapVShift) & 7u, bilinear);
    mip.mask = SCRATCH(mipTable(number) + kBakeMipMasks);
    mip.pitch = bakeMaskPitch(uint(mip.x.cells));
    return mip;
}

// Both masks of up to 32 blocks of a row, from `first` on; the other bits are 0.
uvec2 maskBits(uint mask, uint pitch, uint row, uint first, uint count)
{
    const uint at = mask + (row * pitch + first / 32u) * 2u;
    const uint shift = first & 31u;
    uvec2 bits = uvec2(SCRATCH(at), SCRATCH(at + 1u)) >> shift;
    if (shift + count > 32u)
        bits |= uvec2(SCRATCH(at + 2u), SCRATCH(at + 3u)) << (32u - shift);
    return count >= 32u ? bits : bits & ((1u << count) - 1u);
}

// Both masks of the cells from x to x + count - 1, at most 32, in row y.
uvec2 rowBits(Mip mip, int x, int count, int y)
{
    const uint row = uint(runFrom(mip.y, y, 1).first);
    uvec2 bits = uvec2(0u);
    for (int done = 0; done < count;) {
        const Run run = runFrom(mip.x, x + done, count - done);
        const uint length = uint(run.count);
        const int last = run.first + (run.count - 1) * run.step;
        uvec2 some = maskBits(mip.mask, mip.pitch, row, uint(min(run.first, last)), run.step == 0 ? 1u : length);
        if (run.step == 0)
            some = uvec2(0u) - some;
        else if (run.step < 0)
            some = bitfieldReverse(some) >> (32u - length);
        if (length < 32u)
            some &= (1u << length) - 1u;
        bits |= some << uint(done);
        done += run.count;
    }
    return bits;
}

// The flags of the stored cells of a rectangle, or near it.
uint storedFlags(Mip mip, ivec2 low, ivec2 high)
{
    const ivec2 more = high - low;
    const uint step = uint(max(max(findMSB(more.x) - 3, findMSB(more.y) - 1), 0));
    const uint mask = SCRATCH(mipTable(uint(mip.number)) + kBakeMipMasks + step);
    const uint pitch = bakeMaskPitch(bakeBlocksOfCells(uint(mip.x.cells), step));
    const uvec2 from = uvec2(low) >> step;
    const uvec2 to = uvec2(high) >> step;
    uvec2 bits = uvec2(0u);
    for (uint row = from.y; row <= to.y; ++row)
        bits |= maskBits(mask, pitch, row, from.x, to.x - from.x + 1u);
    return (bits.x != 0u ? kMayNotBeOpaque : 0u) | (bits.y != 0u ? kMayNotBeTransparent : 0u);
}

// The flags of the cells of a rectangle, or near it.
uint boxFlags(Mip mip, ivec2 low, ivec2 high)
{
    const ivec4 columns = storedIntervals(mip.x, low.x, high.x - low.x + 1);
    const ivec4 rows = storedIntervals(mip.y, low.y, high.y - low.y + 1);
    uint flags = 0u;
    const int pieces = columns.z <= columns.w ? 2 : 1;
    const int all = rows.z <= rows.w ? 2 * pieces : pieces;
    for (int piece = 0; piece < all; ++piece) {
        const ivec2 x = piece % pieces == 0 ? columns.xy : columns.zw;
        const ivec2 y = piece / pieces == 0 ? rows.xy : rows.zw;
        flags |= storedFlags(mip, ivec2(x.x, y.x), ivec2(x.y, y.y));
    }
    return flags;
}
