// SPDX-License-Identifier: Apache-2.0
#version 460
// Stores the push constants that it receives when ray tracing shaders have some as well.
layout(local_size_x = 48) in;
layout(binding = 0, std430) writeonly buffer Seen { uint seen[]; };
layout(push_constant) uniform Push
{
    layout(offset = 64) uint words[48];
} push;

void main()
{
    seen[gl_GlobalInvocationID.x] = push.words[gl_GlobalInvocationID.x];
}
