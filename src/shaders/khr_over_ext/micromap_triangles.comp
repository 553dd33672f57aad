// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the triangles of a micromap build in the form that VK_EXT_opacity_micromap requires: packed, and with offsets from
// an aligned address of the data, which is `shift` bytes lower. One invocation per triangle.
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    MicromapTrianglesPush push;
};

void main()
{
    const uint triangle =
        (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (triangle >= push.count)
        return;
    uint offset = 0u;
    uint levelAndFormat = 1u << 16u; // level 0, 2 states
    if (triangle < push.readable) {
        const uvec2 address = elementAddress(push.source, triangle, push.stride);
        offset = loadBytes(address, 4u);
        levelAndFormat = loadBytes(addressPlus(address, 4u), 4u);
    }
    Words target = Words(elementAddress(push.target, triangle, 8u));
    target.w[0] = offset + push.shift;
    target.w[1] = levelAndFormat;
}
