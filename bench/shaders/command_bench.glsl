// SPDX-License-Identifier: Apache-2.0
// The smallest shaders of each kind, for vellum-command-bench. What they compute is of no interest.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_ray_tracing : enable

layout(push_constant) uniform Push
{
    uvec4 values;
} push;

#if defined(COMPUTE) || defined(QUERIES)
layout(local_size_x = 32) in;
layout(set = 0, binding = 0) buffer Result
{
    uint result[];
};
#endif
#if defined(QUERIES) || defined(RAYGEN)
layout(set = 0, binding = 1) uniform accelerationStructureEXT scene;
#endif

#if defined(COMPUTE)
void main() { result[gl_GlobalInvocationID.x] = push.values.x; }
#elif defined(QUERIES)
void main()
{
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, push.values.x, 0xff, vec3(0), 0, vec3(0, 0, 1), 100);
    uint seen = 0;
    while (rayQueryProceedEXT(query)) {
        seen += rayQueryGetIntersectionInstanceCustomIndexEXT(query, false);
        if (rayQueryGetIntersectionBarycentricsEXT(query, false).x > 0.5)
            rayQueryConfirmIntersectionEXT(query);
    }
    result[gl_GlobalInvocationID.x] = seen;
}
#elif defined(RAYGEN)
layout(location = 0) rayPayloadEXT uint payload;
void main() { traceRayEXT(scene, push.values.x, 0xff, 0, 0, 0, vec3(0), 0, vec3(0, 0, 1), 100, 0); }
#elif defined(MISS)
layout(location = 0) rayPayloadInEXT uint payload;
void main() { payload = 0; }
#elif defined(CLOSEST_HIT)
layout(location = 0) rayPayloadInEXT uint payload;
hitAttributeEXT vec2 barycentrics;
void main() { payload = gl_InstanceCustomIndexEXT; }
#elif defined(ANY_HIT)
layout(location = 0) rayPayloadInEXT uint payload;
hitAttributeEXT vec2 barycentrics;
void main()
{
    if (barycentrics.x < 0.5)
        ignoreIntersectionEXT;
}
#elif defined(VERTEX)
void main() { gl_Position = vec4(gl_VertexIndex & 1, gl_VertexIndex >> 1, 0, 1); }
#elif defined(FRAGMENT)
layout(location = 0) out vec4 color;
void main() { color = vec4(push.values); }
#endif
