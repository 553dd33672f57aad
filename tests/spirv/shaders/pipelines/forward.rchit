// SPDX-License-Identifier: Apache-2.0
// Hands its own payload on to the next ray, reads the flags of its ray before and after, and uses payloads in every way:
// whole, in parts, by an index known at run time, of several types.
#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint flags[2]; uint depth; };

struct Inner {
    uint64_t wide;
    float list[5];
};
struct Payload {
    Inner inner[2];
    mat3 matrix;
    uint depth;
};
layout(location = 0) rayPayloadInEXT Payload payload;
layout(location = 1) rayPayloadEXT Payload other;
layout(location = 2) rayPayloadEXT float16_t small;
layout(location = 3) callableDataEXT uint called;

void main()
{
    flags[0] = gl_IncomingRayFlagsEXT;
    other = payload;
    other.inner[payload.depth & 1].list[depth] = payload.inner[1].list[payload.depth] * 2;
    payload.inner[0].wide += 3;
    payload.matrix[1].yz = other.matrix[depth].xy;
    small = float16_t(payload.matrix[2][depth]);
    executeCallableEXT(0, 3);
    traceRayEXT(scene, depth, 255, 0, 0, 0, vec3(0), 0, vec3(1), 9, 0);
    traceRayEXT(scene, gl_RayFlagsOpaqueEXT, 255, 0, 0, 0, vec3(0), 0, vec3(1), 9, 1);
    traceRayEXT(scene, int(payload.depth), 255, 0, 0, 0, vec3(0), 0, vec3(1), 9, 2);
    payload.inner[1] = other.inner[0];
    payload.depth += uint(small) + called;
    flags[1] = gl_IncomingRayFlagsEXT;
}
