// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Finds the kinds of micromap indices of a geometry. One invocation per index.
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    IndexKindsPush push;
};

void main()
{
    const uint i =
        (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (i >= push.count)
        return;
    const uint index = loadBytes(elementAddress(push.source, i, push.stride), push.bytes);
    // Special indices are the unsigned cast of -1..-4 to the index type.
    const uint firstSpecial = (0xffffffffu >> (32u - push.bytes * 8u)) - 3u;
    atomicOr(Words(push.target).w[1], index >= firstSpecial ? kIndexKindSpecial : kIndexKindMicromap);
    memoryBarrierBuffer();
    atomicAdd(Words(push.target).w[0], 1u);
}
