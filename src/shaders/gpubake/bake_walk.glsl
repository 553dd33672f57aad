// SPDX-License-Identifier: Apache-2.0
// Finds the flags of a shape: whether some point of it, margins included, may not be opaque, or not transparent.

// A box of no more cells than that is walked row by row. maskBits() has 32 columns.
const int kMostColumns = 30;
const int kMostRows = 16;
// A shape is not looked at more closely than that.
const uint kMostParts = 1024u;
const uint kMostDepth = 12u;

// The cells that a shape touches, row by row.
uint walkRows(Mip mip, Shape s, ivec4 box)
{
    precise const vec2 across = s.j - s.i;
    const vec2 reach = s.margin + s.slack;
    uint flags = 0u;
    for (int y = box.y; y <= box.w; ++y) {
        precise const float top = float(y - s.cell.y) - reach.y;
        precise const float bottom = float(y - s.cell.y + 1) + reach.y;
        float left = 1e30;
        float right = -1e30;
        for (int k = 0; k < 3; ++k) {
            precise const vec2 start = k == 0 ? s.corner : k == 1 ? s.corner + s.i : s.corner + s.j;
            const vec2 delta = k == 0 ? s.i : k == 1 ? across : -s.j;
            float from = 0.0;
            float to = 1.0;
            clipRange(start.y, delta.y, top, bottom, from, to);
            if (from <= to) {
                precise const float a = start.x + from * delta.x;
                precise const float b = start.x + to * delta.x;
                left = min(left, min(a, b));
                right = max(right, max(a, b));
            }
        }
        if (left > right)
            continue;
        precise const float first = left - reach.x;
        precise const float last = right + reach.x;
        const int x0 = max(int(floor(first)) + s.cell.x, box.x);
        const int x1 = min(int(floor(last)) + s.cell.x, box.z);
        if (x0 > x1)
            continue;
        const uvec2 bits = rowBits(mip, x0, x1 - x0 + 1, y);
        flags |= ((bits.x & ~bits.y) != 0u ? kMayNotBeOpaque : 0u) |
                 ((bits.y & ~bits.x) != 0u ? kMayNotBeTransparent : 0u);
        uint mixed = bits.x & bits.y;
        if (mixed != 0u && !mip.bilinear)
            flags = kMayBeBoth;
        while (mixed != 0u && flags != kMayBeBoth) {
            const int x = x0 + findLSB(mixed);
            mixed &= mixed - 1u;
            flags |= pieceFlags(mip, s, ivec2(x, y));
        }
        if (flags == kMayBeBoth)
            break;
    }
    return flags;
}

// A large shape is divided in four, again and again, as far as blocks of cells do not answer for it.
uint shapeFlags(Mip mip, Shape whole)
{
    uint flags = 0u;
    uint path = 0u; // two bits for each division
    uint depth = 0u;
    for (uint parts = 0u; parts < kMostParts; ++parts) {
        float a = 0.0;
        float b = 0.0;
        float size = 1.0;
        for (uint d = depth; d-- > 0u;) {
            const uint child = (path >> (2u * d)) & 3u;
            size *= 0.5;
            a += child == 1u || child == 3u ? size : 0.0;
            b += child == 2u || child == 3u ? size : 0.0;
            size = child == 3u ? -size : size;
        }
        const Shape s = partOf(whole, a, b, size);
        const ivec4 box = cellsAround(s);
        uint some = boxFlags(mip, box.xy, box.zw);
        if (some == kMayBeBoth) {
            if (box.z - box.x < kMostColumns && box.w - box.y < kMostRows) {
                some = walkRows(mip, s, box);
            } else if (depth < kMostDepth) {
                ++depth;
                path <<= 2u;
                continue;
            }
        }
        flags |= some;
        if (flags == kMayBeBoth)
            return flags;
        while (depth > 0u && (path & 3u) == 3u) {
            path >>= 2u;
            --depth;
        }
        if (depth == 0u)
            return flags;
        ++path;
    }
    return kMayBeBoth;
}
