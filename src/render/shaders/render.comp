// SPDX-License-Identifier: Apache-2.0
// The picture by ray queries: every candidate that the proceed loop hands over samples the texture.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_query : require
#include "alpha_test.glsl"
#include "shading.glsl"
#include "states.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

Hit traceClosest(vec3 origin, vec3 direction)
{
    rayQueryEXT query;
    rayQueryInitializeEXT(query, world, gl_RayFlagsNoneEXT, 0xff, origin, 0.0, direction, kFar);
    while (rayQueryProceedEXT(query)) {
        if (kCount)
            ++candidates;
        const uint geometry = rayQueryGetIntersectionInstanceCustomIndexEXT(query, false) +
                              rayQueryGetIntersectionGeometryIndexEXT(query, false);
        const uint primitive = rayQueryGetIntersectionPrimitiveIndexEXT(query, false);
        const vec2 barycentrics = rayQueryGetIntersectionBarycentricsEXT(query, false);
        if (kPaint ? endsRay(geometry, primitive, barycentrics, rayQueryGetIntersectionTEXT(query, false))
                   : isLeaf(geometry, primitive, barycentrics))
            rayQueryConfirmIntersectionEXT(query);
    }
    if (kCount)
        ++rays;
    Hit hit;
    hit.t = kNothing;
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT)
        hit = describeHit(rayQueryGetIntersectionTEXT(query, true),
                          rayQueryGetIntersectionInstanceCustomIndexEXT(query, true) +
                              rayQueryGetIntersectionGeometryIndexEXT(query, true),
                          rayQueryGetIntersectionPrimitiveIndexEXT(query, true),
                          rayQueryGetIntersectionBarycentricsEXT(query, true),
                          mat3(rayQueryGetIntersectionWorldToObjectEXT(query, true)));
    if (kPaint && hit.t != kNothing) {
        const uint primitive = rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
        const vec2 barycentrics = rayQueryGetIntersectionBarycentricsEXT(query, true);
        metState = stateAt(hit.geometry, primitive, barycentrics);
        metEdge = awayFromEdge(hit.geometry, primitive, barycentrics);
    }
    return hit;
}

vec3 paintPoint(vec3 origin, vec3 direction)
{
    metState = kNoState;
    veil = kFar;
    float t;
    const vec3 lit = display(shade(origin, direction, t));
    return paint(lit, t == kNothing ? kFar : t);
}

bool isShadowed(vec3 origin, vec3 direction, float near)
{
    rayQueryEXT query;
    rayQueryInitializeEXT(query, world, gl_RayFlagsTerminateOnFirstHitEXT, 0xff, origin, near, direction, kFar);
    while (rayQueryProceedEXT(query)) {
        if (kCount)
            ++candidates;
        const uint geometry = rayQueryGetIntersectionInstanceCustomIndexEXT(query, false) +
                              rayQueryGetIntersectionGeometryIndexEXT(query, false);
        if (isLeaf(geometry, rayQueryGetIntersectionPrimitiveIndexEXT(query, false),
                   rayQueryGetIntersectionBarycentricsEXT(query, false)))
            rayQueryConfirmIntersectionEXT(query);
    }
    if (kCount)
        ++rays;
    return rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT;
}

void main()
{
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (all(lessThan(pixel, pictureSize())))
        drawPixel(pixel);
}
