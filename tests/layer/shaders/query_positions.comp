// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_spirv_intrinsics : require
// VK_KHR_ray_tracing_position_fetch in a ray query: the positions of the triangle's vertices, of a candidate and of the
// hit. The instruction goes by its number, for compilers that do not know it.

layout(local_size_x = 1) in;

struct Seen {
    float positions[9];
    uint invocations;
    uint customIndex;
    uint flags;
};

layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1, std430) buffer SeenBuffer { Seen seen[]; }; // two for each ray: candidate, hit
layout(binding = 2, std430) readonly buffer Origins { vec4 origins[]; };
layout(push_constant) uniform Push
{
    uint flags;
} push;

// OpRayQueryGetIntersectionTriangleVertexPositionsKHR
spirv_instruction(extensions = ["SPV_KHR_ray_tracing_position_fetch"], capabilities = [5391], id = 5340)
vec3[3] positionsOf(spirv_by_reference rayQueryEXT query, uint which);

void see(uint at, vec3 positions[3], uint customIndex, uint flags)
{
    for (int i = 0; i < 3; ++i) {
        seen[at].positions[3 * i] = positions[i].x;
        seen[at].positions[3 * i + 1] = positions[i].y;
        seen[at].positions[3 * i + 2] = positions[i].z;
    }
    seen[at].invocations += 1u;
    seen[at].customIndex = customIndex;
    seen[at].flags = flags;
}

void main()
{
    const uint id = gl_WorkGroupID.x;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, push.flags, 0xff, origins[id].xyz, 0.0, vec3(0.0, 0.0, -1.0), 100.0);
    while (rayQueryProceedEXT(query)) {
        see(2u * id, positionsOf(query, 0u), uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false)),
            rayQueryGetRayFlagsEXT(query));
        rayQueryConfirmIntersectionEXT(query);
    }
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT)
        see(2u * id + 1u, positionsOf(query, 1u), uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true)),
            rayQueryGetRayFlagsEXT(query));
}
