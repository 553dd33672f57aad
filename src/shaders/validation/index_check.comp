// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Checks the indices by which the triangles of a geometry name those of its micromap.
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

void main()
{
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint triangle = group * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    uint triangles = push.triangleCount;
    if (any(notEqual(push.range, uvec2(0))))
        triangles = min(triangles, Words(readable(push.range, push.record)).w[0]);
    if (triangle >= triangles)
        return;
    const bool indexed = push.indexBytes != 0u;
    uint index = triangle;
    if (indexed) {
        if (triangle == push.readable)
            reportFinding(kFindingIndexBuffer, triangle, triangles, 0u);
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
    Words record = Words(push.record);
    const uint target = index + push.baseTriangle;
    if (record.w[0] == kRecordMicromap && (target < index || target >= record.w[2]))
        reportFinding(indexed ? kFindingIndex : kFindingNumber, triangle, index, record.w[2]);
}
