// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
// Chains of rays: the ray generation shader traces the first, the closest-hit or miss shader of each the next one,
// with a callable shader in between. One of RAYGEN, MISS, CLOSEST_HIT, ANY_HIT, CALLABLE is defined. With QUERIES, each
// shader that traces a ray traces another one with a ray query before, and so does the any-hit shader. With
// OTHER_PAYLOAD, a closest-hit shader of other rays.
#ifdef QUERIES
#extension GL_EXT_ray_query : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#endif

#include "ray.glsl"

struct Step {
    uint stage; // 1: miss, 2: closest-hit
    uint customIndex;
    uint customIndexAfter; // the same, read after the next ray
    uint flags;
    uint flagsAfter;
    uint candidates;
    uint bad;      // any-hit shaders that read wrong ray flags or payload
    uint callable; // returned by the callable shaders
    float t;
    uint below; // steps after this one, counted through the payloads
    uint queryCandidates;
    uint queryCommitted;
    uint queryCustomIndex;
    float queryT;
    uint queryFlags;
    uint primitive;
    uint anyHitQueries; // ray queries in the any-hit shader: the same ray
    uint anyHitCommitted;
    float anyHitT;
    uint anyHitCustomIndex;
};

layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1, std430) readonly buffer Rays { Ray rays[]; };
layout(binding = 2, std430) buffer Steps { Step steps[]; };
layout(push_constant) uniform Push
{
    uint depth; // rays in a chain
    uint pad;
    uvec2 queryScene;
} push;

struct Payload {
    uint id;
    uint depth;
    uint count;
    uint bad;
    uint below;
    uint canary;
};

#if defined(OTHER_PAYLOAD)

// Payloads of rays that are never traced.
layout(location = 0) rayPayloadInEXT uvec4 many[16];

void main()
{
    many[0].x += 1u;
}

#elif defined(CALLABLE)

layout(location = 0) callableDataInEXT uint called;
layout(location = 1) callableDataEXT uint inner;

void main()
{
    // The first one calls the second one.
    if ((called & 0x80000000u) == 0u) {
        inner = called | 0x80000000u;
        executeCallableEXT(1, 1);
        called = inner * 2u;
    } else {
        called = (called & 0x7fffffffu) + 5u;
    }
}

#elif defined(ANY_HIT)

layout(location = 0) rayPayloadInEXT Payload payload;

void main()
{
    const Ray ray = rays[payload.id * push.depth + payload.depth];
    payload.count += 1u;
    if (gl_IncomingRayFlagsEXT != ray.flags || payload.canary != payload.id * 77u + payload.depth)
        payload.bad += 1u;
#ifdef QUERIES
    const uint at = payload.id * push.depth + payload.depth;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(push.queryScene), ray.flags, ray.cullMask,
                          vec3(ray.origin[0], ray.origin[1], ray.origin[2]), ray.tMin,
                          vec3(ray.direction[0], ray.direction[1], ray.direction[2]), ray.tMax);
    while (rayQueryProceedEXT(query)) {
        if (ray.rule == 1u)
            rayQueryConfirmIntersectionEXT(query);
    }
    steps[at].anyHitQueries += 1u;
    steps[at].anyHitCommitted = rayQueryGetIntersectionTypeEXT(query, true);
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT) {
        steps[at].anyHitCustomIndex = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));
        steps[at].anyHitT = rayQueryGetIntersectionTEXT(query, true);
    }
#endif
    if (ray.rule != 1u)
        ignoreIntersectionEXT;
}

#else

#ifndef RAYGEN
layout(location = 0) rayPayloadInEXT Payload payload;
#endif
layout(location = 1) rayPayloadEXT Payload next;
layout(location = 0) callableDataEXT uint called;

void traceNext(uint id, uint depth)
{
    const uint at = id * push.depth + depth;
    const Ray ray = rays[at];
    called = id + depth;
    executeCallableEXT(0, 0);
    steps[at].callable = called;
#ifdef QUERIES
    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(push.queryScene), ray.flags, ray.cullMask,
                          vec3(ray.origin[0], ray.origin[1], ray.origin[2]), ray.tMin,
                          vec3(ray.direction[0], ray.direction[1], ray.direction[2]), ray.tMax);
    uint count = 0u;
    while (rayQueryProceedEXT(query)) {
        ++count;
        if (ray.rule == 1u)
            rayQueryConfirmIntersectionEXT(query);
    }
    steps[at].queryCandidates = count;
    steps[at].queryFlags = rayQueryGetRayFlagsEXT(query);
    steps[at].queryCommitted = rayQueryGetIntersectionTypeEXT(query, true);
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT) {
        steps[at].queryCustomIndex = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));
        steps[at].queryT = rayQueryGetIntersectionTEXT(query, true);
    }
#endif
    next.id = id;
    next.depth = depth;
    next.count = 0u;
    next.bad = 0u;
    next.below = 0u;
    next.canary = id * 77u + depth;
    traceRayEXT(scene, ray.flags, ray.cullMask, 0, 0, 0, vec3(ray.origin[0], ray.origin[1], ray.origin[2]), ray.tMin,
                vec3(ray.direction[0], ray.direction[1], ray.direction[2]), ray.tMax, 1);
    if (next.canary != id * 77u + depth || next.id != id || next.depth != depth)
        steps[at].bad += 1000u;
}

#ifdef RAYGEN
void main()
{
    traceNext(gl_LaunchIDEXT.x, 0u);
}
#else
void main()
{
    const uint id = payload.id;
    const uint depth = payload.depth;
    const uint at = id * push.depth + depth;
    steps[at].flags = gl_IncomingRayFlagsEXT;
    steps[at].candidates = payload.count;
    steps[at].bad += payload.bad;
#ifdef CLOSEST_HIT
    steps[at].stage = 2u;
    steps[at].customIndex = uint(gl_InstanceCustomIndexEXT);
    steps[at].t = gl_HitTEXT;
    steps[at].primitive = uint(gl_PrimitiveID);
#else
    steps[at].stage = 1u;
#endif
    if (depth + 1u < push.depth) {
        traceNext(id, depth + 1u);
        payload.below = next.below + 1u;
    }
    steps[at].below = payload.below;
    steps[at].flagsAfter = gl_IncomingRayFlagsEXT;
#ifdef CLOSEST_HIT
    steps[at].customIndexAfter = uint(gl_InstanceCustomIndexEXT);
#endif
}
#endif
#endif
