// SPDX-License-Identifier: Apache-2.0
// A triangle over the cells of a mip level. Its vertices are placed in integers, with 26 bits behind the point; floats
// only count from a cell near by. docs/design/gpu-baker.md has the bounds of all errors.

const uint kPointBits = 26u;
const float kFromFixed = 1.0 / 67108864.0; // 2^-26

// 64-bit integers, the lower half first.
uvec2 negate64(uvec2 x)
{
    const uint low = ~x.x + 1u;
    return uvec2(low, ~x.y + (low == 0u ? 1u : 0u));
}
uvec2 add64(uvec2 x, uvec2 y)
{
    uint carry;
    const uint low = uaddCarry(x.x, y.x, carry);
    return uvec2(low, x.y + y.y + carry);
}
uvec2 subtract64(uvec2 x, uvec2 y)
{
    return add64(x, negate64(y));
}
uvec2 times64(uvec2 x, uint factor)
{
    uint high, low;
    umulExtended(x.x, factor, high, low);
    return uvec2(low, high + x.y * factor);
}
// Shifts right by up to 12 bits, rounding down.
uvec2 half64(uvec2 x, uint bits)
{
    return bits == 0u ? x : uvec2(x.x >> bits | x.y << (32u - bits), uint(int(x.y) >> bits));
}
// Converts a fixed-point number, to within one part in 2^22.
float toFloat64(uvec2 x)
{
    const bool negative = int(x.y) < 0;
    const uvec2 size = negative ? negate64(x) : x;
    precise const float value = (float(size.y) * 4294967296.0 + float(size.x)) * kFromFixed;
    return negative ? -value : value;
}
int floor64(uvec2 x)
{
    return int(x.y << (32u - kPointBits) | x.x >> kPointBits);
}

// u * size, whose absolute value is below 2^24, cut off behind the last bit.
uvec2 fixedProduct(float u, uint size)
{
    const uint bits = floatBitsToUint(u);
    const int exponent = int((bits >> 23u) & 255u);
    const int shift = exponent - 150 + int(kPointBits);
    if (exponent == 0 || shift <= -64)
        return uvec2(0u);
    uint high, low;
    umulExtended((bits & 0x7fffffu) | 0x800000u, size, high, low);
    uvec2 value = uvec2(low, high);
    if (shift >= 32)
        value = uvec2(0u, low << uint(shift - 32));
    else if (shift > 0)
        value = uvec2(low << uint(shift), high << uint(shift) | low >> uint(32 - shift));
    else if (shift <= -32)
        value = uvec2(shift == -32 ? high : high >> uint(-shift - 32), 0u);
    else if (shift < 0)
        value = uvec2(low >> uint(-shift) | high << uint(32 + shift), high >> uint(-shift));
    return (bits & 0x80000000u) != 0u ? negate64(value) : value;
}

// The texture coordinates of a triangle.
struct Uvs {
    vec2 a;
    vec2 b;
    vec2 c;
};

Uvs loadUvs(uint triangle)
{
    const uint at = triangleAt(triangle);
    return Uvs(vec2(scratchFloat(at), scratchFloat(at + 1u)), vec2(scratchFloat(at + 2u), scratchFloat(at + 3u)),
               vec2(scratchFloat(at + 4u), scratchFloat(at + 5u)));
}

// Finite, and small enough for single precision to distinguish texels.
bool usable(Uvs uvs, uvec2 size)
{
    const vec2 texels = vec2(size);
    const vec2 far = vec2(16777216.0);
    bool near = true;
    for (int i = 0; i < 3; ++i) {
        const vec2 uv = i == 0 ? uvs.a : i == 1 ? uvs.b : uvs.c;
        const bool finite = (floatBitsToUint(uv.x) & 0x7fffffffu) < 0x7f800000u &&
                            (floatBitsToUint(uv.y) & 0x7fffffffu) < 0x7f800000u;
        near = near && finite && all(lessThan(abs(uv) * texels, far));
    }
    return near;
}

struct Placement {
    // Vertex 0, and the edges from it to vertices 1 and 2, in cells.
    uvec2 originX, originY;
    uvec2 edgeIX, edgeIY, edgeJX, edgeJY;
    vec2 stepI; // the edges of a micro-triangle
    vec2 stepJ;
    vec2 margin; // how far from the exact place a sample may be
    uint level;
};

Placement place(Uvs uvs, Mip mip, uint level)
{
    const uvec2 size = uvec2(mip.x.size, mip.y.size);
    const uvec2 half_ = uvec2(mip.bilinear ? 1u << (kPointBits - 1u) : 0u, 0u);
    Placement p;
    p.level = level;
    p.originX = fixedProduct(uvs.a.x, size.x);
    p.originY = fixedProduct(uvs.a.y, size.y);
    p.edgeIX = subtract64(fixedProduct(uvs.b.x, size.x), p.originX);
    p.edgeIY = subtract64(fixedProduct(uvs.b.y, size.y), p.originY);
    p.edgeJX = subtract64(fixedProduct(uvs.c.x, size.x), p.originX);
    p.edgeJY = subtract64(fixedProduct(uvs.c.y, size.y), p.originY);
    p.originX = subtract64(p.originX, half_);
    p.originY = subtract64(p.originY, half_);
    const float scale = 1.0 / float(1u << level);
    p.stepI = vec2(toFloat64(p.edgeIX), toFloat64(p.edgeIY)) * scale;
    p.stepJ = vec2(toFloat64(p.edgeJX), toFloat64(p.edgeJY)) * scale;
    // The bounds are those of the baker's Placement, and a little more for rounding.
    const vec2 largest = max(abs(uvs.a), max(abs(uvs.b), abs(uvs.c)));
    const vec2 slope = abs(uvs.b - uvs.a) + abs(uvs.c - uvs.a);
    const vec2 moved =
        vec2(size) * (largest * scratchFloat(kBakeInterpolation) + slope * scratchFloat(kBakeBarycentric));
    p.margin = (scratchFloat(kBakeSubtexel) + moved) * (1.0 + 1.0 / 1048576.0);
    return p;
}

// A triangle in floats that count from a whole cell: a corner, and the edges to the other two.
struct Shape {
    ivec2 cell;
    vec2 corner;
    vec2 i;
    vec2 j;
    vec2 margin;
    float slack; // no coordinate is off by more
};

// The sub-triangle of `size` steps (less than none if it is turned) at a lattice point.
Shape shapeAt(Placement p, int i, int j, int size)
{
    const uvec2 x = add64(p.originX, half64(add64(times64(p.edgeIX, uint(i)), times64(p.edgeJX, uint(j))), p.level));
    const uvec2 y = add64(p.originY, half64(add64(times64(p.edgeIY, uint(i)), times64(p.edgeJY, uint(j))), p.level));
    const uint fraction = (1u << kPointBits) - 1u;
    Shape s;
    s.cell = ivec2(floor64(x), floor64(y));
    s.corner = vec2(x.x & fraction, y.x & fraction) * kFromFixed;
    s.i = p.stepI * float(size);
    s.j = p.stepJ * float(size);
    s.margin = p.margin;
    const vec2 extent = max(abs(s.i), max(abs(s.j), abs(s.j - s.i))) + 2.0 * s.margin;
    s.slack = (max(extent.x, extent.y) + 4.0) * (1.0 / 262144.0);
    return s;
}

// Part of a shape: the triangle of `size` times its edges at corner + a * i + b * j. Counts from the same cell.
Shape partOf(Shape s, float a, float b, float size)
{
    Shape part = s;
    precise const vec2 corner = s.corner + a * s.i + b * s.j;
    part.corner = corner;
    part.i = s.i * size;
    part.j = s.j * size;
    return part;
}

// The cells of the box around a shape.
ivec4 cellsAround(Shape s)
{
    const vec2 zero = vec2(0.0);
    precise const vec2 low = s.corner + min(zero, min(s.i, s.j)) - s.margin - s.slack;
    precise const vec2 high = s.corner + max(zero, max(s.i, s.j)) + s.margin + s.slack;
    return ivec4(ivec2(floor(low)), ivec2(floor(high))) + s.cell.xyxy;
}
