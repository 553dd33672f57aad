// SPDX-License-Identifier: Apache-2.0
// The states of micromaps, painted on the leaves (--mode states). makeStateTable of renderer.cpp has their layout.
#include "alpha_test.glsl"
#include "curve.h"

layout(std430, binding = 6) readonly buffer States { uint states[]; };

const uint kTransparent = 0u;
const uint kNoState = ~0u;
const float kVeil = 0.35; // how much of what is transparent shows

// The micromap states along a ray.
uint metState = kNoState; // where it ended
float metEdge = 1.0;      // 0 on the outline of a micro-triangle
float veil = 1e30;        // where it first went through a transparent micro-triangle

vec3 stateColor(uint state)
{
    return unpackUnorm4x8(states[state]).bgr;
}

// The state of a place on a triangle.
uint stateAt(uint geometry, uint primitive, vec2 barycentrics)
{
    const uint at = 4u + 2u * (geometries[geometry].firstTriangle + primitive);
    const uint kind = states[at + 1u];
    if ((kind & 0x200u) == 0u) // no micromap, or one state all over
        return (kind & 0x100u) != 0u ? states[at] : kNoState;
    const uint index = curveIndex(barycentrics.x, barycentrics.y, kind & 0xffu);
    const bool two = (kind & 0x400u) != 0u;
    const uint byte = states[at] + (two ? index >> 3 : index >> 2);
    const uint bit = 8u * (byte & 3u) + (two ? index & 7u : 2u * (index & 3u));
    return (states[byte >> 2] >> bit) & (two ? 1u : 3u);
}

// The distance of a point from the outline of its micro-triangle: 0 on it, 1 from a tenth of its height on.
float awayFromEdge(uint geometry, uint primitive, vec2 barycentrics)
{
    const uint kind = states[4u + 2u * (geometries[geometry].firstTriangle + primitive) + 1u];
    const float steps = (kind & 0x200u) != 0u ? float(1u << (kind & 0xffu)) : 1.0;
    const vec3 place = fract(vec3(1.0 - barycentrics.x - barycentrics.y, barycentrics) * steps);
    const vec3 away = min(place, 1.0 - place);
    return smoothstep(0.0, 0.1, min(away.x, min(away.y, away.z)));
}

// A candidate on the way of a primary ray: does the ray end there?
bool endsRay(uint geometry, uint primitive, vec2 barycentrics, float t)
{
    const uint state = stateAt(geometry, primitive, barycentrics);
    if (state == kNoState)
        return isLeaf(geometry, primitive, barycentrics);
    if (state != kTransparent)
        return true;
    veil = min(veil, t);
    return false;
}

// A picture's point, lit as without states: grey, with the states in their colours. `t` is where the ray ended.
vec3 paint(vec3 lit, float t)
{
    float light = dot(lit, vec3(0.30, 0.59, 0.11));
    vec3 color = vec3(0.35 + 0.6 * light);
    if (metState != kNoState)
        color = stateColor(metState) * clamp(0.5 + 1.1 * light, 0.0, 1.0) * mix(0.75, 1.0, metEdge);
    return veil < t ? mix(color, stateColor(kTransparent), kVeil) : color;
}
