// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Checks the indices by which the triangles of a geometry name those of its micromap, and counts the triangles; then
// compares their number with the usage counts.
#include "shared.h"
#include "findings.h"
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    IndexCheckPush push;
};

#include "validation/log.glsl"

const uint kFirstSpecial = 0xfffffffcu;

uint fetchIndex(uint triangle)
{
    const uint value = loadBytes(elementAddress(push.indices, triangle, push.indexStride), push.indexBytes);
    // Special indices are the unsigned cast of -1..-4 to the index type.
    const uint above = push.indexBytes == 4u ? 0u : ~0u << (push.indexBytes * 8u);
    return value >= (~above & ~3u) ? value | above : value;
}

bool isCounting()
{
    return any(notEqual(push.counts, uvec2(0)));
}

void compareCounts()
{
    Words counts = Words(push.counts);
    if (counts.w[kAttachedWrong] == 0u && counts.w[kAttachedFound] != push.declared)
        reportFinding(kFindingAttachedCounts, 0u, push.declared, counts.w[kAttachedFound]);
}

void reportIndex(uint what, uint triangle, uint value0, uint value1)
{
    reportFinding(what, triangle, value0, value1);
    if (isCounting())
        Words(push.counts).w[kAttachedWrong] = 1u;
}

void main()
{
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint triangle = group * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (push.comparing != 0u) {
        if (triangle == 0u)
            compareCounts();
        return;
    }
    uint triangles = push.triangleCount;
    if (any(notEqual(push.range, uvec2(0))))
        triangles = min(triangles, Words(readable(push.range, push.record)).w[0]);
    if (triangle >= triangles)
        return;
    const bool indexed = push.indexBytes != 0u;
    uint index = triangle;
    if (indexed) {
        if (triangle == push.readable)
            reportIndex(kFindingIndexBuffer, triangle, triangles, 0u);
        if (triangle >= push.readable)
            return;
        index = fetchIndex(triangle);
        if (index >= kFirstSpecial)
            return;
    }
    if (push.attached == 0u) {
        reportFinding(kFindingNotSpecial, triangle, index, 0u);
        return;
    }
    if (isCounting())
        atomicAdd(Words(push.counts).w[kAttachedFound], 1u);
    Words record = Words(push.record);
    const uint target = index + push.baseTriangle;
    if (record.w[0] == kRecordMicromap && (target < index || target >= record.w[2]))
        reportIndex(indexed ? kFindingIndex : kFindingNumber, triangle, index, record.w[2]);
}
