// SPDX-License-Identifier: Apache-2.0
// Flags known at run time only, of queries in arrays, at module scope and in functions that get them as parameters.
#version 460
#extension GL_EXT_ray_query : require
layout(local_size_x = 8) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint result[]; };
layout(push_constant) uniform Push { int flags; uint mode; };
rayQueryEXT global;
rayQueryEXT globals[2];

void begin(rayQueryEXT q, uint with)
{
    rayQueryInitializeEXT(q, scene, with, 0xff, vec3(gl_GlobalInvocationID), 0.0, vec3(0, 0, 1), 9.0);
}
uint trace(rayQueryEXT q, uint first)
{
    uint n = first;
    while (rayQueryProceedEXT(q)) {
        if (rayQueryGetIntersectionTypeEXT(q, false) == gl_RayQueryCandidateIntersectionAABBEXT &&
            rayQueryGetIntersectionCandidateAABBOpaqueEXT(q))
            rayQueryGenerateIntersectionEXT(q, 1.0);
        ++n;
    }
    return n;
}
void main()
{
    rayQueryEXT local;
    rayQueryEXT locals[2][3];
    begin(local, uint(flags));
    begin(global, uint(flags) * 2);
    for (uint i = 0; i < 3; ++i)
        rayQueryInitializeEXT(locals[i & 1][i], scene, flags << i, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    rayQueryInitializeEXT(globals[1], scene, mode, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    result[0] = trace(local, 1) + trace(global, 2);
    while (rayQueryProceedEXT(locals[mode][1]) && rayQueryProceedEXT(globals[1]))
        ;
    result[1] = rayQueryGetRayFlagsEXT(local) + rayQueryGetRayFlagsEXT(global);
    result[2] = rayQueryGetRayFlagsEXT(locals[mode][1]) + rayQueryGetRayFlagsEXT(globals[mode]);
}
