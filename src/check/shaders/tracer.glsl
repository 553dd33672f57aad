// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_ray_tracing : enable
#extension GL_GOOGLE_include_directive : require
// Traces a ray by a ray query in any stage and writes down everything a shader can see of it: one ray for each thread,
// vertex, pixel, workgroup or launch. The stage is defined: COMPUTE, VERTEX, ... Variants by definitions:
//   RAY_FLAGS=n   the ray flags are this constant instead of the ray's own
//   SPEC_FLAGS    they are a specialization constant
//   BY_ADDRESS    the acceleration structure comes as a device address
//   IN_ARRAY     the ray query is one of two in an array, both of which trace
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
    uint bits; // 1: AABB, 2: candidateAABBOpaque, 4: front face, 8: confirmed or generated
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

const uint kNever = 0u;
const uint kAlways = 1u;
const uint kHash = 2u;

bool confirms(uint rule, uint customIndex, uint instance, uint geometry, uint primitive)
{
    const uint h = (customIndex * 0x9e3779b1u) ^ (instance * 0x85ebca6bu) ^ (geometry * 0xc2b2ae35u) ^
                   (primitive * 0x27d4eb2fu);
    return rule == kAlways || (rule == kHash && ((h ^ (h >> 15u)) & 0x40u) != 0u);
}

#ifdef IN_ARRAY
#define QUERY queries[own]
#else
#define QUERY query
#endif

void traceRay(uint id)
{
    if (id >= push.rayCount)
        return;
    const Ray ray = rays[id];
#ifdef IN_ARRAY
    rayQueryEXT queries[2];
    const uint own = id & 1u;
    // The other one has flags of its own and meets nothing.
    rayQueryInitializeEXT(queries[1u - own], scene, gl_RayFlagsNoneEXT, 0u, vec3(0.0), 0.0, vec3(0.0, 0.0, 1.0), 1.0);
#else
    rayQueryEXT query;
#endif
#ifdef BY_ADDRESS
    rayQueryInitializeEXT(QUERY, accelerationStructureEXT(push.sceneAddress), FLAGS(ray), ray.cullMask,
#else
    rayQueryInitializeEXT(QUERY, scene, FLAGS(ray), ray.cullMask,
#endif
                          vec3(ray.origin[0], ray.origin[1], ray.origin[2]), ray.tMin,
                          vec3(ray.direction[0], ray.direction[1], ray.direction[2]), ray.tMax);
    uint count = 0u;
    while (rayQueryProceedEXT(QUERY)) {
        Candidate c;
        c.customIndex = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(QUERY, false));
        c.instance = uint(rayQueryGetIntersectionInstanceIdEXT(QUERY, false));
        c.geometry = uint(rayQueryGetIntersectionGeometryIndexEXT(QUERY, false));
        c.primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(QUERY, false));
        c.t = 0.0;
        c.u = 0.0;
        c.v = 0.0;
        if (rayQueryGetIntersectionTypeEXT(QUERY, false) == gl_RayQueryCandidateIntersectionAABBEXT) {
            c.bits = 1u | (rayQueryGetIntersectionCandidateAABBOpaqueEXT(QUERY) ? 2u : 0u);
            const float limit =
                rayQueryGetIntersectionTypeEXT(QUERY, true) == gl_RayQueryCommittedIntersectionNoneEXT
                    ? ray.tMax
                    : rayQueryGetIntersectionTEXT(QUERY, true);
            if (ray.generate > 0.0 && ray.generate < limit) {
                rayQueryGenerateIntersectionEXT(QUERY, ray.generate);
                c.bits |= 8u;
            }
        } else {
            c.bits = rayQueryGetIntersectionFrontFaceEXT(QUERY, false) ? 4u : 0u;
            c.t = rayQueryGetIntersectionTEXT(QUERY, false);
            const vec2 uv = rayQueryGetIntersectionBarycentricsEXT(QUERY, false);
            c.u = uv.x;
            c.v = uv.y;
            if (confirms(ray.rule, c.customIndex, c.instance, c.geometry, c.primitive)) {
                rayQueryConfirmIntersectionEXT(QUERY);
                c.bits |= 8u;
            }
        }
        if (count < push.capacity)
            list[id * push.capacity + count] = c;
        ++count;
    }
    Result r;
    r.candidates = count;
    r.flags = rayQueryGetRayFlagsEXT(QUERY);
    r.tMin = rayQueryGetRayTMinEXT(QUERY);
    r.committed = rayQueryGetIntersectionTypeEXT(QUERY, true);
    r.customIndex = 0u;
    r.instance = 0u;
    r.geometry = 0u;
    r.primitive = 0u;
    r.t = 0.0;
    r.u = 0.0;
    r.v = 0.0;
    r.frontFace = 0u;
    if (r.committed != gl_RayQueryCommittedIntersectionNoneEXT) {
        r.customIndex = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(QUERY, true));
        r.instance = uint(rayQueryGetIntersectionInstanceIdEXT(QUERY, true));
        r.geometry = uint(rayQueryGetIntersectionGeometryIndexEXT(QUERY, true));
        r.primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(QUERY, true));
        r.t = rayQueryGetIntersectionTEXT(QUERY, true);
        if (r.committed == gl_RayQueryCommittedIntersectionTriangleEXT) {
            const vec2 uv = rayQueryGetIntersectionBarycentricsEXT(QUERY, true);
            r.u = uv.x;
            r.v = uv.y;
            r.frontFace = rayQueryGetIntersectionFrontFaceEXT(QUERY, true) ? 1u : 0u;
        }
    }
#ifdef IN_ARRAY
    if (rayQueryProceedEXT(queries[1u - own]) || rayQueryGetRayFlagsEXT(queries[1u - own]) != 0u)
        r.flags = ~0u;
#endif
    results[id] = r;
}

#if defined(COMPUTE)
layout(local_size_x = 64) in;
void main()
{
    traceRay(gl_GlobalInvocationID.x);
}
#elif defined(VERTEX)
void main()
{
    traceRay(uint(gl_VertexIndex));
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
