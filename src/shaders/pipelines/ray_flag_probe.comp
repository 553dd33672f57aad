#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_query : require
// Asks the driver whether unused ray flag bits come back from a ray query, and leave its hits as they are: one ray at one
// opaque triangle.
#include "push.h"
#include "ground/memory.glsl"

layout(local_size_x = 1) in;

layout(push_constant, std430) uniform Push
{
    RayFlagProbePush push;
};

void main()
{
    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(push.scene), push.rayFlags, 0xff, vec3(0.25, 0.25, 1.0), 0.0,
                          vec3(0.0, 0.0, -1.0), 2.0);
    rayQueryProceedEXT(query);
    Words result = Words(push.result);
    result.w[0] = rayQueryGetRayFlagsEXT(query);
    result.w[1] = rayQueryGetIntersectionTypeEXT(query, true);
}
