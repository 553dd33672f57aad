// SPDX-License-Identifier: Apache-2.0
// All queries have the same mode: CullNoOpaque | ForceOpacityMicromap2State, and two flags that the driver supports.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_opacity_micromap : require
layout(local_size_x = 8) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint result[]; };
layout(push_constant) uniform Push { uint flags; uint mode; };

// Uses the name of the flag, for which newer compilers declare the capability. Newer validators require it where the
// flag is a constant.
const uint kMode = gl_RayFlagsCullNoOpaqueEXT | gl_RayFlagsForceOpacityMicromap2StateEXT;

void main()
{
    rayQueryEXT q;
    rayQueryInitializeEXT(q, scene, kMode | 0x4, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    while (rayQueryProceedEXT(q)) {
        if (rayQueryGetIntersectionCandidateAABBOpaqueEXT(q))
            rayQueryGenerateIntersectionEXT(q, 1.0);
    }
    rayQueryInitializeEXT(q, scene, kMode | 0x10, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    rayQueryProceedEXT(q);
    result[0] = rayQueryGetRayFlagsEXT(q);
}
