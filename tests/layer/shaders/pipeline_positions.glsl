// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_spirv_intrinsics : require
// VK_KHR_ray_tracing_position_fetch in any-hit and closest-hit shaders: the positions of the triangle's vertices. One of
// RAYGEN, MISS, ANY_HIT, CLOSEST_HIT is defined. The built-in goes by its number, for compilers that do not know it.

struct Seen {
    float positions[9];
    uint invocations;
    uint customIndex;
    uint flags;
};

struct Payload {
    uint id;
};

layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1, std430) buffer SeenBuffer { Seen seen[]; }; // two for each ray: any-hit, closest-hit
layout(binding = 2, std430) readonly buffer Origins { vec4 origins[]; };
layout(push_constant) uniform Push
{
    uint flags;
} push;

#ifdef RAYGEN

layout(location = 0) rayPayloadEXT Payload payload;

void main()
{
    payload.id = gl_LaunchIDEXT.x;
    traceRayEXT(scene, push.flags, 0xff, 0, 0, 0, origins[payload.id].xyz, 0.0, vec3(0.0, 0.0, -1.0), 100.0, 0);
}

#elif defined(MISS)

void main()
{
}

#else

spirv_decorate(extensions = ["SPV_KHR_ray_tracing_position_fetch"], capabilities = [5336], 11, 5335)
in vec3 hitPositions[3];
layout(location = 0) rayPayloadInEXT Payload payload;

void main()
{
#ifdef ANY_HIT
    const uint at = payload.id * 2u;
#else
    const uint at = payload.id * 2u + 1u;
#endif
    for (int i = 0; i < 3; ++i) {
        const vec3 p = hitPositions[i];
        seen[at].positions[3 * i] = p.x;
        seen[at].positions[3 * i + 1] = p.y;
        seen[at].positions[3 * i + 2] = p.z;
    }
    seen[at].invocations += 1u;
    seen[at].customIndex = uint(gl_InstanceCustomIndexEXT);
    seen[at].flags = gl_IncomingRayFlagsEXT;
}
#endif
