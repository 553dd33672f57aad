// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Writes the records of one geometry of a bottom-level acceleration structure: one record per triangle, found through the
// geometry's micromap indices, and the geometry record itself. VkAccelerationStructureTrianglesOpacityMicromapEXT.
#include "shared.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/micromap_layout.glsl"
#include "base/structure_descriptor.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    BlasRecordsPush push;
};

const uint kUnknownOpaque = ~0u; // all sixteen states

uint fetchIndex(uint triangle)
{
    const uint value = loadBytes(elementAddress(push.indices, triangle, push.indexStride), push.indexBytes);
    // Special indices are the unsigned cast of -1..-4 to the index type.
    const uint above = push.indexBytes == 4u ? 0u : ~0u << (push.indexBytes * 8u);
    return value >= (~above & ~3u) ? value | above : value;
}

uvec2 recordOf(uint triangle, uint micromapTriangles)
{
    uint index = triangle;
    if (any(notEqual(push.indices, uvec2(0)))) {
        if (triangle >= push.readable)
            return uvec2(kKindInline, kUnknownOpaque);
        index = fetchIndex(triangle);
        if (index >= 0xfffffffcu)
            return uvec2(kKindInline, ~index * 0x55555555u);
    }
    const uint target = index + push.baseTriangle;
    if (target < index || target >= micromapTriangles)
        return uvec2(kKindInline, kUnknownOpaque);
    Words record = micromapRecord(push.micromap, target);
    return uvec2(record.w[0], record.w[1]);
}

// Address of the tail. An update keeps the layout of its source, which may be compacted or built for other maximum counts,
// so the offset of the tail is the same wherever it fits: before it, the tail would be in the driver's part. Another
// invocation may write the descriptor that is read here; the compared values are the same before and after.
uvec2 tailAddress()
{
    if (all(equal(push.source, uvec2(0))))
        return push.tail;
    const Descriptor source = loadDescriptor(push.source);
    const uint at = unitsBetween(push.sourceBegin, source.tail);
    return source.kind == kDescriptorBottom && source.count == push.geometryCount && fits(at, push.tailUnits, push.commonUnits)
               ? unitAddress(push.begin, at)
               : push.tail;
}

void main()
{
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint triangle = group * gl_WorkGroupSize.x + gl_LocalInvocationID.x;

    uint micromapTriangles = 0u;
    uint dataUnits = 0u;
    const uvec2 micromap = readable(push.micromap, push.tail);
    if (any(notEqual(push.micromap, uvec2(0))) && holdsMicromap(micromap, push.micromapSize)) {
        Words header = Words(micromap);
        micromapTriangles = header.w[kMicromapHeaderTriangles];
        dataUnits = header.w[kMicromapHeaderUnits];
    }
    uint triangles = push.triangleCount;
    if (any(notEqual(push.range, uvec2(0))))
        triangles = min(triangles, Words(readable(push.range, push.tail)).w[0]);
    const uvec2 tail = tailAddress();
    const uint firstTriangle = push.geometryWord >> kGeometryTrianglesShift;
    if (triangle < triangles && firstTriangle != 0u) {
        const uvec2 value = recordOf(triangle, micromapTriangles);
        const uvec2 records = elementAddress(tail, firstTriangle, kTriangleRecordWords * 4u);
        Words record = Words(elementAddress(records, triangle, kTriangleRecordWords * 4u));
        record.w[0] = value.x;
        record.w[1] = value.y;
    }
    if (triangle != 0u)
        return;
    const uvec2 units = micromapUnits(push.micromap, micromapTriangles);
    Words geometry = Words(elementAddress(tail, push.geometry, kGeometryRecordWords * 4u));
    geometry.w[0] = push.geometryWord;
    geometry.w[1] = dataUnits;
    geometry.w[2] = units.x;
    geometry.w[3] = units.y;
    const bool named = push.named != 0u && any(notEqual(push.micromap, uvec2(0)));
    Words name = Words(elementAddress(tail, push.geometryCount + push.geometry, kMicromapNameWords * 4u));
    name.w[0] = named ? push.micromap.x : 0u;
    name.w[1] = named ? push.micromap.y : 0u;
    name.w[2] = named ? unitsBetween(push.micromap, units) : 0u;
    name.w[3] = 0u;
    if (any(notEqual(push.descriptor, uvec2(0))))
        storeDescriptor(push.descriptor, Descriptor(tail, kDescriptorBottom, push.tailUnits, push.geometryCount, push.tailUnits, uvec2(0)));
}
