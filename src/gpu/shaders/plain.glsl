// SPDX-License-Identifier: Apache-2.0
#version 460
// Shaders that a pipeline needs besides those that are tested.
#ifdef MISS
#extension GL_EXT_ray_tracing : require
layout(location = 0) rayPayloadInEXT uint payload;
void main()
{
}
#elif defined(MESH)
#extension GL_EXT_mesh_shader : require
layout(local_size_x = 1) in;
layout(points, max_vertices = 1, max_primitives = 1) out;
void main()
{
    SetMeshOutputsEXT(0u, 0u);
}
#elif defined(COMPUTE)
void main()
{
}
#elif defined(VERTEX)
void main()
{
    // One triangle that covers everything.
    const vec2 corner = vec2(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
#else
layout(location = 0) out vec4 color;
void main()
{
    color = vec4(0.0, 1.0, 0.0, 1.0);
}
#endif
