#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the hit records of a shader binding table, with a handle of ours in the place of null handles: a hit group
// without shaders still has to look up micromaps. The region is given, or that of a VkTraceRaysIndirectCommand2KHR in
// memory, which is copied too and then names the copied records.
#include "shared.h"
#include "ground/memory.glsl"

layout(local_size_x = 64) in;

const uint kHandleWords = 8u;
const uint kCommandWords = 26u;
const uint kHitWord = 10u; // of the command: hit records' address, size and stride, 64 bits each

layout(push_constant, std430) uniform Push
{
    uvec2 source; // hit records; with a command taken from it
    uvec2 target;
    uvec2 command; // 0: none
    uvec2 commandCopy;
    uint size; // bytes; with a command: those at `target`
    uint stride;
    uint handle[kHandleWords];
} push;

void copyRecord(uvec2 from, uvec2 to, uint words)
{
    Words source = Words(from);
    Words target = Words(to);
    uint bits = words >= kHandleWords ? 0u : 1u;
    for (uint w = 0u; w < min(words, kHandleWords); ++w)
        bits |= source.w[w];
    for (uint w = 0u; w < words; ++w)
        target.w[w] = bits == 0u && w < kHandleWords ? push.handle[w] : source.w[w];
}

void main()
{
    const uint threads = gl_NumWorkGroups.x * gl_NumWorkGroups.y * gl_WorkGroupSize.x;
    const uint thread =
        (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    uvec2 source = push.source;
    uint size = push.size;
    uint stride = push.stride;
    if (any(notEqual(push.command, uvec2(0)))) {
        Words command = Words(readable(push.command, push.target));
        source = uvec2(command.w[kHitWord], command.w[kHitWord + 1u]);
        size = command.w[kHitWord + 2u];
        stride = command.w[kHitWord + 4u];
        // Too many for the room there is: they stay where they are.
        const bool fits = command.w[kHitWord + 3u] == 0u && command.w[kHitWord + 5u] == 0u && size <= push.size;
        if (thread == 0u) {
            Words copy = Words(push.commandCopy);
            for (uint w = 0u; w < kCommandWords; ++w)
                copy.w[w] = command.w[w];
            if (fits && size > 0u) {
                copy.w[kHitWord] = push.target.x;
                copy.w[kHitWord + 1u] = push.target.y;
            }
        }
        if (!fits)
            return;
    }
    // Without a stride there is one record, which every hit uses.
    if (stride == 0u)
        stride = max(size, 1u);
    for (uint record = thread; record < (size + stride - 1u) / stride; record += threads) {
        const uint bytes = min(stride, size - record * stride);
        copyRecord(elementAddress(source, record, stride), elementAddress(push.target, record, stride), bytes / 4u);
    }
}
