// SPDX-License-Identifier: Apache-2.0
// The custom index of candidates: of a query that is not passed on, of one that a function advances, and of a committed hit.
#version 460
#extension GL_EXT_ray_query : require
layout(local_size_x = 8) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint result[]; };
layout(push_constant) uniform Push { uint flags; uint mode; };

rayQueryEXT everywhere;

bool advance(rayQueryEXT q)
{
    return rayQueryProceedEXT(q);
}

void main()
{
    uint sum = 0;
    rayQueryEXT own, passed;
    rayQueryInitializeEXT(own, scene, flags, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    rayQueryInitializeEXT(everywhere, scene, flags, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    rayQueryInitializeEXT(passed, scene, flags, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    while (rayQueryProceedEXT(own))
        sum += uint(rayQueryGetIntersectionInstanceCustomIndexEXT(own, false));
    rayQueryProceedEXT(everywhere);
    sum += uint(rayQueryGetIntersectionInstanceCustomIndexEXT(everywhere, false));
    while (advance(passed))
        sum += uint(rayQueryGetIntersectionInstanceCustomIndexEXT(passed, false));
    result[0] = sum + uint(rayQueryGetIntersectionInstanceCustomIndexEXT(own, true));
}
