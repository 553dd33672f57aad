// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Writes the application's instances to the tail of a top-level structure, and its descriptor, where the host does not know
// where they are or how many: pointers, indirect builds, copies and serialized data.
#include "shared.h"
#include "opacity.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/structure_descriptor.glsl"
#include "instance.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    TlasGatherPush push;
};

uvec2 loadAddress(uvec2 at)
{
    Words words = Words(at);
    return uvec2(words.w[0], words.w[1]);
}

// Returns whether push.range is the address of a VkAccelerationStructureBuildRangeInfoKHR: primitiveCount, primitiveOffset.
bool isIndirect()
{
    return (push.range.x | push.range.y) != 0u;
}

// Returns whether the structure is a copy, and `source` the address of a descriptor.
bool isCopy()
{
    return push.from == kFromStructure || push.from == kFromSerialized;
}

// Address of instance i.
uvec2 sourceOf(uint i, Descriptor copied)
{
    if (isCopy())
        return elementAddress(copied.tail, i, kInstanceBytes);
    const uvec2 array = isIndirect() ? addressPlus(push.source, Words(readable(push.range, push.root)).w[1]) : push.source;
    return push.from == kFromPointers ? loadAddress(elementAddress(array, i, 8u)) : elementAddress(array, i, kInstanceBytes);
}

void main()
{
    const uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    Descriptor copied = Descriptor(uvec2(0), kDescriptorTop, 0u, push.count, 0u, uvec2(0));
    if (isCopy()) {
        copied = loadDescriptor(push.source);
        if (copied.kind == kDescriptorTop && copied.count > push.count) {
            if (i == 0u)
                gpuError(push.root, push.from == kFromStructure ? kGpuErrorCopyTooSmall : kGpuErrorTargetTooSmall);
            copied.kind = kDescriptorBroken;
        }
        if (copied.kind != kDescriptorTop)
            copied.count = 0u;
    }
    // Instances beyond the application's maximum are excluded: VUID-...-ppMaxPrimitiveCounts-03653.
    if (isIndirect())
        copied.count = min(Words(readable(push.range, push.root)).w[0], push.count);
    if (i == 0u) {
        const uint units = copied.count * kInstanceUnits;
        storeDescriptor(push.descriptor, Descriptor(push.tail, kDescriptorTop, units, copied.count, units, uvec2(push.firstSlot, 0u)));
    }
    if (i >= push.count)
        return;
    Units target = Units(elementAddress(push.tail, i, kInstanceBytes));
    if (i >= copied.count) {
        // Inactive: the driver builds for the greatest possible number of instances.
        for (uint u = 0u; u < kInstanceUnits; ++u)
            target.at[u] = uvec4(0);
        return;
    }
    Units source = Units(sourceOf(i, copied));
    for (uint u = 0u; u < kLastUnit; ++u)
        target.at[u] = source.at[u];
    uvec4 last = source.at[kLastUnit];
    if (push.from == kFromStructure)
        last.xy = originalWords(push.root, last.xy);
    if (push.from == kFromSerialized)
        last.zw = loadAddress(elementAddress(copied.extra, i, 8u));
    target.at[kLastUnit] = last;
}
