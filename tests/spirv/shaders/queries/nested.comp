// SPDX-License-Identifier: Apache-2.0
// A second query's loop in the body of the first, with values carried through both, break and continue.
#version 460
#extension GL_EXT_ray_query : require
layout(local_size_x = 8) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint result[]; };
layout(push_constant) uniform Push { uint flags; uint mode; };

void main()
{
    rayQueryEXT q, shadow;
    uint seen = 0, blocked = 0, last = 7;
    rayQueryInitializeEXT(q, scene, gl_RayFlagsNoneEXT, 0xff, vec3(gl_GlobalInvocationID), 0.0, vec3(0, 0, 1), 9.0);
    while (rayQueryProceedEXT(q)) {
        ++seen;
        last = rayQueryGetIntersectionInstanceCustomIndexEXT(q, false);
        if (last == mode)
            continue;
        rayQueryInitializeEXT(shadow, scene, gl_RayFlagsTerminateOnFirstHitEXT, 0xff,
                              rayQueryGetWorldRayOriginEXT(q), 0.0, vec3(1, 0, 0), 9.0);
        while (rayQueryProceedEXT(shadow)) {
            ++blocked;
            if (rayQueryGetIntersectionBarycentricsEXT(shadow, false).y < 0.25)
                break;
            rayQueryConfirmIntersectionEXT(shadow);
        }
        if (blocked > 100)
            break;
        rayQueryConfirmIntersectionEXT(q);
        blocked += seen;
    }
    result[gl_GlobalInvocationID.x] = seen + blocked * 3 + last;
}
