// SPDX-License-Identifier: Apache-2.0
#version 460
// Stores the push constants and buffers that it reads, so that a test can check that the application's state is
// preserved.
#ifdef VERTEX
#define FIRST 64u
#else
#define FIRST 0u
layout(local_size_x = 1) in;
#endif

layout(set = 0, binding = 0, std430) writeonly buffer Seen { uint seen[]; };
layout(set = 0, binding = 1, std430) readonly buffer First { uint first; };
layout(set = 1, binding = 0, std430) readonly buffer Second { uint second; };
layout(push_constant) uniform Push
{
#ifdef VERTEX
    layout(offset = 0) uvec4 words[4];
#else
    layout(offset = 64) uvec4 words[WORDS];
#endif
} push;

void main()
{
#ifdef VERTEX
    gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
    gl_PointSize = 1.0;
    if (gl_VertexIndex != 0)
        return;
#endif
    for (uint i = 0u; i < push.words.length() * 4u; ++i)
        seen[FIRST + i] = push.words[i / 4u][i % 4u];
    seen[FIRST + 62u] = first;
    seen[FIRST + 63u] = second;
}
