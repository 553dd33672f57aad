// SPDX-License-Identifier: Apache-2.0
// The masks of blocks of cells: two by two blocks of the size before become one. push.first: the mip level,
// push.second: the step.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_scratch.glsl"
#include "gpubake/bake_mask.glsl"

layout(local_size_x = 64) in;

// Ors pairs of neighbouring bits, into the low half.
uint halve(uint bits)
{
    uint r = (bits | bits >> 1u) & 0x55555555u;
    r = (r | r >> 1u) & 0x33333333u;
    r = (r | r >> 2u) & 0x0f0f0f0fu;
    r = (r | r >> 4u) & 0x00ff00ffu;
    return (r | r >> 8u) & 0xffffu;
}

uint halfOf(uint mask, uint pitch, uint rows, uint row, uint pair, uint plane)
{
    uint bits = 0u;
    for (uint i = row; i < min(row + 2u, rows); ++i) {
        bits |= halve(SCRATCH(mask + (i * pitch + pair) * 2u + plane));
    }
    return bits;
}

void main()
{
    const Mip mip = makeMip(push.first);
    const uint step = push.second;
    const uint table = mipTable(push.first);
    const uvec2 cells = uvec2(mip.x.cells, mip.y.cells);
    const uint blocks = bakeBlocksOfCells(cells.x, step);
    const uint rows = bakeBlocksOfCells(cells.y, step);
    const uint pitch = bakeMaskPitch(blocks);
    const uint at = INVOCATION;
    const uint word = at % pitch;
    const uint row = at / pitch;
    if (row >= rows)
        return;
    const uint finerPitch = bakeMaskPitch(bakeBlocksOfCells(cells.x, step - 1u));
    const uint finerRows = bakeBlocksOfCells(cells.y, step - 1u);
    const uint finer = SCRATCH(table + kBakeMipMasks + step - 1u);
    const uint mask = SCRATCH(table + kBakeMipMasks + step);
    for (uint plane = 0u; plane < 2u; ++plane) {
        uint bits = 0u;
        if (word * 2u < finerPitch)
            bits = halfOf(finer, finerPitch, finerRows, row * 2u, word * 2u, plane);
        if (word * 2u + 1u < finerPitch)
            bits |= halfOf(finer, finerPitch, finerRows, row * 2u, word * 2u + 1u, plane) << 16u;
        SCRATCH(mask + (row * pitch + word) * 2u + plane) = bits;
    }
}
