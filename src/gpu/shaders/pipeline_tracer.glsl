// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
// tracer.glsl as a ray tracing pipeline. One of RAYGEN, MISS, CLOSEST_HIT, ANY_HIT, INTERSECTION, CALLABLE is defined, or TRACES:
// what RAYGEN does, in a stage that may be another one. Variants of RAYGEN and TRACES:
//   RAY_FLAGS=n   the ray flags are this constant instead of the ray's own
//   SPEC_FLAGS    they are a specialization constant
//   SPEC_PARAMETERS  so are the parameters that name records
//   MIXED=n       some rays are traced by an instruction of its own with the constant n, where that is their flags
//   SPEC_MIXED    the same with the specialization constant
//   BY_ADDRESS    the acceleration structure comes as a device address
//   IN_FUNCTION   rays are traced in a loop, in a function that gets the flags as a parameter
//   CALLS         a callable shader is executed afterwards
#ifdef BY_ADDRESS
#extension GL_EXT_ray_query : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#endif
#if defined(RAY_FLAGS) || defined(SPEC_FLAGS) || defined(MIXED)
#extension GL_EXT_opacity_micromap : require
#endif
#ifdef RAYGEN
#define TRACES
#endif
#include "pipeline_common.glsl"

#ifndef TRACES
layout(shaderRecordEXT, std430) buffer Record { uint recordData[4]; };
#endif

#ifndef TRACES
// Functions, for the test that gives several entry points the same one.
#ifndef CALLABLE
uint rayFlagsRead()
{
    return gl_IncomingRayFlagsEXT;
}
#endif
// The first word; the others are computed of it.
uint recordRead()
{
    if (push.recordWords == 0u)
        return kUnknown;
    const uint first = recordData[0];
    if (push.recordWords == 4u && (recordData[1] != ~first || recordData[2] != first * 0x9e3779b1u ||
                                   recordData[3] != (first ^ 0x5bd1e995u)))
        return kUnknown;
    return first;
}
#if !defined(MISS) && !defined(CALLABLE)
uint customIndexRead()
{
    return uint(gl_InstanceCustomIndexEXT);
}
#endif
#endif

// The type of hit attributes other than vec2, of which those of triangles are the first two numbers: SCALARS, ARRAY, or
// WIDE, where boxes have as many as there may be.
#if defined(SCALARS)
struct Scalars {
    float u;
    float v;
};
#define ATTRIBUTES hitAttributeEXT Scalars scalars;
#define ATTRIBUTE_U scalars.u
#define ATTRIBUTE_V scalars.v
#define WRITE_WIDE
#define ATTRIBUTES_RIGHT true
#elif defined(ARRAY)
#define ATTRIBUTES hitAttributeEXT float array[2];
#define ATTRIBUTE_U array[0]
#define ATTRIBUTE_V array[1]
#define WRITE_WIDE
#define ATTRIBUTES_RIGHT true
#elif defined(WIDE)
struct Wide {
    vec2 uv;
    float more[6];
};
#define ATTRIBUTES hitAttributeEXT Wide wide;
#define ATTRIBUTE_U wide.uv.x
#define ATTRIBUTE_V wide.uv.y
#define WRITE_WIDE                                                                                                     \
    for (int i = 0; i < 6; ++i)                                                                                        \
        wide.more[i] = wide.uv.x * float(i + 3);
#define ATTRIBUTES_RIGHT                                                                                               \
    (wide.more[0] == wide.uv.x * 3.0 && wide.more[1] == wide.uv.x * 4.0 && wide.more[2] == wide.uv.x * 5.0 &&          \
     wide.more[3] == wide.uv.x * 6.0 && wide.more[4] == wide.uv.x * 7.0 && wide.more[5] == wide.uv.x * 8.0)
#else
#define ATTRIBUTES hitAttributeEXT vec2 attributes;
#define ATTRIBUTE_U attributes.x
#define ATTRIBUTE_V attributes.y
#define WRITE_WIDE
#define ATTRIBUTES_RIGHT true
#endif

// DECOY: a shader that must not run; the check sees it by the payload, or by the number of visits.
#ifdef DECOY
#define DECOY_RUNS payload.canary = 0u;
#define VISIT 0x100000u // kDecoyVisit
#else
#define DECOY_RUNS
#define VISIT 1u
#endif

#if defined(TRACES)
layout(location = 0) rayPayloadEXT Payload payload;
#ifdef CALLS
layout(location = 1) callableDataEXT uint called;
#endif

#include "ray_flags.glsl"
#if defined(MIXED) && (MIXED & 0x400) != 0
#define MIXED_FLAGS (uint(MIXED) | gl_RayFlagsForceOpacityMicromap2StateEXT)
#elif defined(MIXED)
#define MIXED_FLAGS uint(MIXED)
#endif

#ifdef BY_ADDRESS
#define SCENE accelerationStructureEXT(push.sceneAddress)
#else
#define SCENE scene
#endif
#ifdef SPEC_PARAMETERS
layout(constant_id = 1) const uint kRecordOffset = 0u;
layout(constant_id = 2) const uint kRecordStride = 0u;
layout(constant_id = 3) const uint kMissIndex = 0u;
#define PARAMETERS kRecordOffset, kRecordStride, kMissIndex
#else
#define PARAMETERS push.sbtOffset, push.sbtStride, push.missIndex
#endif
#define TRACE(ray, flags)                                                                                              \
    traceRayEXT(SCENE, flags, ray.cullMask, PARAMETERS,                                                                \
                vec3(ray.origin[0], ray.origin[1], ray.origin[2]), ray.tMin,                                           \
                vec3(ray.direction[0], ray.direction[1], ray.direction[2]), ray.tMax, 0)

void traceWith(Ray ray, uint flags)
{
    TRACE(ray, flags);
}

void main()
{
    const uint id = (gl_LaunchIDEXT.z * gl_LaunchSizeEXT.y + gl_LaunchIDEXT.y) * gl_LaunchSizeEXT.x + gl_LaunchIDEXT.x;
    if (id >= push.rayCount)
        return;
    const Ray ray = rays[id];
    mores[id].visits = 0u;
    payload.id = id;
    payload.rule = ray.rule;
    payload.count = 0u;
    payload.invocations = 0u;
    payload.flags = kUnknown;
    payload.committed = kUnknown;
    payload.customIndex = 0u;
    payload.instance = 0u;
    payload.geometry = 0u;
    payload.primitive = 0u;
    payload.hitKind = kUnknown;
    payload.record = kUnknown;
    payload.t = 0.0;
    payload.u = 0.0;
    payload.v = 0.0;
    payload.tMin = 0.0;
    payload.canary = canaryOf(id);
#if defined(SPEC_MIXED)
    if (ray.flags == kFlags && (id & 1u) == 0u)
        TRACE(ray, kFlags);
    else
        TRACE(ray, ray.flags);
#elif defined(MIXED)
    if (ray.flags == MIXED_FLAGS && (id & 1u) == 0u)
        TRACE(ray, MIXED_FLAGS);
    else
        TRACE(ray, ray.flags);
#elif defined(IN_FUNCTION)
    // Adds one bit that the compiler cannot predict.
    for (uint i = 0u; i < 4u; ++i) {
        const uint bit = i == 0u ? 0x0fu : i == 1u ? 0xf0u : i == 2u ? 0x300u : 0xffffffffu;
        if (i + 1u == max(ray.cullMask / 0x3fu, 1u))
            traceWith(ray, (ray.flags & bit) | (ray.flags & ~bit));
    }
#else
    TRACE(ray, FLAGS(ray));
#endif
#ifdef CALLS
    called = id;
    executeCallableEXT(id % 3u, 1);
    mores[id].called = called;
#endif
    Result r;
    r.candidates = payload.count;
    r.flags = payload.flags;
    r.committed = payload.committed;
    r.customIndex = payload.customIndex;
    r.instance = payload.instance;
    r.geometry = payload.geometry;
    r.primitive = payload.primitive;
    r.t = payload.t;
    r.u = payload.u;
    r.v = payload.v;
    r.tMin = payload.tMin;
    r.frontFace = payload.hitKind == gl_HitKindFrontFacingTriangleEXT ? 1u : 0u;
    results[id] = r;
    mores[id].hitKind = payload.hitKind;
    mores[id].record = payload.record;
    mores[id].invocations = payload.invocations;
    mores[id].intact =
        payload.canary == canaryOf(id) && payload.id == id && payload.rule == ray.rule ? 1u : 0u;
}

#elif defined(MISS)
layout(location = 0) rayPayloadInEXT Payload payload;

void main()
{
    DECOY_RUNS
    payload.invocations += 1u;
    payload.flags = rayFlagsRead();
    payload.committed = 0u;
    payload.tMin = gl_RayTminEXT;
    payload.record = recordRead();
}

#elif defined(CLOSEST_HIT)
layout(location = 0) rayPayloadInEXT Payload payload;
ATTRIBUTES

void main()
{
    DECOY_RUNS
    payload.invocations += 1u;
    payload.flags = rayFlagsRead();
    payload.hitKind = gl_HitKindEXT;
    payload.committed =
        gl_HitKindEXT == gl_HitKindFrontFacingTriangleEXT || gl_HitKindEXT == gl_HitKindBackFacingTriangleEXT ? 1u : 2u;
    payload.customIndex = customIndexRead();
    payload.instance = uint(gl_InstanceID);
    payload.geometry = uint(gl_GeometryIndexEXT);
    payload.primitive = uint(gl_PrimitiveID);
    payload.t = gl_HitTEXT;
    payload.u = payload.committed == 1u || ATTRIBUTES_RIGHT ? ATTRIBUTE_U : -1.0;
    payload.v = ATTRIBUTE_V;
    payload.tMin = gl_RayTminEXT;
    payload.record = recordRead();
}

#elif defined(ANY_HIT)
layout(location = 0) rayPayloadInEXT Payload payload;
ATTRIBUTES

void main()
{
    DECOY_RUNS
    const bool triangle =
        gl_HitKindEXT == gl_HitKindFrontFacingTriangleEXT || gl_HitKindEXT == gl_HitKindBackFacingTriangleEXT;
    Candidate c;
    c.customIndex = customIndexRead();
    c.instance = uint(gl_InstanceID);
    c.geometry = uint(gl_GeometryIndexEXT);
    c.primitive = uint(gl_PrimitiveID);
    c.t = gl_HitTEXT;
    c.u = triangle || ATTRIBUTES_RIGHT ? ATTRIBUTE_U : -1.0;
    c.v = ATTRIBUTE_V;
    const bool accepted = confirms(payload.rule, c.customIndex, c.instance, c.geometry, c.primitive);
    c.bits = (triangle ? 0u : 1u) | (gl_HitKindEXT == gl_HitKindFrontFacingTriangleEXT ? 4u : 0u) |
             (accepted ? 8u : 0u);
    if (payload.count < push.capacity) {
        const uint at = payload.id * push.capacity + payload.count;
        candidates[at] = c;
        Note n;
        n.flags = rayFlagsRead();
        n.hitKind = gl_HitKindEXT;
        n.record = recordRead();
        n.intact = payload.canary == canaryOf(payload.id) ? 1u : 0u;
        notes[at] = n;
    }
    payload.count += 1u;
    if (!accepted)
        ignoreIntersectionEXT;
    if (payload.rule == kTerminate)
        terminateRayEXT;
}

#elif defined(CALLABLE)
layout(location = 1) callableDataInEXT uint called;

void main()
{
    called += recordRead();
}

#elif defined(INTERSECTION)
ATTRIBUTES

// As in gpu/pipeline_tracer.h
uint hitKindOfBox(Visit v)
{
    return 0x10u + 29u * v.primitive + 51u * v.geometry & 0x7fu;
}

void main()
{
    const uint id = (gl_LaunchIDEXT.z * gl_LaunchSizeEXT.y + gl_LaunchIDEXT.y) * gl_LaunchSizeEXT.x + gl_LaunchIDEXT.x;
    const uint count = atomicAdd(mores[id].visits, VISIT);
    Visit v;
    v.customIndex = customIndexRead();
    v.instance = uint(gl_InstanceID);
    v.geometry = uint(gl_GeometryIndexEXT);
    v.primitive = uint(gl_PrimitiveID);
    v.flags = rayFlagsRead();
    v.record = recordRead();
    v.reported = 0u;
    v.tMin = gl_RayTminEXT;
    const float t = rays[id].generate;
    const uint at = id * push.capacity + count;
    if (t > 0.0) {
        v.reported = 1u; // stays where the any-hit shader ends the ray, and this invocation with it
        ATTRIBUTE_U = float(v.primitive) + 0.25;
        ATTRIBUTE_V = float(v.geometry) + 0.5;
        WRITE_WIDE
    }
    if (count < push.capacity)
        visits[at] = v;
    if (t > 0.0 && reportIntersectionEXT(t, hitKindOfBox(v)) && count < push.capacity)
        visits[at].reported = 3u;
}
#endif
