#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the tail of a bottom-level acceleration structure to the copy that the driver has made of the rest. Whether there
// is one is known only here: the copy may have been recorded before the build that it copies. In place of a driver that
// would copy all that a handle reaches over, copies the driver's part, too, as that driver does.
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
    const uint me = gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    const uint all = gl_NumWorkGroups.x * gl_WorkGroupSize.x;

    Cell source = loadDescriptor(push.sourceDescriptor);
    const bool unbuilt = source.kind == kDescriptorUnbuilt;
    uint at = unitsBetween(push.sourceBegin, source.tail);
    // What is no BLAS with records, or aliases a larger one, has nothing to copy.
    if (source.kind == kDescriptorBottom && !fits(at, source.units, push.sourceUnits))
        source.kind = kDescriptorPlain;
    if (source.kind == kDescriptorBottom) {
        if (push.compact != 0u) {
            if (source.extra.x != 0u)
                at = min(at, source.extra.x);
            // The application knows the size from elsewhere: the records come last in it.
            if (!fits(at, source.units, push.targetUnits) && source.units <= push.targetUnits)
                at = push.targetUnits - source.units;
        }
        if (!fits(at, source.units, push.targetUnits)) {
            source.kind = kDescriptorBroken;
            if (me == 0u)
                gpuError(push.root, kGpuErrorCopyTooSmall);
        }
    }
    // Where the driver's part ends. Of a copy, or of data, of which that is not known, all is copied as that driver does.
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
            storeDescriptor(push.targetDescriptor, Cell(tail, kDescriptorBottom, source.units, source.count, source.recordUnits, uvec2(0)));
        else if (source.kind == kDescriptorBoxes)
            storeDescriptor(push.targetDescriptor, Cell(push.whole != 0u ? tail : uvec2(0), kDescriptorBoxes, 0u, 0u, 0u, source.extra));
        else
            storeDescriptor(push.targetDescriptor, Cell(push.whole != 0u ? tail : uvec2(0), unbuilt ? kDescriptorUnbuilt : source.kind == kDescriptorBroken ? kDescriptorBroken : kDescriptorPlain, 0u, 0u, 0u, uvec2(0)));
    }
    for (uint i = me; i < part && source.kind != kDescriptorBroken; i += all)
        Units(push.targetBegin).at[i] = Units(push.sourceBegin).at[i];
    if (source.kind != kDescriptorBottom)
        return;
    Units from = Units(source.tail);
    Units to = Units(tail);
    for (uint i = me; i < source.units; i += all) {
        uvec4 value = from.at[i];
        // Of a geometry record: data units that lie in the tail itself move along.
        if (i < source.count) {
            const uint place = unitsBetween(source.tail, value.zw);
            if (place < source.units)
                value.zw = unitAddress(tail, place);
        }
        to.at[i] = value;
    }
}
