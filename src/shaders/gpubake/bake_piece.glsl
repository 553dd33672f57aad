// SPDX-License-Identifier: Apache-2.0
// The part of a shape that lies in one mixed cell, with bilinear filtering: bounds for the filtered value there. As the
// baker's PieceTest::quick (src/bake/piece.cpp), but what rounding hides may be anything here.

// Keeps of [from, to] where low <= start + s * delta <= high, give or take the shape's slack.
void clipRange(float start, float delta, float low, float high, inout float from, inout float to)
{
    if (abs(delta) < 1.0 / 1099511627776.0) {
        if (start < low || start > high)
            to = -1.0;
        return;
    }
    precise const float inverse = 1.0 / delta;
    precise const float a = (low - start) * inverse;
    precise const float b = (high - start) * inverse;
    from = max(from, min(a, b));
    to = min(to, max(a, b));
}

struct Patch {
    float f;
    float x;
    float y;
    float xy;
};

float valueAt(Patch patch_, vec2 at)
{
    precise const float value = patch_.f + patch_.x * at.x + (patch_.y + patch_.xy * at.x) * at.y;
    return value;
}

float crossOf(vec2 a, vec2 b)
{
    precise const float value = a.x * b.y - a.y * b.x;
    return value;
}

// The least and the largest value along a part of an edge: a quadratic, known from three points.
void addEdge(Patch patch_, vec2 start, vec2 delta, float slack, inout vec2 extent)
{
    float from = 0.0;
    float to = 1.0;
    clipRange(start.x, delta.x, -slack, 1.0 + slack, from, to);
    clipRange(start.y, delta.y, -slack, 1.0 + slack, from, to);
    if (!(from <= to))
        return;
    precise const vec2 firstAt = start + from * delta;
    precise const vec2 lastAt = start + to * delta;
    precise const vec2 middleAt = start + (0.5 * (from + to)) * delta;
    const float first = valueAt(patch_, firstAt);
    const float last = valueAt(patch_, lastAt);
    const float middle = valueAt(patch_, middleAt);
    extent.x = min(extent.x, min(first, last));
    extent.y = max(extent.y, max(first, last));
    precise const float square = 2.0 * (first + last - 2.0 * middle);
    precise const float slope = last - first - square;
    // It turns where its slope changes sign.
    if (slope * (slope + 2.0 * square) < 0.0 && abs(square) > 1e-30) {
        const float turn = clamp(-slope / (2.0 * square), 0.0, 1.0);
        precise const float value = first + turn * (slope + turn * square);
        extent.x = min(extent.x, value);
        extent.y = max(extent.y, value);
    }
}

// The flags of the part of the shape that lies in a cell.
uint pieceFlags(Mip mip, Shape s, ivec2 cell)
{
    const ivec2 left = ivec2(wrapTexel(mip.x, cell.x), wrapTexel(mip.y, cell.y));
    const ivec2 right = ivec2(wrapTexel(mip.x, cell.x + 1), wrapTexel(mip.y, cell.y + 1));
    const float f00 = texelAt(left.x, left.y, mip.number);
    const float f10 = texelAt(right.x, left.y, mip.number);
    const float f01 = texelAt(left.x, right.y, mip.number);
    const float f11 = texelAt(right.x, right.y, mip.number);
    if (!isFinite(f00) || !isFinite(f10) || !isFinite(f01) || !isFinite(f11))
        return kMayBeBoth;
    const float least = min(min(f00, f10), min(f01, f11));
    const float most = max(max(f00, f10), max(f01, f11));
    const float largest =
        max(max(abs(least), abs(most)), max(abs(alphaOpaqueFrom), abs(alphaTransparentBelow)));
    if (!(largest < 1e18))
        return kMayBeBoth;
    const float valueSlack = 4.0 * (most - least) * s.slack + largest * (1.0 / 32768.0) + 1e-18;
    precise const float opaque = alphaOpaqueFrom + valueSlack;
    precise const float transparent = alphaTransparentBelow - valueSlack;

    precise const Patch patch_ = Patch(f00, f10 - f00, f01 - f00, (f11 - f10) - (f01 - f00));
    const vec2 zero = vec2(0.0);
    precise const vec2 corner = s.corner - vec2(cell - s.cell);
    const vec2 reach = s.margin + s.slack;
    precise const vec2 low = max(zero, corner + min(zero, min(s.i, s.j)) - reach);
    precise const vec2 high = min(vec2(1.0), corner + max(zero, max(s.i, s.j)) + reach);
    if (low.x > high.x || low.y > high.y)
        return 0u;
    vec4 values = vec4(valueAt(patch_, low), valueAt(patch_, vec2(high.x, low.y)), valueAt(patch_, vec2(low.x, high.y)),
                       valueAt(patch_, high));
    const float boxLeast = min(min(values.x, values.y), min(values.z, values.w));
    const float boxMost = max(max(values.x, values.y), max(values.z, values.w));
    if (boxLeast >= opaque)
        return kMayNotBeTransparent;
    if (boxMost < transparent)
        return kMayNotBeOpaque;

    precise const vec2 across = s.j - s.i;
    const float size = max(max(max(abs(s.i.x), abs(s.i.y)), max(abs(s.j.x), abs(s.j.y))),
                           max(abs(across.x), abs(across.y)));
    const float scale = size + 4.0 + 2.0 * max(s.margin.x, s.margin.y);
    const float edgeSlack = 4.0 * scale * (size * (1.0 / 2097152.0) + 1.0 / 16777216.0);
    const float area = crossOf(s.i, s.j);
    const bool moved = s.margin.x > 0.0 || s.margin.y > 0.0;
    // If rounding hides the orientation of the triangle, its edges move to both sides.
    const bool upwards = area > -edgeSlack;
    const bool downwards = moved && area < edgeSlack;
    vec2 extent = vec2(1e30, -1e30);
    bvec4 inside = bvec4(true);
    for (int k = 0; k < 3; ++k) {
        precise const vec2 start = k == 0 ? corner : k == 1 ? corner + s.i : corner + s.j;
        const vec2 delta = k == 0 ? s.i : k == 1 ? across : -s.j;
        const vec2 outwards = vec2(delta.y < 0.0 ? -s.margin.x : s.margin.x, delta.x > 0.0 ? -s.margin.y : s.margin.y);
        precise const vec2 above = start + outwards;
        precise const vec2 below = start - outwards;
        if (upwards || !moved)
            addEdge(patch_, above, delta, s.slack, extent);
        if (downwards)
            addEdge(patch_, below, delta, s.slack, extent);
        // The corners between the edge, moved outwards, and its parallel through the other vertex, likewise.
        const float more = abs(delta.y) * s.margin.x + abs(delta.x) * s.margin.y +
                           4.0 * s.slack * (abs(delta.x) + abs(delta.y)) + edgeSlack;
        const vec4 side = vec4(crossOf(delta, low - start), crossOf(delta, vec2(high.x, low.y) - start),
                               crossOf(delta, vec2(low.x, high.y) - start), crossOf(delta, high - start));
        inside.x = inside.x && side.x >= min(0.0, area) - more && side.x <= max(0.0, area) + more;
        inside.y = inside.y && side.y >= min(0.0, area) - more && side.y <= max(0.0, area) + more;
        inside.z = inside.z && side.z >= min(0.0, area) - more && side.z <= max(0.0, area) + more;
        inside.w = inside.w && side.w >= min(0.0, area) - more && side.w <= max(0.0, area) + more;
    }
    for (int k = 0; k < 4; ++k)
        if (inside[k])
            extent = vec2(min(extent.x, values[k]), max(extent.y, values[k]));
    if (extent.x > extent.y)
        return 0u; // next to the cell
    return (extent.x >= opaque ? 0u : kMayNotBeOpaque) | (extent.y < transparent ? 0u : kMayNotBeTransparent);
}
