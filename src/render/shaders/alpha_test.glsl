// SPDX-License-Identifier: Apache-2.0
// The application's alpha test.
#ifndef VELLUM_ALPHA_TEST_GLSL
#define VELLUM_ALPHA_TEST_GLSL
#include "scene.glsl"

bool isLeaf(uint geometry, uint primitive, vec2 barycentrics)
{
    const GeometryRecord g = geometries[geometry];
    if (g.texture < 0)
        return true;
    const vec2 uv = textureCoordinates(g, primitive, barycentrics);
    float alpha = textureLod(textures[nonuniformEXT(g.texture)], uv, 0.0).a * g.color.a;
    if (kVertexAlphas && g.firstAlpha >= 0) {
        const uint first = uint(g.firstAlpha) + 3u * primitive;
        alpha *= alphas[first] * (1.0 - barycentrics.x - barycentrics.y) + alphas[first + 1u] * barycentrics.x +
                 alphas[first + 2u] * barycentrics.y;
    }
    if (kHeavyReads > 0u) {
        // Work of a costly material, of which nothing is left in the result: no sum of alphas is below zero.
        float sum = 0.0;
        for (uint i = 1u; i <= kHeavyReads; ++i)
            sum += textureLod(textures[nonuniformEXT(g.texture)], uv + vec2(0.0137, 0.0071) * float(i), 0.0).a;
        alpha += min(sum, 0.0);
    }
    return alpha >= g.cutoff;
}

#endif
