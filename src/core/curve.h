// The space-filling curve that orders the micro-triangles of a micromap triangle (raytraversal.adoc, "Ray Opacity
// Micromap"): child 0 lies at vertex 0, child 1 in the middle with its order flipped, child 2 at vertex 1, child 3 at
// vertex 2 with its order flipped. C++ and GLSL; see shared.h.
#ifndef VELLUM_CORE_CURVE_H
#define VELLUM_CORE_CURVE_H

#ifdef __cplusplus
#include "core/shared.h"
#else
#include "shared.h"
#endif

VELLUM_SHARED_BEGIN

VELLUM_CONST uint kMaxSubdivisionLevel = 12u;

// Spreads the low 16 bits of x to the even bits of the result.
VELLUM_FN uint spreadBits(VELLUM_IN uint x)
{
    uint r = (x | (x << 8u)) & 0x00ff00ffu;
    r = (r | (r << 4u)) & 0x0f0f0f0fu;
    r = (r | (r << 2u)) & 0x33333333u;
    return (r | (r << 1u)) & 0x55555555u;
}

// Index on the curve of the micro-triangle in grid cell (iu, iv); `inverted` picks the cell's far half.
//   iu, iv    cell in steps of 1 / 2^level, iu + iv < 2^level (and < 2^level - 1 where inverted)
//   level     0..12
//
// Seen bit by bit from the top, the micro-triangle lies at vertex 0, in the middle, at vertex 1 or at vertex 2 of the
// triangle of the level above. With iw counting down from vertex 0, a vertex-0 or middle child is one where the bits of
// u and w differ from those of a corner child; which of the corners or halves it is depends on how often the path so
// far was flipped, a running parity, which a prefix xor gives for all levels at once.
VELLUM_FN uint curveIndexOfCell(VELLUM_IN uint iu, VELLUM_IN uint iv, VELLUM_IN bool inverted, VELLUM_IN uint level)
{
    const uint mask = (1u << level) - 1u;
    const uint iw = (inverted ? ~(iu + iv) - 1u : ~(iu + iv)) & mask;
    const uint atMiddleOrCorner = ~(iu ^ iw) & mask; // low bit of each base-4 digit
    const uint flips = (iu ^ iv) & atMiddleOrCorner;
    uint parity = flips;
    parity = parity ^ (parity >> 1u);
    parity = parity ^ (parity >> 2u);
    parity = parity ^ (parity >> 4u);
    parity = parity ^ (parity >> 8u);
    const uint high = ((parity ^ iu) & ~atMiddleOrCorner & mask) | flips;
    return spreadBits(atMiddleOrCorner) | (spreadBits(high) << 1u);
}

// Index on the curve of the micro-triangle at barycentrics (u, v), the weights of vertices 1 and 2.
// Any input is safe: NaN and values outside the triangle are clamped into it.
VELLUM_FN uint curveIndex(VELLUM_IN float u, VELLUM_IN float v, VELLUM_IN uint level)
{
    const uint steps = 1u << level;
    const float cu = (u > 0.0f ? (u < 1.0f ? u : 1.0f) : 0.0f) * toFloat(steps);
    const float cv = (v > 0.0f ? (v < 1.0f ? v : 1.0f) : 0.0f) * toFloat(steps);
    uint iu = toUint(cu);
    uint iv = toUint(cv);
    const float restU = cu - toFloat(iu);
    const float restV = cv - toFloat(iv);
    iu = iu < steps ? iu : steps - 1u;
    iv = iv < steps ? iv : steps - 1u;
    const uint diagonal = iu + iv;
    if (diagonal >= steps)
        iu = steps - 1u - iv;
    const bool inverted = restU + restV >= 1.0f && diagonal < steps - 1u;
    return curveIndexOfCell(iu, iv, inverted, level);
}

VELLUM_SHARED_END

#endif
