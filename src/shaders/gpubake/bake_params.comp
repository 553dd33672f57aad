// SPDX-License-Identifier: Apache-2.0
// Writes words from its push constants: vkCmdUpdateBuffer for an address.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "base/memory.glsl"
#include "gpu_bake.h"

layout(local_size_x = 32) in;

layout(push_constant) uniform Push
{
    uvec2 scratch;
    uint first;
    uint count;
    uint words[kBakePushedWords];
} push;

void main()
{
    const uint i = gl_LocalInvocationID.x;
    if (i < push.count)
        Words(push.scratch).w[push.first + i] = push.words[i];
}
