// SPDX-License-Identifier: Apache-2.0
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

// The lesser one. Drivers make this instruction of a comparison and a selection, which takes them longer.
#ifdef __cplusplus
constexpr uint lesser(uint x, uint y)
{
    return x < y ? x : y;
}
#else
#define lesser(x, y) min(x, y)
#endif

VELLUM_CONST uint kMaxSubdivisionLevel = 12u;

// Spreads the low 16 bits of x to the even bits of the result. The last step adds, which drivers compile faster than a
// shift; multiplications in the others would be faster still, but AMD GPUs need more registers then.
VELLUM_FN uint spreadBits(VELLUM_IN uint x)
{
    const uint bytes = (x | (x << 8u)) & 0x00ff00ffu;
    const uint nibbles = (bytes | (bytes << 4u)) & 0x0f0f0f0fu;
    const uint pairs = (nibbles | (nibbles << 2u)) & 0x33333333u;
    return pairs + (pairs & 0x22222222u);
}

// Index on the curve of the micro-triangle of the highest level at barycentrics (u, v), the weights of vertices 1
// and 2. That of the micro-triangle of a lower level that it lies in is what is left when two bits for each level
// between them are cut off at the end. Any input is safe: the index of some micro-triangle, and for what is outside by
// no more than rounding errors, of one at the edge.
//
// Seen bit by bit from the top, the micro-triangle lies at vertex 0, in the middle, at vertex 1 or at vertex 2 of the
// triangle of the level above: child 0 to 3. Where the bits of iu and sum differ, it is child 1 or 3, and child 3 if
// those of iu and iv differ, too. Where they are equal, it is child 0 or 2. Which of these depends on how often the
// path so far was flipped, a running parity, which a prefix xor gives for all levels at once.
VELLUM_CONST uint kFinestMask = (1u << kMaxSubdivisionLevel) - 1u;
VELLUM_FN uint finestCurveIndex(VELLUM_IN float u, VELLUM_IN float v)
{
    const float steps = toFloat(1u << kMaxSubdivisionLevel);
    const float cellsU = u * steps;
    const float cellsV = v * steps;
    const uint cellU = toUint(cellsU);
    const uint cellV = toUint(cellsV);
    // The place in the cell. These differences are exact, and so is their sum unless u or v is below 2^-12; that of u
    // and v is rounded, to beyond the diagonal also.
    const float rest = (cellsU - toFloat(cellU)) + (cellsV - toFloat(cellV));
    const uint iv = lesser(cellV, kFinestMask);
    const uint mostU = kFinestMask - iv;
    const uint iu = lesser(cellU, mostU);
    // One more in the cell's far half: 2^12 - 1 less the cells between the micro-triangle and the edge opposite vertex
    // 0.
    const uint sum = lesser(iu + iv + toUint(rest), kFinestMask);

    const uint low = iu ^ sum;
    const uint corner = (iu ^ iv) & low;
    const uint parity1 = corner ^ (corner >> 1u);
    const uint parity2 = parity1 ^ (parity1 >> 2u);
    const uint parity = parity2 ^ (parity2 >> 4u) ^ (parity2 >> 8u); // of 12 bits
    const uint high = corner | (~low & (parity ^ iu));
    return spreadBits(low) | (spreadBits(high) << 1u);
}

// The index for a level of 0..12.
VELLUM_FN uint curveIndex(VELLUM_IN float u, VELLUM_IN float v, VELLUM_IN uint level)
{
    return finestCurveIndex(u, v) >> (2u * (kMaxSubdivisionLevel - level));
}

VELLUM_SHARED_END

#endif
