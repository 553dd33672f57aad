// SPDX-License-Identifier: Apache-2.0
// The result of a ray.
#ifndef VELLUM_HIT_GLSL
#define VELLUM_HIT_GLSL
#include "scene.glsl"

struct Hit {
    float t; // kNothing: nothing was met, and the rest means nothing
    uint geometry;
    vec2 uv;
    vec3 normal;      // of length 1, in the world
    float visibility; // of the sky: 0 to 1
};

const float kNothing = -1.0;

vec3 decodeNormal(uint packed)
{
    const vec2 e = vec2(packed & 4095u, (packed >> 12) & 4095u) / 4095.0 * 2.0 - 1.0;
    vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
    if (n.z < 0.0)
        n.xy = (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
    return normalize(n);
}

// `worldToObject`: of the instance; its transpose takes normals to the world, however it scales or mirrors.
Hit describeHit(float t, uint geometry, uint primitive, vec2 barycentrics, mat3 worldToObject)
{
    const GeometryRecord g = geometries[geometry];
    const uint first = 3u * (g.firstTriangle + primitive);
    const vec3 weights = vec3(1.0 - barycentrics.x - barycentrics.y, barycentrics);
    vec3 normal = vec3(0.0);
    float visibility = 0.0;
    for (uint i = 0u; i < 3u; ++i) {
        normal += weights[i] * decodeNormal(normals[first + i]);
        visibility += weights[i] * float(normals[first + i] >> 24) / 255.0;
    }
    return Hit(t, geometry, textureCoordinates(g, primitive, barycentrics), normalize(normal * worldToObject),
               visibility);
}

#endif
