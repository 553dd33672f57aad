#version 460
#extension GL_GOOGLE_include_directive : require
// Writes the results of queries in the format that vkCmdCopyQueryPoolResults asks for, one behind the other.
#include "shared.h"
#include "records.h"
#include "ground/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    uvec2 values;       // 64 bits each
    uvec2 availability; // 32 bits each
    uvec2 target;
    uint count;
    uint flags; // kQueryCopy*
} push;

void main()
{
    const uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (i >= push.count)
        return;
    uvec2 value = uvec2(Words(push.values).w[2u * i], Words(push.values).w[2u * i + 1u]);
    const bool available = Words(push.availability).w[i] != 0u;
    // With PARTIAL, a result between zero and the final one; without it, it is undefined.
    if (!available)
        value = uvec2(0u);
    const uint words = (push.flags & kQueryCopy64) != 0u ? 2u : 1u;
    const bool both = (push.flags & kQueryCopyAvailability) != 0u;
    const uint at = i * (both ? 2u * words : words);
    Words target = Words(push.target);
    target.w[at] = value.x;
    if (words == 2u)
        target.w[at + 1u] = value.y;
    if (both) {
        target.w[at + words] = available ? 1u : 0u;
        if (words == 2u)
            target.w[at + 3u] = 0u;
    }
}
