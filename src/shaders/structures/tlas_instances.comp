// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Writes the instances (VkAccelerationStructureInstanceKHR) that the driver builds from: those of the application, with the
// slot in place of the custom index, and without the flags that would keep hits from the shader. Writes the instance records.
#include "shared.h"
#include "opacity.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/structure_descriptor.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    TlasInstancesPush push;
};

const uint kInstanceBytes = 64u;
const uint kCustomIndexWord = 12u; // custom index 24 bits, mask 8
const uint kFlagsWord = 13u;       // shader binding table offset 24 bits, flags 8
const uint kReferenceWord = 14u;

uvec2 loadAddress(uvec2 at)
{
    Words words = Words(at);
    return uvec2(words.w[0], words.w[1]);
}

struct Referenced {
    bool known;       // the structure exists
    bool bottom;      // it may be a bottom-level structure
    bool built;
    bool broken;      // it must not be traced
    bool boxes;       // `opaqueBoxes` is valid
    uint opaqueBoxes; // word 7 of the descriptor
    uvec2 records;    // address of the geometry records; 0: it has none
    uint geometries;  // number of geometry records
};

Referenced findReferenced(uvec2 reference)
{
    Referenced found = Referenced(false, false, false, false, false, 0u, uvec2(0), 0u);
    const uvec2 address = findDescriptor(push.root, reference);
    if ((address.x | address.y) == 0u)
        return found;
    const Descriptor descriptor = loadDescriptor(address);
    found.known = true;
    found.bottom = descriptor.kind != kDescriptorMicromap && descriptor.kind != kDescriptorTop;
    found.built = descriptor.kind != kDescriptorUnbuilt && descriptor.kind != kDescriptorMicromap;
    found.broken = descriptor.kind == kDescriptorBroken;
    if (descriptor.kind == kDescriptorBottom) {
        found.records = descriptor.tail;
        found.geometries = descriptor.count;
    }
    found.boxes = descriptor.kind == kDescriptorBoxes;
    if (found.boxes)
        found.opaqueBoxes = descriptor.extra.y;
    return found;
}

void writeRecord(uint slot, uint customIndex, uint flags, Referenced found)
{
    const uvec2 entry = elementAddress(push.root, (slot >> kSlotsPerPageLog2) + kRootHeaderWords / 2u, 8u);
    const uvec2 page = loadAddress(entry);
    Words record = Words(uvec2(page.x + (slot << kInstanceRecordLog2), page.y));
    record.w[2] = found.records.x;
    record.w[3] = found.records.y;
    if (found.boxes) {
        const uint recordFlags = (flags >> kInstanceFlagsShift) & kInstanceFlagsMask;
        record.w[0] = customIndex | kInstanceBoxes | (recordFlags << kInstanceBoxFlagsShift);
        record.w[1] = 0u;
        record.w[2] = found.opaqueBoxes;
        return;
    }
    const bool recorded = any(notEqual(found.records, uvec2(0)));
    record.w[0] = customIndex | hitTable(recorded ? flags : 0u);
    const uint mask = (flags & kInstanceDisableMicromaps) != 0u ? kGeometryRecordOpaque : kManyGeometriesMask;
    uint only = kManyGeometries;
    if (!recorded)
        only = 0u;
    else if (found.geometries == 1u)
        only = Words(found.records).w[0];
    record.w[1] = (only & kManyGeometries) != 0u ? kManyGeometries | mask : only & mask;
}

// The driver reads hit records of all instances, so the layer's copies of hit tables must be large enough (hit_records.comp).
void noteRecordOffset(uint offset)
{
    if (offset == 0u)
        return;
    Words header = Words(push.root);
    Words counters = Words(uvec2(header.w[kRootGpuErrors], header.w[kRootGpuErrors + 1u]));
    if (counters.w[kGreatestRecordOffset] < offset)
        atomicMax(counters.w[kGreatestRecordOffset], offset);
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

// Address of the application's instance i.
uvec2 sourceOf(uint i, Descriptor copied)
{
    const uvec2 array = isIndirect() ? addressPlus(push.source, Words(readable(push.range, push.root)).w[1]) : push.source;
    if (push.from == kFromPointers)
        return loadAddress(elementAddress(array, i, 8u));
    return elementAddress(isCopy() ? copied.tail : array, i, kInstanceBytes);
}

uvec2 referenceOf(uint i, Words source, Descriptor copied)
{
    return push.from == kFromSerialized ? loadAddress(elementAddress(copied.extra, i, 8u))
                                        : uvec2(source.w[kReferenceWord], source.w[kReferenceWord + 1u]);
}

// Keeps the application's instance in the tail, for copies of the structure.
void keep(uint i, Descriptor copied)
{
    Words source = Words(sourceOf(i, copied));
    Words kept = Words(elementAddress(push.tail, i, kInstanceBytes));
    for (uint w = 0u; w < kReferenceWord; ++w)
        kept.w[w] = source.w[w];
    const uvec2 reference = referenceOf(i, source, copied);
    kept.w[kReferenceWord] = reference.x;
    kept.w[kReferenceWord + 1u] = reference.y;
}

void main()
{
    const uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    const bool copying = isCopy();
    Descriptor copied = Descriptor(uvec2(0), kDescriptorTop, 0u, push.count, 0u, uvec2(0));
    if (copying) {
        copied = loadDescriptor(push.source);
        if (copied.kind == kDescriptorTop && copied.count > push.count) {
            if (i == 0u && push.pass == 0u)
                gpuError(push.root, push.from == kFromStructure ? kGpuErrorCopyTooSmall : kGpuErrorTargetTooSmall);
            copied.kind = kDescriptorBroken;
        }
        if (copied.kind != kDescriptorTop)
            copied.count = 0u;
    }
    // Instances beyond the application's maximum are excluded: VUID-...-ppMaxPrimitiveCounts-03653.
    if (isIndirect())
        copied.count = min(Words(readable(push.range, push.root)).w[0], push.count);
    if (push.pass != 0u) {
        if (i < copied.count)
            keep(i, copied);
        return;
    }
    if (i == 0u) {
        const uint units = copied.count * kInstanceUnits;
        storeDescriptor(push.descriptor, Descriptor(push.tail, kDescriptorTop, units, copied.count, units, uvec2(push.firstSlot, 0u)));
    }
    if (i >= push.count)
        return;
    const uint slot = push.firstSlot + i;
    Words target = Words(elementAddress(push.target, i, kInstanceBytes));
    if (i >= copied.count) {
        // Inactive: the driver builds for the greatest possible number of instances.
        for (uint w = 0u; w < kInstanceBytes / 4u; ++w)
            target.w[w] = 0u;
        writeRecord(slot, 0u, 0u, findReferenced(uvec2(0)));
        return;
    }
    Words source = Words(sourceOf(i, copied));
    const bool inPlace = push.from == kFromTarget;
    if (!inPlace) {
        for (uint w = 0u; w < kCustomIndexWord; ++w)
            target.w[w] = source.w[w];
    }
    const uint customAndMask = source.w[kCustomIndexWord];
    const uint offsetAndFlags = source.w[kFlagsWord];
    const uvec2 reference = referenceOf(i, source, copied);
    const Referenced found = findReferenced(reference);
    // The driver follows references when it builds, so it gets none that lead nowhere. That a bottom-level structure is built
    // first is the application's part; those of a copy may have been destroyed, or come from another process.
    const bool named = any(notEqual(reference, uvec2(0)));
    const bool nothing = named && (copying ? !found.built : !found.bottom);
    const bool dead = found.broken || nothing;
    if (nothing)
        gpuError(push.root, copying ? found.known ? kGpuErrorUnbuiltReference : kGpuErrorUnknownReference
                            : isIndirect() ? kGpuErrorNoBottomLevelIndirect : kGpuErrorNoBottomLevel);

    // The driver knows no micromap bits. FORCE_OPAQUE would make it commit hits that the micromap ignores.
    uint hidden = kInstanceForce2State | kInstanceDisableMicromaps;
    if (any(notEqual(found.records, uvec2(0))))
        hidden |= kInstanceForceOpaque;

    target.w[kCustomIndexWord] = slot | (customAndMask & 0xff000000u);
    target.w[kFlagsWord] = offsetAndFlags & ~(hidden << 24u);
    if (!inPlace || dead) {
        target.w[kReferenceWord] = dead ? 0u : reference.x;
        target.w[kReferenceWord + 1u] = dead ? 0u : reference.y;
    }
    writeRecord(slot, customAndMask & 0x00ffffffu, offsetAndFlags >> 24u, found);
    noteRecordOffset(offsetAndFlags & 0x00ffffffu);
}
