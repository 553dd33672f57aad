// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Widens 8-bit micromap indices, which VK_EXT_opacity_micromap does not have, to 32 bits. One invocation per index.
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    WideIndicesPush push;
};

void main()
{
    const uint i =
        (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (i >= push.count)
        return;
    uint index = 0xfffffffcu; // fully unknown opaque
    if (i < push.readable) {
        index = loadBytes(elementAddress(push.source, i, push.stride), 1u);
        // Special indices are the unsigned cast of -1..-4 to the index type.
        if (index >= 0xfcu)
            index |= 0xffffff00u;
    }
    Words(elementAddress(push.target, i, 4u)).w[0] = index;
}
