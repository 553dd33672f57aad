// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the tail of a bottom-level acceleration structure to the copy that the driver has made of the rest. Only the device
// knows whether there is a tail: the copy may have been recorded before the build of its source. If the driver would copy
// everything that the handle covers, the shader copies the driver's part as well, as that driver does.
#include "shared.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/structure_descriptor.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    StructureCopyPush push;
};

void main()
{
    const uint me = gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    const uint all = gl_NumWorkGroups.x * gl_WorkGroupSize.x;

    Descriptor source = loadDescriptor(push.sourceDescriptor);
    const bool unbuilt = source.kind == kDescriptorUnbuilt;
    uint at = unitsBetween(push.sourceBegin, source.tail);
    // Nothing is copied from a structure that has no records, or that aliases a larger one.
    if (source.kind == kDescriptorBottom && !fits(at, source.units, push.sourceUnits))
        source.kind = kDescriptorPlain;
    if (source.kind == kDescriptorBottom) {
        if (push.compact != 0u) {
            if (source.extra.x != 0u)
                at = min(at, source.extra.x);
            // The application did not get the size from a query: the records are at the end of the copy.
            if (!fits(at, source.units, push.targetUnits) && source.units <= push.targetUnits)
                at = push.targetUnits - source.units;
        }
        if (!fits(at, source.units, push.targetUnits)) {
            source.kind = kDescriptorBroken;
            if (me == 0u)
                gpuError(push.root, kGpuErrorCopyTooSmall);
        }
    }
    // The end of the driver's part. If it is unknown, as for a copy or deserialized data, everything is copied.
    const bool bottom = source.kind == kDescriptorBottom || source.kind == kDescriptorPlain || source.kind == kDescriptorBoxes;
    uint part = 0u;
    if (push.whole != 0u && bottom) {
        const uint both = min(push.sourceUnits, push.targetUnits);
        const bool known = any(notEqual(source.tail, uvec2(0))) && unitsBetween(push.sourceBegin, source.tail) <= push.sourceUnits;
        part = known ? min(unitsBetween(push.sourceBegin, source.tail), source.kind == kDescriptorBottom ? at : ~0u) : both;
        if (part > push.targetUnits) {
            source.kind = kDescriptorBroken;
            if (me == 0u)
                gpuError(push.root, kGpuErrorCopyTooSmall);
        }
    }
    if (source.kind != kDescriptorBottom)
        at = part;
    const uvec2 tail = unitAddress(push.targetBegin, at);
    if (me == 0u) {
        if (source.kind == kDescriptorBottom)
            storeDescriptor(push.targetDescriptor, Descriptor(tail, kDescriptorBottom, source.units, source.count, source.recordUnits, uvec2(0)));
        else if (source.kind == kDescriptorBoxes)
            storeDescriptor(push.targetDescriptor, Descriptor(push.whole != 0u ? tail : uvec2(0), kDescriptorBoxes, 0u, 0u, 0u, source.extra));
        else
            storeDescriptor(push.targetDescriptor, Descriptor(push.whole != 0u ? tail : uvec2(0), unbuilt ? kDescriptorUnbuilt : source.kind == kDescriptorBroken ? kDescriptorBroken : kDescriptorPlain, 0u, 0u, 0u, uvec2(0)));
    }
    for (uint i = me; i < part && source.kind != kDescriptorBroken; i += all)
        Units(push.targetBegin).at[i] = Units(push.sourceBegin).at[i];
    if (source.kind != kDescriptorBottom)
        return;
    Units from = Units(source.tail);
    Units to = Units(tail);
    for (uint i = me; i < source.units; i += all) {
        uvec4 value = from.at[i];
        // A geometry record whose data units are in the tail itself: they move with it.
        if (i < source.count) {
            const uint offset = unitsBetween(source.tail, value.zw);
            if (offset < source.units)
                value.zw = unitAddress(tail, offset);
        }
        to.at[i] = value;
    }
}
