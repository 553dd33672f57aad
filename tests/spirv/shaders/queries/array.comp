// SPDX-License-Identifier: Apache-2.0
// Queries in an array, with constant and dynamic indices.
#version 460
#extension GL_EXT_ray_query : require
layout(local_size_x = 8) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint result[]; };
layout(push_constant) uniform Push { uint flags; uint mode; };

void main()
{
    rayQueryEXT q[3];
    for (uint i = 0; i < 3; ++i)
        rayQueryInitializeEXT(q[i], scene, gl_RayFlagsNoneEXT, 0xff, vec3(i), 0.0, vec3(0, 0, 1), 9.0);
    while (rayQueryProceedEXT(q[1]))
        rayQueryConfirmIntersectionEXT(q[1]);
    while (rayQueryProceedEXT(q[mode]))
        rayQueryConfirmIntersectionEXT(q[mode]);
    rayQueryProceedEXT(q[2]);
    rayQueryProceedEXT(q[flags]);
    result[0] = rayQueryGetIntersectionInstanceCustomIndexEXT(q[mode], true);
}
