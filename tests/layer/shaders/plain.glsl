// SPDX-License-Identifier: Apache-2.0
#version 460
// The other half of a graphics pipeline.
#ifdef VERTEX
void main()
{
    // One triangle over everything.
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
