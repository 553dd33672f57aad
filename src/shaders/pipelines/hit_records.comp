// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the hit records of a shader binding table, unless the driver has done that. Writes the record of the layer's group
// in place of null handles, and after the table's end as far as instances may reach: a hit without shaders still has to look
// up micromaps. The table is named by the push constants, or by a VkTraceRaysIndirectCommand2KHR in memory; the copy of that
// names the copied table.
#include "shared.h"
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

const uint kHandleBytes = 32u;
const uint kHandleWords = kHandleBytes / 4u;
const uint kUnitBytes = 16u;
const uint kHandleUnits = kHandleBytes / kUnitBytes;
const uint kCommandWords = 26u;
const uint kHitWord = 10u; // of the command: hit records' address, size and stride, 64 bits each
const uint kHitWords = 6u;

layout(push_constant, std430) uniform Push
{
    HitRecordsPush push;
};

layout(buffer_reference, std430, buffer_reference_align = 16) buffer Units { uvec4 at[]; };

// Copies a table whose address and stride are multiples of 16 bytes, as on all known drivers, and writes the records up to
// `recordsWritten`. A workgroup copies a contiguous piece.
void copyUnits(uvec2 source, uint size, uint stride, uint records, uint recordsWritten)
{
    const uint groups = gl_NumWorkGroups.x * gl_NumWorkGroups.y;
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint bytes = min(size, records * stride); // without a part of a record behind the last one
    const uint whole = bytes / kUnitBytes;
    const uint unitsOfRecord = stride / kUnitBytes;
    const uint step = gl_WorkGroupSize.x % unitsOfRecord;
    const uint padding = records * unitsOfRecord; // where it begins
    const uint end = recordsWritten > records ? (recordsWritten - 1u) * unitsOfRecord + kHandleUnits : whole;
    const uint unitsOfGroup = gl_WorkGroupSize.x * kHitUnitsOfThread;
    Units from = Units(source);
    Units to = Units(push.target);
    for (uint begin = group * unitsOfGroup; begin < end; begin += groups * unitsOfGroup) {
        uint unit = begin + gl_LocalInvocationIndex;
        uint inRecord = unit % unitsOfRecord;
        for (uint i = 0u; i < kHitUnitsOfThread; ++i) {
            const bool inHandle = inRecord < kHandleUnits;
            if (unit < whole) {
                uvec4 value = from.at[unit];
                if (inHandle && unit - inRecord + kHandleUnits <= whole) {
                    const uvec4 other = from.at[unit + 1u - 2u * inRecord];
                    if (all(equal(value | other, uvec4(0u))))
                        value = Units(push.standIn).at[inRecord];
                }
                to.at[unit] = value;
            } else if (inHandle && unit >= padding && unit < end) {
                to.at[unit] = Units(push.standIn).at[inRecord];
            }
            unit += gl_WorkGroupSize.x;
            inRecord += step;
            inRecord -= inRecord >= unitsOfRecord ? unitsOfRecord : 0u;
        }
    }
    if (group == 0u && gl_LocalInvocationIndex == 0u)
        for (uint w = whole * (kUnitBytes / 4u); w < bytes / 4u; ++w)
            Words(push.target).w[w] = Words(source).w[w];
}

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

// Replaces null handles in the copy. Few handles begin with 0, so that invocations load some words before they branch.
void patchRecords(uint records, uint stride)
{
    const uint groups = gl_NumWorkGroups.x * gl_NumWorkGroups.y;
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint recordsOfGroup = gl_WorkGroupSize.x * kHitRecordsOfThread;
    for (uint begin = push.first + group * recordsOfGroup; begin < records; begin += groups * recordsOfGroup) {
        const uint first = begin + gl_LocalInvocationIndex;
        uint least = 1u;
        for (uint i = 0u; i < kHitRecordsOfThread; ++i) {
            const uint record = min(first + i * gl_WorkGroupSize.x, records - 1u);
            least = min(least, Words(elementAddress(push.target, record, stride)).w[0]);
        }
        if (least != 0u)
            continue;
        for (uint record = first; record < min(begin + recordsOfGroup, records); record += gl_WorkGroupSize.x) {
            const uvec2 at = elementAddress(push.target, record, stride);
            uint bits = 0u;
            for (uint w = 0u; w < kHandleWords; ++w)
                bits |= Words(at).w[w];
            if (bits == 0u)
                writeStandIn(at);
        }
    }
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
    if (push.copied == 0u && ((source.x | stride) & (kUnitBytes - 1u)) == 0u) {
        copyUnits(source, size, stride, records, all);
        return;
    }
    if (push.copied != 0u)
        patchRecords(records, stride);
    for (uint record = thread + (push.copied != 0u ? records : 0u); record < all; record += threads) {
        const uvec2 target = elementAddress(push.target, record, stride);
        if (record < records)
            copyRecord(elementAddress(source, record, stride), target, min(stride, size - record * stride) / 4u);
        else
            writeStandIn(target);
    }
}
