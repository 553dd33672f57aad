// SPDX-License-Identifier: Apache-2.0
// Flags known at run time only, and everything that reads what the layer changed.
#version 460
#extension GL_EXT_ray_query : require
layout(local_size_x = 8) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint result[]; };
layout(push_constant) uniform Push { uint flags; uint mode; };

void main()
{
    rayQueryEXT q;
    rayQueryInitializeEXT(q, scene, flags, 0xff, vec3(0), 0.0, vec3(0, 0, 1), 9.0);
    while (rayQueryProceedEXT(q)) {
        if (rayQueryGetIntersectionTypeEXT(q, false) == gl_RayQueryCandidateIntersectionAABBEXT) {
            if (rayQueryGetIntersectionCandidateAABBOpaqueEXT(q))
                rayQueryGenerateIntersectionEXT(q, 1.0);
        } else if (rayQueryGetIntersectionInstanceCustomIndexEXT(q, false) == 3)
            rayQueryConfirmIntersectionEXT(q);
    }
    result[0] = rayQueryGetRayFlagsEXT(q);
    result[1] = rayQueryGetIntersectionInstanceCustomIndexEXT(q, true);
}
