// SPDX-License-Identifier: Apache-2.0
// Flags that the pipeline may still specialize.
#version 460
#extension GL_EXT_ray_query : require
layout(local_size_x = 8) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint result[]; };
layout(push_constant) uniform Push { uint flags; uint mode; };

layout(constant_id = 0) const uint kFlags = 0;
void main()
{
    rayQueryEXT q;
    rayQueryInitializeEXT(q, scene, kFlags, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    while (rayQueryProceedEXT(q))
        rayQueryConfirmIntersectionEXT(q);
    result[0] = rayQueryGetRayFlagsEXT(q);
}
