// SPDX-License-Identifier: Apache-2.0
#version 460
// Points that write numbers: what a draw did is seen from which pixels of a row have which number.
#ifdef MESH
#extension GL_EXT_mesh_shader : require
#endif
#ifdef COMPUTE
#extension GL_EXT_buffer_reference : require
layout(buffer_reference, std430) buffer Words { uint words[]; };
layout(push_constant) uniform Push { Words target; };
layout(local_size_x = 1) in;
#endif

#define WIDTH 64.0

vec4 pixel(uint x)
{
    return vec4((float(x) + 0.5) * 2.0 / WIDTH - 1.0, 0.0, 0.0, 1.0);
}

#ifdef VERTEX
layout(location = 0) in uint x;
layout(location = 1) in uint value;
layout(location = 0) flat out uint number;
#ifdef FEEDBACK
layout(location = 1, xfb_buffer = 0, xfb_offset = 0, xfb_stride = 8) out Captured { uint capturedX; uint capturedValue; };
#endif
void main()
{
    gl_Position = pixel(x + gl_InstanceIndex);
    gl_PointSize = 1.0;
    number = value * 100u + uint(gl_DrawID);
#ifdef FEEDBACK
    capturedX = x;
    capturedValue = value;
#endif
}
#endif

#ifdef MESH
// One point for each workgroup, at the position of the group in the grid.
layout(local_size_x = 1) in;
layout(points, max_vertices = 1, max_primitives = 1) out;
layout(location = 0) flat out uint number[];
void main()
{
    SetMeshOutputsEXT(1, 1);
    gl_MeshVerticesEXT[0].gl_Position = pixel(gl_WorkGroupID.x + 8u * uint(gl_DrawID));
    gl_MeshVerticesEXT[0].gl_PointSize = 1.0;
    gl_PrimitivePointIndicesEXT[0] = 0u;
    number[0] = gl_NumWorkGroups.x * 100u + uint(gl_DrawID);
}
#endif

#ifdef FRAGMENT
layout(location = 0) flat in uint number;
layout(location = 0) out uint color;
void main()
{
    color = number;
}
#endif

#ifdef COMPUTE
void main()
{
    atomicAdd(target.words[gl_WorkGroupID.x], 1u + gl_WorkGroupID.y);
}
#endif
