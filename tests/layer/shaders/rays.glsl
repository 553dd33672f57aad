// SPDX-License-Identifier: Apache-2.0
// The bindings of tracer.glsl, for shaders that only count candidates and report a hit.
#include "ray.glsl"

layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1, std430) readonly buffer Rays { Ray rays[]; };
layout(binding = 2, std430) writeonly buffer Results { Result results[]; };

#define ORIGIN(ray) vec3(ray.origin[0], ray.origin[1], ray.origin[2])
#define DIRECTION(ray) vec3(ray.direction[0], ray.direction[1], ray.direction[2])
#define START(query, ray)                                                                                              \
    rayQueryInitializeEXT(query, scene, ray.flags, ray.cullMask, ORIGIN(ray), ray.tMin, DIRECTION(ray), ray.tMax)
// The work for each candidate. The custom indices of candidates and of committed hits have different sources.
#define VISIT(query, ray, count)                                                                                       \
    ++count;                                                                                                           \
    if (ray.rule == 1u) {                                                                                              \
        rayQueryConfirmIntersectionEXT(query);                                                                         \
        if (rayQueryGetIntersectionInstanceCustomIndexEXT(query, false) !=                                             \
            rayQueryGetIntersectionInstanceCustomIndexEXT(query, true))                                                \
            count += 1000u;                                                                                            \
    }
#define REPORT(query, id, count)                                                                                       \
    {                                                                                                                  \
        Result r;                                                                                                      \
        r.candidates = count;                                                                                          \
        r.flags = rayQueryGetRayFlagsEXT(query);                                                                       \
        r.committed = rayQueryGetIntersectionTypeEXT(query, true);                                                     \
        r.customIndex = 0u;                                                                                            \
        r.instance = 0u;                                                                                               \
        r.geometry = 0u;                                                                                               \
        r.primitive = 0u;                                                                                              \
        r.t = 0.0;                                                                                                     \
        r.u = 0.0;                                                                                                     \
        r.v = 0.0;                                                                                                     \
        r.tMin = rayQueryGetRayTMinEXT(query);                                                                         \
        r.frontFace = 0u;                                                                                              \
        if (r.committed != gl_RayQueryCommittedIntersectionNoneEXT) {                                                  \
            r.customIndex = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));                          \
            r.instance = uint(rayQueryGetIntersectionInstanceIdEXT(query, true));                                      \
            r.geometry = uint(rayQueryGetIntersectionGeometryIndexEXT(query, true));                                   \
            r.primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));                                 \
            r.t = rayQueryGetIntersectionTEXT(query, true);                                                            \
        }                                                                                                              \
        results[id] = r;                                                                                               \
    }
