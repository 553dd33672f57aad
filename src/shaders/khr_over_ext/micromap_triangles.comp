#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the triangles of a micromap build to where a driver with VK_EXT_opacity_micromap takes them: packed, and with
// offsets from an address of the data that is a bit lower. One invocation a triangle.
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
