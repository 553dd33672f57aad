// SPDX-License-Identifier: Apache-2.0
#version 460
// Runs before a fragment shader.
void main()
{
    gl_Position = vec4(float(gl_VertexIndex & 1), float(gl_VertexIndex >> 1), 0.0, 1.0);
}
