// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Writes the references of the instances (VkAccelerationStructureInstanceKHR) of a build, 0 for those that no ray can
// meet, and their masks.
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    InstancesContentsPush push;
};

void main()
{
    const uint i =
        (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (i >= push.count)
        return;
    uvec2 source = elementAddress(push.source, i, push.pointers != 0u ? 8u : 64u);
    if (push.pointers != 0u)
        source = uvec2(Words(source).w[0], Words(source).w[1]);
    Words instance = Words(source);
    const uint mask = instance.w[12] >> 24;
    const bool visible = mask != 0u;
    CoherentWords(elementAddress(push.target, 2u + 2u * push.count + i, 4u)).w[0] = mask;
    CoherentWords target = CoherentWords(elementAddress(push.target, i + 1u, 8u));
    target.w[0] = visible ? instance.w[14] : 0u;
    target.w[1] = visible ? instance.w[15] : 0u;
    memoryBarrierBuffer();
    atomicAdd(Words(push.target).w[0], 1u);
}
