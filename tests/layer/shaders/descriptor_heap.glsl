// SPDX-License-Identifier: Apache-2.0
// Four rays at the triangles of StateScene, by addresses that were pushed, which every kind of pipeline can get. Each ray
// leaves a word: 1 for a triangle that was hit, and 2 for each that was a candidate. The word behind those of the rays is
// the last that was pushed.
#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_query : require
#extension GL_EXT_buffer_reference : require

layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer Seen { uint words[5]; };
layout(push_constant, std430) uniform Push
{
    uvec2 scene;
    Seen seen;
    uint unused[58];
    uint last;
} push;

#define SCENE accelerationStructureEXT(push.scene)

vec3 originOf(uint ray)
{
    return vec3(1.5 * float(ray) + 0.3, 0.3, 1.0);
}

#if defined(COMPUTE)
layout(local_size_x = 4) in;

void main()
{
    const uint ray = gl_LocalInvocationIndex;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, SCENE, gl_RayFlagsNoneEXT, 0xffu, originOf(ray), 0.0, vec3(0, 0, -1), 10.0);
    uint word = 0u;
    while (rayQueryProceedEXT(query))
        word += 2u;
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT)
        word += 1u;
    push.seen.words[ray] = word;
    if (ray == 0u)
        push.seen.words[4] = push.last;
}
#elif defined(RAYGEN)
layout(location = 0) rayPayloadEXT uint word;

void main()
{
    const uint ray = gl_LaunchIDEXT.x;
    word = 0u;
    traceRayEXT(SCENE, gl_RayFlagsNoneEXT, 0xffu, 0u, 0u, 0u, originOf(ray), 0.0, vec3(0, 0, -1), 10.0, 0);
    push.seen.words[ray] = word;
    if (ray == 0u)
        push.seen.words[4] = push.last;
}
#elif defined(MISS)
layout(location = 0) rayPayloadInEXT uint word;

void main() {}
#elif defined(CLOSEST_HIT)
layout(location = 0) rayPayloadInEXT uint word;

void main()
{
    word += 1u;
}
#else
layout(location = 0) rayPayloadInEXT uint word;

void main()
{
    word += 2u;
    ignoreIntersectionEXT;
}
#endif
