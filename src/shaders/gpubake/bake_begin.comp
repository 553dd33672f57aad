// SPDX-License-Identifier: Apache-2.0
// Before the first step: finds places for the masks, and counts nothing yet.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_scratch.glsl"
#include "gpubake/bake_mask.glsl"

layout(local_size_x = 1) in;

void main()
{
    SCRATCH(kBakeTooMuch) = 0u;
    for (uint i = 0u; i < 4u; ++i)
        SCRATCH(kBakeSpecials + i) = 0u;
    uint at = bakeMaskStart(SCRATCH(kBakeTriangles));
    for (uint number = 0u; number < SCRATCH(kBakeMips); ++number) {
        const Mip mip = makeMip(number);
        const uint table = mipTable(number);
        const uvec2 cells = uvec2(mip.x.cells, mip.y.cells);
        SCRATCH(table + kBakeMipCellsX) = cells.x;
        SCRATCH(table + kBakeMipCellsY) = cells.y;
        for (uint step = 0u; step < bakeMaskSteps(cells.x, cells.y); ++step) {
            SCRATCH(table + kBakeMipMasks + step) = at;
            at += bakeMaskWords(cells.x, cells.y, step);
        }
    }
}
