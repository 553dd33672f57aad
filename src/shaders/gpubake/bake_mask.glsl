// SPDX-License-Identifier: Apache-2.0
// Masks of cells: two bits for each stored cell of a mip level, and for each block of 2^step x 2^step of them. One says
// that some value in it may not be opaque, the other that some may not be transparent.

// Maps positions along one axis of a texture to texels and to stored cells, like the baker's Axis (src/bake/texture).
//
// With bilinear filtering, cell i is the interval between the centres of texels i and i + 1; with nearest filtering it
// is texel i. An address mode folds all cells onto a few stored ones.

struct Axis {
    int size;
    uint wrap;
    int more;  // 1 with bilinear filtering, 0 with nearest
    int cells; // stored ones
    int lead;  // stored cells in front of cell 0
    int period; // of modes that repeat
    float perPeriod;
};

Axis makeAxis(uint size, uint wrap, bool bilinear)
{
    const int period = int(size) * (wrap == kBakeMirror ? 2 : 1);
    return Axis(int(size), wrap, bilinear ? 1 : 0, int(bakeCells(size, wrap, bilinear)),
                int(bakeLead(wrap, bilinear)), period, 1.0 / float(period));
}

// i modulo the period, for |i| up to 2^27; the period is at most 2^17. Integers are hardly ever divided by hardware.
//
// The float quotient is off by less than 2^-20 of itself. So the first remainder is within 2^7 periods, which makes it
// exact as a float, and the second one within two.
int floorModulo(Axis axis, int i)
{
    i -= int(floor(float(i) * axis.perPeriod)) * axis.period;
    i -= int(floor(float(i) * axis.perPeriod)) * axis.period;
    i += i < 0 ? axis.period : 0;
    return i >= axis.period ? i - axis.period : i;
}

// The texel that position i means; -1 for the border.
int wrapTexel(Axis axis, int i)
{
    const int m = floorModulo(axis, i);
    if (axis.wrap == kBakeRepeat)
        return m;
    if (axis.wrap == kBakeMirror)
        return m < axis.size ? m : axis.period - 1 - m;
    if (axis.wrap == kBakeBorderMode)
        return i >= 0 && i < axis.size ? i : -1;
    if (axis.wrap == kBakeMirrorOnce)
        return min(i >= 0 ? i : -1 - i, axis.size - 1);
    return clamp(i, 0, axis.size - 1);
}

// Neighbouring cells of one direction: cell `i + n` is stored cell `first + n * step`, for n below `count`.
struct Run {
    int first;
    int step;
    int count;
};

Run risingRun(Axis axis, int stored, int wanted)
{
    return Run(stored, 1, min(wanted, axis.cells - stored));
}
Run fallingRun(int stored, int wanted)
{
    return Run(stored, -1, min(wanted, stored + 1));
}

// The longest run from cell i on, of at most `wanted` cells.
Run runFrom(Axis axis, int i, int wanted)
{
    const int stored = i + axis.lead;
    if (i >= -axis.lead && stored + wanted <= axis.cells)
        return Run(stored, 1, wanted);
    const int m = floorModulo(axis, i);
    if (axis.wrap == kBakeRepeat)
        return risingRun(axis, m, wanted);
    if (axis.wrap == kBakeMirror) {
        if (m < axis.size)
            return risingRun(axis, m + axis.more, wanted);
        return fallingRun(axis.period - 1 - m, wanted);
    }
    if (axis.wrap == kBakeMirrorOnce) {
        const int far = -axis.size - axis.more;
        if (i < far)
            return Run(axis.cells - 1, 0, min(wanted, far - i));
        if (i < -axis.more)
            return fallingRun(-1 - i, wanted);
    }
    if (stored < 0)
        return Run(0, 0, min(wanted, -stored));
    if (stored >= axis.cells)
        return Run(axis.cells - 1, 0, wanted);
    return risingRun(axis, stored, wanted);
}

// The stored cells of all cells from i on, `count` of them: two intervals, of which the second may be empty (z > w).
// Except for repetition, neighbouring cells are also neighbours when stored, so one interval holds all.
ivec4 storedIntervals(Axis axis, int i, int count)
{
    if (count >= 2 * axis.cells)
        return ivec4(0, axis.cells - 1, 1, 0);
    ivec4 intervals = ivec4(axis.cells, -1, 1, 0);
    for (int piece = 0; count > 0 && piece < 8; ++piece) {
        const Run run = runFrom(axis, i, count);
        const int last = run.first + (run.count - 1) * run.step;
        const ivec2 stored = ivec2(min(run.first, last), max(run.first, last));
        if (axis.wrap == kBakeRepeat && piece == 1)
            intervals.zw = stored;
        else
            intervals.xy = ivec2(min(intervals.x, stored.x), max(intervals.y, stored.y));
        i += run.count;
        count -= run.count;
    }
    return intervals;
}

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
