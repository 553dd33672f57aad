#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the application's instances for the driver to build from, with the slot in place of the custom index and without
// the flags that would keep hits from the shader, and writes the instance records. VkAccelerationStructureInstanceKHR.
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
    bool known;    // there is such a structure
    bool built;
    bool broken;   // it must not be traced
    bool boxes;    // it is known which geometries of boxes are opaque
    uint opaqueBoxes;
    uvec2 records; // its geometry records; zero where it has none
    uint geometries; // how many those are
};

Referenced findReferenced(uvec2 reference)
{
    Referenced found = Referenced(false, false, false, false, 0u, uvec2(0), 0u);
    const uvec2 place = findDescriptor(push.root, reference);
    if ((place.x | place.y) == 0u)
        return found;
    Words descriptor = Words(place);
    found.known = true;
    found.built = descriptor.w[2] != kDescriptorUnbuilt && descriptor.w[2] != kDescriptorMicromap;
    found.broken = descriptor.w[2] == kDescriptorBroken;
    if (descriptor.w[2] == kDescriptorBottom) {
        found.records = uvec2(descriptor.w[0], descriptor.w[1]);
        found.geometries = descriptor.w[4];
    }
    found.boxes = descriptor.w[2] == kDescriptorBoxes;
    if (found.boxes)
        found.opaqueBoxes = descriptor.w[7];
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

// The driver reads hit records of all instances: tables of the layer reach as far (hit_records.comp).
void noteRecordOffset(uint offset)
{
    if (offset == 0u)
        return;
    Words header = Words(push.root);
    Words counters = Words(uvec2(header.w[kRootGpuErrors], header.w[kRootGpuErrors + 1u]));
    if (counters.w[kGreatestRecordOffset] < offset)
        atomicMax(counters.w[kGreatestRecordOffset], offset);
}

// The VkAccelerationStructureBuildRangeInfoKHR of an indirect build: primitiveCount, primitiveOffset.
bool isIndirect()
{
    return (push.range.x | push.range.y) != 0u;
}

// Whether the structure is a copy, and `source` the address of a descriptor.
bool isCopy()
{
    return push.from == kFromStructure || push.from == kFromSerialized;
}

// Where instance i is read from.
uvec2 sourceOf(uint i, Cell copied)
{
    const uvec2 array = isIndirect() ? addressPlus(push.source, Words(readable(push.range, push.root)).w[1]) : push.source;
    if (push.from == kFromPointers)
        return loadAddress(elementAddress(array, i, 8u));
    return elementAddress(isCopy() ? copied.tail : array, i, kInstanceBytes);
}

uvec2 referenceOf(uint i, Words source, Cell copied)
{
    return push.from == kFromSerialized ? loadAddress(elementAddress(copied.extra, i, 8u))
                                        : uvec2(source.w[kReferenceWord], source.w[kReferenceWord + 1u]);
}

// The application's instance, for copies of the structure.
void keep(uint i, Cell copied)
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
    Cell copied = Cell(uvec2(0), kDescriptorTop, 0u, push.count, 0u, uvec2(0));
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
    // More than the application said that there would be at most are left out: VUID-...-ppMaxPrimitiveCounts-03653.
    if (isIndirect())
        copied.count = min(Words(readable(push.range, push.root)).w[0], push.count);
    if (push.pass != 0u) {
        if (i < copied.count)
            keep(i, copied);
        return;
    }
    if (i == 0u) {
        const uint units = copied.count * kInstanceUnits;
        storeDescriptor(push.descriptor, Cell(push.tail, kDescriptorTop, units, copied.count, units, uvec2(0)));
    }
    if (i >= push.count)
        return;
    const uint slot = push.firstSlot + i;
    Words target = Words(elementAddress(push.target, i, kInstanceBytes));
    if (i >= copied.count) {
        // Inactive: the driver builds for as many instances as there may be.
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
    // The driver follows references when it builds. Those of an application's build are the application's; those of a
    // copy may have been destroyed since, or come from another process.
    const bool dead = found.broken || (copying && !found.built);
    if (dead && !found.built && any(notEqual(reference, uvec2(0))))
        gpuError(push.root, found.known ? kGpuErrorUnbuiltReference : kGpuErrorUnknownReference);

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
