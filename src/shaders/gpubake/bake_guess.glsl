// SPDX-License-Identifier: Apache-2.0
// Returns whether most of a shape is opaque, by sampling the middles of the 16 micro-triangles two levels further down. Nothing
// depends on it but the kind of unknown state.

const uint kSamples = 16u;

// The middle of micro-triangle n. 10 of them are upright, in rows of 4, 3, 2 and 1; the others are turned, in rows of 3,
// 2 and 1.
vec2 sampleAt(Shape s, uint n)
{
    const uint k = n < 10u ? n : n - 10u;
    const uint longest = n < 10u ? 4u : 3u;
    const uint row = k < longest ? 0u : k < 2u * longest - 1u ? 1u : k < 3u * longest - 3u ? 2u : 3u;
    const uint column = k - (row * longest - row * (row - 1u) / 2u);
    const float third = n < 10u ? 1.0 : 2.0;
    return s.corner + (float(3u * column) + third) * (1.0 / 12.0) * s.i +
           (float(3u * row) + third) * (1.0 / 12.0) * s.j;
}

// Three neighbouring texels of a row.
vec3 threeTexels(Mip mip, ivec3 columns, int row)
{
    return vec3(texelAt(columns.x, row, mip.number), texelAt(columns.y, row, mip.number),
                texelAt(columns.z, row, mip.number));
}

// The number of opaque samples of a shape within two by two cells, from the one at `low` on. With bilinear filtering.
uint opaqueWithin(Mip mip, Shape s, vec2 low)
{
    const ivec2 cell = s.cell + ivec2(low);
    const ivec3 columns =
        ivec3(wrapTexel(mip.x, cell.x), wrapTexel(mip.x, cell.x + 1), wrapTexel(mip.x, cell.x + 2));
    const vec3 upper = threeTexels(mip, columns, wrapTexel(mip.y, cell.y));
    const vec3 middle = threeTexels(mip, columns, wrapTexel(mip.y, cell.y + 1));
    const vec3 lower = threeTexels(mip, columns, wrapTexel(mip.y, cell.y + 2));
    uint opaque = 0u;
    for (uint n = 0u; n < kSamples; ++n) {
        const vec2 at = sampleAt(s, n) - low;
        const vec2 next = step(vec2(1.0), at); // 0 or 1: in which cell
        const vec2 part = at - next;
        const vec3 above = next.y > 0.0 ? middle : upper;
        const vec3 below = next.y > 0.0 ? lower : middle;
        const vec3 row = mix(above, below, part.y);
        const float value = next.x > 0.0 ? mix(row.y, row.z, part.x) : mix(row.x, row.y, part.x);
        opaque += value >= alphaCutoff ? 1u : 0u;
    }
    return opaque;
}

// One sample, at any position.
bool sampleIsOpaque(Mip mip, Shape s, uint n)
{
    const vec2 at = sampleAt(s, n);
    const vec2 whole = floor(at);
    const ivec2 cell = s.cell + ivec2(whole);
    const uvec2 bits = rowBits(mip, cell.x, 1, cell.y);
    if (bits.x != bits.y)
        return bits.x == 0u;
    const ivec2 low = ivec2(wrapTexel(mip.x, cell.x), wrapTexel(mip.y, cell.y));
    if (!mip.bilinear)
        return texelAt(low.x, low.y, mip.number) >= alphaCutoff;
    const ivec2 high = ivec2(wrapTexel(mip.x, cell.x + 1), wrapTexel(mip.y, cell.y + 1));
    const vec2 part = at - whole;
    const float upper = mix(texelAt(low.x, low.y, mip.number), texelAt(high.x, low.y, mip.number), part.x);
    const float lower = mix(texelAt(low.x, high.y, mip.number), texelAt(high.x, high.y, mip.number), part.x);
    return mix(upper, lower, part.y) >= alphaCutoff;
}

bool mostlyOpaque(Mip mip, Shape s)
{
    const vec2 zero = vec2(0.0);
    const vec2 low = floor(s.corner + min(zero, min(s.i, s.j)));
    const vec2 high = floor(s.corner + max(zero, max(s.i, s.j)));
    uint opaque = 0u;
    if (mip.bilinear && all(lessThanEqual(high - low, vec2(1.0))))
        opaque = opaqueWithin(mip, s, low);
    else
        for (uint n = 0u; n < kSamples; ++n)
            opaque += sampleIsOpaque(mip, s, n) ? 1u : 0u;
    return 2u * opaque >= kSamples;
}
