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

// Index on the curve of a micro-triangle.
//   iu, iv  its cell in steps of 1 / 2^level
//   iw      so many cells lie between it and the edge opposite vertex 0: 2^level - 1 - iu - iv, or one less for the
//           cell's far half
//   mask    2^level - 1, for level 0..12
//
// Seen bit by bit from the top, the micro-triangle lies at vertex 0, in the middle, at vertex 1 or at vertex 2 of the
// triangle of the level above. At vertex 0 and in the middle the bits of u and w differ; at the corners they do not.
// Which of the corners or halves it is depends on how often the path so far was flipped, a running parity, which a
// prefix xor gives for all levels at once.
VELLUM_FN uint curveIndexOfCell(VELLUM_IN uint iu, VELLUM_IN uint iv, VELLUM_IN uint iw, VELLUM_IN uint mask)
{
    const uint differ = iu ^ iw;
    const uint flips = (iu ^ iv) & ~differ;
    uint parity = flips;
    parity = parity ^ (parity >> 1u);
    parity = parity ^ (parity >> 2u);
    parity = parity ^ (parity >> 4u);
    parity = parity ^ (parity >> 8u);
    const uint high = ((parity ^ iu) & differ) | flips;
    return spreadBits(differ ^ mask) | (spreadBits(high) << 1u);
}

// Index on the curve of the micro-triangle at barycentrics (u, v), the weights of vertices 1 and 2.
// Any input is safe: the index of some micro-triangle, and for what is outside by no more than rounding errors, of one
// at the edge.
VELLUM_FN uint curveIndex(VELLUM_IN float u, VELLUM_IN float v, VELLUM_IN uint level)
{
    const uint mask = (1u << level) - 1u;
    const float cu = u * toFloat(1u << level);
    const float cv = v * toFloat(1u << level);
    uint iu = toUint(cu);
    uint iv = toUint(cv);
    iv = iv < mask ? iv : mask;
    iu = iu < mask - iv ? iu : mask - iv;
    // Of the cells from its own to the edge opposite vertex 0, one less where it is the far half: then the sum has
    // reached the next diagonal.
    const uint rest = mask - iv - iu;
    uint sum = toUint(cu + cv);
    sum = sum < mask ? sum : mask;
    return curveIndexOfCell(iu, iv, rest - (mask - sum < rest ? 1u : 0u), mask);
}

VELLUM_SHARED_END

#endif
