// SPDX-License-Identifier: Apache-2.0
// The query proceeds without a loop.
#version 460
#extension GL_EXT_ray_query : require
layout(local_size_x = 8) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint result[]; };
layout(push_constant) uniform Push { uint flags; uint mode; };

void main()
{
    rayQueryEXT q;
    rayQueryInitializeEXT(q, scene, gl_RayFlagsOpaqueEXT, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    rayQueryProceedEXT(q);
    result[0] = rayQueryGetIntersectionInstanceCustomIndexEXT(q, true) + rayQueryGetRayFlagsEXT(q);
}
