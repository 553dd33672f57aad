// SPDX-License-Identifier: Apache-2.0
// The masks of a mip level's cells. push.first: the level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_scratch.glsl"
#include "gpubake/bake_mask.glsl"
#include "gpubake/bake_texels.glsl"

layout(local_size_x = 64) in;

// Each invocation does 32 columns of as many rows.
const uint kRows = 4u;

// The texel of the stored cell, or of the one behind the last; -1 for the border.
int storedTexel(Axis axis, int stored)
{
    const int texel = stored - axis.lead;
    if (axis.wrap == kBakeRepeat)
        return texel < axis.size ? texel : texel - axis.size;
    if (axis.wrap == kBakeBorderMode)
        return texel < axis.size ? texel : -1;
    return clamp(texel, 0, axis.size - 1);
}

uint flagsOf(float alpha, int opaqueFrom, int transparentBelow)
{
    if (!isFinite(alpha))
        return kMayBeBoth;
    const int order = orderOf(alpha);
    return (order >= opaqueFrom ? 0u : kMayNotBeOpaque) | (order < transparentBelow ? 0u : kMayNotBeTransparent);
}

void main()
{
    const Mip mip = makeMip(push.first);
    const uint pitch = mip.pitch;
    const uint mask = mip.mask;
    loadAlpha();
    const uint at = INVOCATION;
    const uint word = at % pitch;
    const uint top = at / pitch * kRows;
    if (top >= uint(mip.y.cells))
        return;
    const int opaqueFrom = orderOf(alphaOpaqueFrom);
    const int transparentBelow = orderOf(alphaTransparentBelow);
    const int first = int(word * 32u);
    const int columns = min(mip.x.cells - first, 32);
    uvec2 above = uvec2(0u); // bits of the texels of the row before, a texel and its right neighbour
    for (uint row = 0u; row <= kRows; ++row) {
        const int stored = int(top + row);
        if (stored > mip.y.cells)
            break;
        uvec2 bits = uvec2(0u);
        uint before = 0u;
        for (int i = 0; i < columns + mip.x.more && stored < mip.y.cells + mip.y.more; ++i) {
            const float alpha = texelAt(storedTexel(mip.x, first + i), storedTexel(mip.y, stored), mip.number);
            const uint flags = flagsOf(alpha, opaqueFrom, transparentBelow);
            const uvec2 both = uvec2(flags & 1u, flags >> 1u);
            if (i < columns)
                bits |= both << uint(i);
            if (i > 0 && mip.bilinear)
                bits |= both << uint(i - 1);
        }
        if (mip.bilinear && row > 0u || !mip.bilinear && row < kRows) {
            const uint y = mip.bilinear ? top + row - 1u : top + row;
            if (y < uint(mip.y.cells)) {
                const uvec2 result = mip.bilinear ? bits | above : bits;
                SCRATCH(mask + (y * pitch + word) * 2u) = result.x;
                SCRATCH(mask + (y * pitch + word) * 2u + 1u) = result.y;
            }
        }
        above = bits;
    }
}
