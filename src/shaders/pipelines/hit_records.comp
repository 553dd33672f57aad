// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the hit records of a shader binding table, with the record of the layer's group in place of null handles, and
// after the table's end as far as instances may reach: a hit without shaders still has to look up micromaps. The table is
// named by the push constants, or by a VkTraceRaysIndirectCommand2KHR in memory; the copy of that names the copied table.
#include "shared.h"
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

const uint kHandleBytes = 32u;
const uint kHandleWords = kHandleBytes / 4u;
const uint kCommandWords = 26u;
const uint kHitWord = 10u; // of the command: hit records' address, size and stride, 64 bits each
const uint kHitWords = 6u;

layout(push_constant, std430) uniform Push
{
    HitRecordsPush push;
};

void copyRecord(uvec2 from, uvec2 to, uint words)
{
    Words source = Words(from);
    Words target = Words(to);
    uint bits = words >= kHandleWords ? 0u : 1u;
    for (uint w = 0u; w < min(words, kHandleWords); ++w)
        bits |= source.w[w];
    for (uint w = 0u; w < words; ++w)
        target.w[w] = bits == 0u && w < kHandleWords ? Words(push.standIn).w[w] : source.w[w];
}

void writeStandIn(uvec2 to)
{
    for (uint w = 0u; w < kHandleWords; ++w)
        Words(to).w[w] = Words(push.standIn).w[w];
}

// Number of records that hold a whole handle.
uint recordsOf(uint size, uint stride)
{
    if (size < kHandleBytes)
        return 0u;
    return stride == 0u ? 1u : 1u + (size - kHandleBytes) / stride;
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
        const bool large = (command.w[kHitWord + 3u] | command.w[kHitWord + 5u]) != 0u;
        const bool none = all(equal(source, uvec2(0))) || (!large && size < kHandleBytes);
        if (!large && push.oneForAll != 0u && recordsOf(size, stride) == 1u)
            stride = 0u;
        // Tables that exceed the capacity, and records that overlap, are not copied.
        const bool copied = !none && !large && size <= push.capacity && (stride == 0u || stride >= kHandleBytes);
        if (thread == 0u) {
            Words copy = Words(push.commandCopy);
            const bool changed = none || copied;
            // Each word once: another execution of the command buffer may read it.
            for (uint w = 0u; w < kCommandWords; ++w) {
                if (!changed || w < kHitWord || w >= kHitWord + kHitWords)
                    copy.w[w] = command.w[w];
            }
            if (changed) {
                const uvec2 table = none ? push.standIn : push.target;
                copy.w[kHitWord] = table.x;
                copy.w[kHitWord + 1u] = table.y;
                copy.w[kHitWord + 2u] = none ? kHandleBytes : stride == 0u ? size : push.capacity;
                copy.w[kHitWord + 3u] = 0u;
                copy.w[kHitWord + 4u] = none ? 0u : stride;
                copy.w[kHitWord + 5u] = 0u;
            }
        }
        if (!copied)
            return;
    }
    const uint records = recordsOf(size, stride);
    uint all = records;
    if (stride == 0u)
        stride = size;
    else
        all = max(records, min(Words(push.recordOffset).w[0] + push.reach + 1u, recordsOf(push.capacity, stride)));
    for (uint record = thread; record < all; record += threads) {
        const uvec2 target = elementAddress(push.target, record, stride);
        if (record < records)
            copyRecord(elementAddress(source, record, stride), target, min(stride, size - record * stride) / 4u);
        else
            writeStandIn(target);
    }
}
