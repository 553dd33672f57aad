// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Checks the triangles of a micromap build and counts them by level and format; then compares the numbers with the usage
// counts, unless a triangle has a finding of its own.
#include "shared.h"
#include "findings.h"
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    TriangleCheckPush push;
};

#include "validation/log.glsl"

void count(uint kind, uint number)
{
    if (number != 0u)
        atomicAdd(Words(push.counts).w[kUsageFound + kind], number);
}

void checkTriangles(uint first, uint last)
{
    uint kind = 0u;
    uint number = 0u;
    for (uint t = first; t < last; ++t) {
        const uvec2 address = elementAddress(push.triangles, t, push.stride);
        const uint dataOffset = loadBytes(address, 4u);
        const uint levelAndFormat = loadBytes(addressPlus(address, 4u), 4u);
        const uint level = levelAndFormat & 0xffffu;
        const uint format = levelAndFormat >> 16u;
        const uint what = findingOfTriangle(dataOffset, level, format, push.limits, push.dataBytes);
        if (what != 0u) {
            reportFinding(what, t, dataOffset, levelAndFormat);
            Words(push.counts).w[kUsageWrong] = 1u;
            continue;
        }
        if (usageKind(level, format) != kind) {
            count(kind, number);
            kind = usageKind(level, format);
            number = 0u;
        }
        ++number;
    }
    count(kind, number);
}

void compareCounts()
{
    Words counts = Words(push.counts);
    if (counts.w[kUsageWrong] != 0u)
        return;
    for (uint kind = 0u; kind < kUsageKinds; ++kind) {
        const uint declared = counts.w[kind];
        const uint found = counts.w[kUsageFound + kind];
        if (declared != found) {
            reportFinding(kFindingCounts, kind / 2u | (kind % 2u + 1u) << 16u, declared, found);
            return;
        }
    }
}

void main()
{
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint i = group * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (push.comparing != 0u) {
        if (i == 0u)
            compareCounts();
        return;
    }
    if (i <= (push.count - 1u) / kCheckedTriangles)
        checkTriangles(i * kCheckedTriangles, min((i + 1u) * kCheckedTriangles, push.count));
}
