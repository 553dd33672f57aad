// SPDX-License-Identifier: Apache-2.0
// Already uses physical addresses, and the types that the rewriter declares.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_buffer_reference : require
layout(local_size_x = 8) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) buffer Out { uint result[]; };

layout(buffer_reference, std430, buffer_reference_align = 16) buffer Table { uvec4 row[]; };
layout(push_constant) uniform More { Table table; };
void main()
{
    rayQueryEXT q;
    rayQueryInitializeEXT(q, scene, gl_RayFlagsNoneEXT, 0xff, vec3(gl_GlobalInvocationID), 0.0, vec3(0, 0, 1), 9.0);
    while (rayQueryProceedEXT(q))
        table.row[rayQueryGetIntersectionPrimitiveIndexEXT(q, false)].x = 1;
    result[0] = table.row[1].y;
}
