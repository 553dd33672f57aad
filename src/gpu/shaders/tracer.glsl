// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_ray_tracing : enable
#extension GL_GOOGLE_include_directive : require
// Traces a ray by a ray query in any stage and writes down everything a shader can see of it: one ray for each thread,
// vertex, pixel, workgroup or launch. The stage is defined: COMPUTE, VERTEX, ... Variants by definitions:
//   RAY_FLAGS=n   the ray flags are this constant instead of the ray's own
//   SPEC_FLAGS    they are a specialization constant
//   CULL_MASK=n   the cull mask is this constant instead of the ray's own
//   BY_ADDRESS    the acceleration structure comes as a device address
//   BUFFERS       the number of the vertex is the difference of two attributes
//   IN_ARRAY, IN_FUNCTIONS, AGAIN, SITES, GETTERS, IN_CONDITION, CARRIED, BESIDE   TracePlan::Query
#ifdef BY_ADDRESS
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#endif
#if defined(RAY_FLAGS) || defined(SPEC_FLAGS)
#extension GL_EXT_opacity_micromap : require
#endif
#if defined(TASK) || defined(MESH)
#extension GL_EXT_mesh_shader : require
#endif

#include "ray.glsl"

struct Candidate {
    uint customIndex;
    uint instance;
    uint geometry;
    uint primitive;
    // 1: AABB, 2: candidateAABBOpaque, 4: front face, 8: confirmed or generated, 16: not consistent; record offset << 8
    uint bits;
    float t;
    float u;
    float v;
};

layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1, std430) readonly buffer Rays { Ray rays[]; };
layout(binding = 2, std430) writeonly buffer Results { Result results[]; };
layout(binding = 3, std430) writeonly buffer Candidates { Candidate list[]; };
layout(push_constant) uniform Push
{
    uint rayCount;
    uint capacity; // candidates kept for each ray
    uvec2 sceneAddress;
} push;

#include "ray_flags.glsl"

#ifdef IN_ARRAY
#define QUERY queries[own]
#else
#define QUERY query
#endif

#ifdef BY_ADDRESS
#define SCENE accelerationStructureEXT(push.sceneAddress)
#else
#define SCENE scene
#endif
#ifndef CULL_MASK
#define CULL_MASK ray.cullMask
#endif
#define INITIALIZE(query, flags)                                                                                       \
    rayQueryInitializeEXT(query, SCENE, flags, CULL_MASK, vec3(ray.origin[0], ray.origin[1], ray.origin[2]),           \
                          ray.tMin, vec3(ray.direction[0], ray.direction[1], ray.direction[2]), ray.tMax)

// Returns whether the query's values for the ray and for a hit's instance are consistent: those that were traced, and one
// transform.
#ifndef GETTERS
#define CONSISTENT(query, committed) true
#else
#define CONSISTENT(query, committed)                                                                                   \
    (rayQueryGetWorldRayOriginEXT(query) == vec3(ray.origin[0], ray.origin[1], ray.origin[2]) &&                       \
     rayQueryGetWorldRayDirectionEXT(query) == vec3(ray.direction[0], ray.direction[1], ray.direction[2]) &&           \
     near(rayQueryGetIntersectionObjectToWorldEXT(query, committed) *                                                  \
              vec4(rayQueryGetIntersectionObjectRayOriginEXT(query, committed), 1.0),                                  \
          rayQueryGetWorldRayOriginEXT(query)) &&                                                                      \
     near(mat3(rayQueryGetIntersectionObjectToWorldEXT(query, committed)) *                                            \
              rayQueryGetIntersectionObjectRayDirectionEXT(query, committed),                                          \
          rayQueryGetWorldRayDirectionEXT(query)) &&                                                                   \
     near(rayQueryGetIntersectionWorldToObjectEXT(query, committed) *                                                  \
              vec4(rayQueryGetWorldRayOriginEXT(query), 1.0),                                                          \
          rayQueryGetIntersectionObjectRayOriginEXT(query, committed)))

bool near(vec3 a, vec3 b)
{
    return all(lessThan(abs(a - b), vec3(1e-3) * (1.0 + abs(a) + abs(b))));
}
#endif

// The work for one candidate. These are macros because a query may be an element of an array.
#define CANDIDATE(query)                                                                                               \
    Candidate c;                                                                                                       \
    c.customIndex = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false));                                 \
    c.instance = uint(rayQueryGetIntersectionInstanceIdEXT(query, false));                                             \
    c.geometry = uint(rayQueryGetIntersectionGeometryIndexEXT(query, false));                                          \
    c.primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false));                                        \
    c.t = 0.0;                                                                                                         \
    c.u = 0.0;                                                                                                         \
    c.v = 0.0;                                                                                                         \
    c.bits = rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, false) << 8u;                     \
    if (!CONSISTENT(query, false))                                                                                     \
        c.bits |= 16u;                                                                                                 \
    if (rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionAABBEXT) {                     \
        c.bits |= 1u | (rayQueryGetIntersectionCandidateAABBOpaqueEXT(query) ? 2u : 0u);                               \
        const float limit = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT     \
                                ? ray.tMax                                                                             \
                                : rayQueryGetIntersectionTEXT(query, true);                                            \
        if (ray.generate > 0.0 && ray.generate < limit) {                                                              \
            rayQueryGenerateIntersectionEXT(query, ray.generate);                                                      \
            c.bits |= 8u;                                                                                              \
        }                                                                                                              \
    } else {                                                                                                           \
        c.bits |= rayQueryGetIntersectionFrontFaceEXT(query, false) ? 4u : 0u;                                         \
        c.t = rayQueryGetIntersectionTEXT(query, false);                                                               \
        const vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, false);                                          \
        c.u = uv.x;                                                                                                    \
        c.v = uv.y;                                                                                                    \
        if (confirms(ray.rule, c.customIndex, c.instance, c.geometry, c.primitive)) {                                  \
            rayQueryConfirmIntersectionEXT(query);                                                                     \
            c.bits |= 8u;                                                                                              \
            if (ray.rule == kTerminate)                                                                                \
                rayQueryTerminateEXT(query);                                                                           \
        }                                                                                                              \
    }                                                                                                                  \
    if (count < push.capacity)                                                                                         \
        list[id * push.capacity + count] = c;                                                                          \
    ++count;

#define COMMITTED(query)                                                                                               \
    r.flags = rayQueryGetRayFlagsEXT(query);                                                                           \
    r.tMin = rayQueryGetRayTMinEXT(query);                                                                             \
    r.committed = rayQueryGetIntersectionTypeEXT(query, true);                                                         \
    if (r.committed != gl_RayQueryCommittedIntersectionNoneEXT) {                                                      \
        r.customIndex = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));                              \
        r.instance = uint(rayQueryGetIntersectionInstanceIdEXT(query, true));                                          \
        r.geometry = uint(rayQueryGetIntersectionGeometryIndexEXT(query, true));                                       \
        r.primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));                                     \
        r.t = rayQueryGetIntersectionTEXT(query, true);                                                                \
        r.frontFace = rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, true) << 8u;             \
        if (!CONSISTENT(query, true))                                                                                  \
            r.frontFace |= 16u;                                                                                        \
        if (r.committed == gl_RayQueryCommittedIntersectionTriangleEXT) {                                              \
            const vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, true);                                       \
            r.u = uv.x;                                                                                                \
            r.v = uv.y;                                                                                                \
            r.frontFace |= rayQueryGetIntersectionFrontFaceEXT(query, true) ? 1u : 0u;                                 \
        }                                                                                                              \
    }

#ifdef IN_FUNCTIONS
void begin(rayQueryEXT query, Ray ray, uint flags)
{
    INITIALIZE(query, flags);
}

uint proceed(rayQueryEXT query, Ray ray, uint id, uint count)
{
    while (rayQueryProceedEXT(query)) {
        CANDIDATE(query)
    }
    return count;
}

Result result(rayQueryEXT query, Ray ray)
{
    Result r = Result(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0.0, 0.0, 0.0, 0.0, 0u);
    COMMITTED(query)
    return r;
}
#endif

void traceRay(uint id)
{
    if (id >= push.rayCount)
        return;
    const Ray ray = rays[id];
    uint count = 0u;
    Result r = Result(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0.0, 0.0, 0.0, 0.0, 0u);
#ifdef IN_FUNCTIONS
    rayQueryEXT query;
    begin(query, ray, FLAGS(ray));
    count = proceed(query, ray, id, count);
    r = result(query, ray);
#else
#ifdef IN_ARRAY
    rayQueryEXT queries[2];
    const uint own = id & 1u;
    // The other one has flags of its own and meets nothing.
    rayQueryInitializeEXT(queries[1u - own], scene, gl_RayFlagsNoneEXT, 0u, vec3(0.0), 0.0, vec3(0.0, 0.0, 1.0), 1.0);
#else
    rayQueryEXT query;
#endif
#ifdef BESIDE
    // Another query, whose flags are constant: the same ray, of whose hits it confirms none.
    rayQueryEXT other;
    INITIALIZE(other, gl_RayFlagsNoOpaqueEXT);
    bool otherGoesOn = true;
#endif
#ifdef AGAIN
    // Before that, another ray, which is not traced to its end.
    INITIALIZE(query, FLAGS(ray) ^ gl_RayFlagsTerminateOnFirstHitEXT);
    for (uint i = 0u; i < (id & 3u) && rayQueryProceedEXT(query); ++i)
        if (rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionTriangleEXT)
            rayQueryConfirmIntersectionEXT(query);
#endif
#ifdef SITES
    if ((id & 1u) == 0u) {
        INITIALIZE(query, FLAGS(ray));
        while (rayQueryProceedEXT(query)) {
            CANDIDATE(query)
        }
    } else {
        INITIALIZE(query, FLAGS(ray) & ~0u);
        bool more = rayQueryProceedEXT(query);
        for (; more; more = rayQueryProceedEXT(query)) {
            CANDIDATE(query)
        }
    }
#elif defined(IN_CONDITION)
    INITIALIZE(query, FLAGS(ray));
    uint proceeded = 0u;
    while ((++proceeded, rayQueryProceedEXT(query))) {
        CANDIDATE(query)
    }
#elif defined(CARRIED)
    INITIALIZE(query, FLAGS(ray));
    uint even = 0u, odd = 1u, kept = 0u, rejected = 0u;
    for (; rayQueryProceedEXT(query); ++kept) {
        CANDIDATE(query)
        const uint swapped = even;
        even = odd;
        odd = swapped;
        if ((c.bits & 8u) != 0u)
            continue;
        ++rejected;
        --kept;
    }
#else
    INITIALIZE(QUERY, FLAGS(ray));
    while (rayQueryProceedEXT(QUERY)) {
        CANDIDATE(QUERY)
#ifdef BESIDE
        otherGoesOn = otherGoesOn && rayQueryProceedEXT(other);
#endif
    }
#endif
    COMMITTED(QUERY)
#ifdef BESIDE
    while (otherGoesOn)
        otherGoesOn = rayQueryProceedEXT(other);
    if (rayQueryGetIntersectionTypeEXT(other, true) != gl_RayQueryCommittedIntersectionNoneEXT ||
        rayQueryGetRayFlagsEXT(other) != gl_RayFlagsNoOpaqueEXT)
        r.frontFace |= 32u;
#endif
#ifdef IN_CONDITION
    if (proceeded != count + 1u)
        r.frontFace |= 32u;
#endif
#ifdef CARRIED
    if (even != (count & 1u) || odd != 1u - even || kept + rejected != count)
        r.frontFace |= 32u;
#endif
#ifdef IN_ARRAY
    if (rayQueryProceedEXT(queries[1u - own]) || rayQueryGetRayFlagsEXT(queries[1u - own]) != 0u)
        r.flags = ~0u;
#endif
#endif
    r.candidates = count;
    results[id] = r;
}

#if defined(COMPUTE)
layout(local_size_x = 64) in;
void main()
{
    traceRay(gl_GlobalInvocationID.x);
}
#elif defined(VERTEX)
#ifdef BUFFERS
layout(location = 0) in uint minuend;
layout(location = 1) in uint subtrahend;
#define NUMBER (minuend - subtrahend)
#else
#define NUMBER uint(gl_VertexIndex)
#endif
void main()
{
    traceRay(NUMBER);
    gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
    gl_PointSize = 1.0;
}
#elif defined(GEOMETRY)
layout(points) in;
layout(points, max_vertices = 1) out;
void main()
{
    traceRay(uint(gl_PrimitiveIDIn));
}
#elif defined(FRAGMENT)
layout(location = 0) out vec4 color;
void main()
{
    traceRay(uint(gl_FragCoord.x));
    color = vec4(1.0);
}
#elif defined(TASK)
layout(local_size_x = 1) in;
void main()
{
    traceRay(gl_WorkGroupID.x);
    EmitMeshTasksEXT(0u, 1u, 1u);
}
#elif defined(MESH)
layout(local_size_x = 1) in;
layout(points, max_vertices = 1, max_primitives = 1) out;
void main()
{
    traceRay(gl_WorkGroupID.x);
    SetMeshOutputsEXT(0u, 0u);
}
#else
// Stages of ray tracing pipelines, which launcher.rgen calls.
#if defined(CALLABLE)
layout(location = 0) callableDataInEXT uint unused;
#elif !defined(RAYGEN) && !defined(INTERSECTION)
layout(location = 0) rayPayloadInEXT uint unused;
#endif
void main()
{
    traceRay(gl_LaunchIDEXT.x);
#ifdef INTERSECTION
    reportIntersectionEXT(1.0, 0u);
#endif
}
#endif
