// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Deserializes an acceleration structure. The data is not trusted: unless it is exactly what this version of the layer and
// this driver have serialized, the driver gets the fallback structure in its place.
// Passes: one invocation checks the headers; all compute the checksum; one invocation decides; all copy the driver's data to
// staging memory, from where the driver deserializes; then all copy the tail.
//
// If only the data states what it holds, everything is recorded that it can need: the build of a top-level structure, and
// the deserialization of a bottom-level one. Memory that the wrong one of the two overwrites is kept, and restored.
#include "shared.h"
#include "records.h"
#include "base/memory.glsl"
#include "base/structure_descriptor.glsl"
#include "serialized.glsl"
#include "push.h"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    StructureRestorePush push;
};

uint kind; // of the data: kDescriptorBottom, kDescriptorTop or kDescriptorMicromap

uint kindOfData()
{
    if (push.kind != kDescriptorUnbuilt)
        return push.kind;
    if (push.capacity < 2u * kSerializedHeaderUnits)
        return kDescriptorBottom; // fault() rejects it
    Words header = Words(push.blob);
    const uint at = kSerializedLayoutUuid;
    if (header.w[at] == kMicromapLayoutUuid0 && header.w[at + 1u] == kMicromapLayoutUuid1 && header.w[at + 2u] == kMicromapLayoutUuid2)
        return kDescriptorMicromap;
    return (header.w[10] & 255u) == kTopLevelSizeMark ? kDescriptorTop : kDescriptorBottom;
}

// Number of micromaps that the header of a BLAS names; ~0: the header is invalid. Without blocks it has one of two forms.
uint namedMicromaps()
{
    Words header = Words(push.blob);
    if (header.w[12] == 0u && (header.w[13] == 0u || header.w[13] == kBlockFormat))
        return 0u;
    if (header.w[12] != 1u || header.w[13] != kBlockFormat || header.w[kBlockType] != 0u)
        return ~0u;
    const uint count = header.w[kBlockAddressCount];
    return header.w[kBlockAddressCount + 1u] != 0u || count == 0u || count > kMaxBlockAddresses ? ~0u : count;
}

// Units before the block; ~0: the header is invalid.
uint blockStart()
{
    Words header = Words(push.blob);
    if (kind == kDescriptorBottom) {
        const uint named = namedMicromaps();
        if (named == ~0u || !fits(headerUnits(named), kSerializedHeaderUnits, push.capacity))
            return ~0u;
        Words driver = Words(unitAddress(push.blob, headerUnits(named)));
        return saturatingAdd(headerUnits(named), driverUnitsOf(uvec2(driver.w[8], driver.w[9]), 0x0fffffffu));
    }
    return header.w[13] != 0u || header.w[12] > 0x0fffffffu ? ~0u : (header.w[12] + 1u) / 2u + kSerializedHeaderUnits;
}

// The error in the headers, kGpuError*; kGpuErrors: they are valid.
uint fault()
{
    if (push.capacity < 2u * kSerializedHeaderUnits)
        return kGpuErrorDamagedData;
    Words header = Words(push.blob);
    Words fallback = Words(push.fallback);
    for (uint w = 0u; w < 8u; ++w) {
        if (header.w[w] != (w < 4u ? fallback.w[w] : fallback.w[w] ^ kCompatibilityWord))
            return kGpuErrorForeignData;
    }
    const bool top = (header.w[10] & 255u) == kTopLevelSizeMark;
    if (top != (kind == kDescriptorTop))
        return kGpuErrorWrongType;
    const uint total = unitsOfBytes(uvec2(header.w[8], header.w[9]));
    const uint block = blockStart();
    if (total > push.capacity || !fits(block, kBlockUnits, total))
        return kGpuErrorDamagedData;
    Words b = Words(unitAddress(push.blob, block));
    const uint tailUnits = b.w[kBlockHeaderTailUnits];
    const uint count = b.w[kBlockHeaderCount];
    if (b.w[kBlockHeaderMagic] != kBlockMagic || b.w[kBlockHeaderVersion] != kBlockVersion ||
        tailUnits != total - block - kBlockUnits)
        return kGpuErrorDamagedData;
    if (top)
        return b.w[kBlockHeaderKind] != kDescriptorTop || count != header.w[12] || tailUnits / kInstanceUnits != count
                   ? kGpuErrorDamagedData
                   : kGpuErrors;
    const uint headerSize = headerUnits(namedMicromaps());
    const uint driverUnits = block - headerSize;
    Words driver = Words(unitAddress(push.blob, headerSize));
    const uint driverSize = unitsOfBytes(uvec2(driver.w[10], driver.w[11]));
    if ((b.w[kBlockHeaderKind] != kDescriptorBottom && b.w[kBlockHeaderKind] != kDescriptorPlain && b.w[kBlockHeaderKind] != kDescriptorBoxes) || b.w[kBlockHeaderRecordUnits] > tailUnits ||
        count > b.w[kBlockHeaderRecordUnits] / 2u || driverUnits > push.stagingUnits)
        return kGpuErrorDamagedData;
    for (uint w = 0u; w < 8u; ++w) {
        if (driver.w[w] != fallback.w[w])
            return kGpuErrorForeignData;
    }
    return driverSize > push.targetUnits || !fits(b.w[kBlockHeaderTailOffset], tailUnits, push.targetUnits)
               ? kGpuErrorTargetTooSmall
               : kGpuErrors;
}

void check()
{
    Words p = Words(push.staging);
    p.w[kPlanKind] = kind;
    if (kind == kDescriptorMicromap) { // micromap_move.comp deserializes it
        p.w[kPlanOk] = 0u;
        p.w[kPlanHeaderUnits] = 0u;
        p.w[kPlanDriverUnits] = push.fallbackUnits;
        return;
    }
    uint what = fault();
    if (what == kGpuErrors && kind == kDescriptorTop && push.topPath == 0u)
        what = kGpuErrorTargetTooSmall;
    if (what != kGpuErrors)
        gpuError(push.root, what);
    p.w[kPlanOk] = what == kGpuErrors ? 1u : 0u;
    const uint named = what == kGpuErrors && kind == kDescriptorBottom ? namedMicromaps() : 0u;
    p.w[kPlanHeaderUnits] = headerUnits(named);
    p.w[kPlanNamed] = named;
    p.w[kPlanDriverUnits] = what == kGpuErrors ? blockStart() - headerUnits(named) : push.fallbackUnits;
    p.w[kPlanChecksum] = 0u;
}

void addUp(uint me, uint all)
{
    Words p = Words(push.staging);
    if (p.w[kPlanOk] == 0u)
        return;
    const uint driverUnits = p.w[kPlanDriverUnits];
    const uint header = p.w[kPlanHeaderUnits];
    const uint block = header + driverUnits;
    Units blob = Units(push.blob);
    uint sum = 0u;
    // A TLAS has the handles there, which the application may have changed.
    for (uint i = me; kind == kDescriptorBottom && i < driverUnits; i += all)
        sum += checkOf(blob.at[header + i], i);
    const uint first = kind == kDescriptorBottom ? driverUnits : 0u;
    const uint tailUnits = Words(unitAddress(push.blob, block)).w[kBlockHeaderTailUnits];
    Units tail = Units(unitAddress(push.blob, block + kBlockUnits));
    for (uint i = me; i < tailUnits; i += all)
        sum += checkOf(tail.at[i], first + i);
    atomicAdd(p.w[kPlanChecksum], sum);
}

void decide()
{
    Words p = Words(push.staging);
    Descriptor instances = Descriptor(uvec2(0), kDescriptorUnbuilt, 0u, 0u, 0u, uvec2(0));
    if (p.w[kPlanOk] != 0u) {
        const uint block = p.w[kPlanHeaderUnits] + p.w[kPlanDriverUnits];
        Words b = Words(unitAddress(push.blob, block));
        if (b.w[kBlockHeaderChecksum] != p.w[kPlanChecksum]) {
            gpuError(push.root, kGpuErrorDamagedData);
            p.w[kPlanOk] = 0u;
            p.w[kPlanDriverUnits] = push.fallbackUnits;
        } else if (kind == kDescriptorTop) {
            const uint count = b.w[kBlockHeaderCount];
            instances = Descriptor(unitAddress(push.blob, block + kBlockUnits), kDescriptorTop, count * kInstanceUnits, count,
                             count * kInstanceUnits, addressPlus(push.blob, kSerializedHeaderWords * 4u));
        }
    }
    storeDescriptor(addressPlus(push.staging, kPlanDescriptor * 4u), instances);
}

void stage(uint me, uint all)
{
    Words p = Words(push.staging);
    // A top-level structure is not deserialized by the driver.
    const bool ok = p.w[kPlanOk] != 0u && kind == kDescriptorBottom;
    const uint driverUnits = ok ? p.w[kPlanDriverUnits] : push.fallbackUnits;
    Units from = Units(ok ? unitAddress(push.blob, p.w[kPlanHeaderUnits]) : push.fallback);
    Units to = Units(unitAddress(push.staging, kPlanUnits));
    for (uint i = me; i < driverUnits; i += all)
        to.at[i] = from.at[i];
}

// The address in the header for the micromap of that number, which replaces the one that was serialized. 0, with an error,
// if there is no micromap at that address that can hold `units` data units, `offset` units after it.
uvec2 micromapInHeader(uint number, uint named, uint offset, uint units)
{
    if (number < named) {
        Words at = Words(addressPlus(push.blob, kBlockAddresses * 4u + number * 8u));
        const uvec2 address = uvec2(at.w[0], at.w[1]);
        const uvec2 descriptor = findDescriptor(hashTable(push.root), addressPlus(address, kMicromapKey));
        if (any(notEqual(descriptor, uvec2(0))) && loadDescriptor(descriptor).kind == kDescriptorMicromap && fits(offset, units, loadDescriptor(descriptor).units))
            return address;
    }
    gpuError(push.root, kGpuErrorUnknownMicromap);
    return uvec2(0);
}

// Marks the descriptor as written by this deserialization (core/records.h). The host, which may read while this is executed,
// takes a descriptor with this serial for complete.
void sign()
{
    memoryBarrierBuffer();
    CoherentWords descriptor = CoherentWords(descriptorWords(push.descriptor));
    descriptor.w[(descriptor.w[2] & kDescriptorKindMask) == kDescriptorBoxes ? 6u : 7u] = push.serial;
}

void finish(uint me, uint all)
{
    Words p = Words(push.staging);
    if (p.w[kPlanOk] == 0u) {
        if (me == 0u) {
            storeDescriptor(push.descriptor, Descriptor(uvec2(0), kind == kDescriptorMicromap ? kDescriptorMicromap : kDescriptorBroken, 0u, 0u, 0u, uvec2(0)));
            sign();
        }
        return;
    }
    if (kind == kDescriptorTop) { // the build has written its descriptor
        if (me == 0u)
            sign();
        return;
    }
    const uint block = p.w[kPlanHeaderUnits] + p.w[kPlanDriverUnits];
    Words b = Words(unitAddress(push.blob, block));
    const uint tailUnits = b.w[kBlockHeaderTailUnits];
    const uint count = b.w[kBlockHeaderCount];
    const uvec2 tail = unitAddress(push.begin, b.w[kBlockHeaderTailOffset]);
    if (me == 0u && b.w[kBlockHeaderKind] == kDescriptorBottom)
        storeDescriptor(push.descriptor, Descriptor(tail, kDescriptorBottom, tailUnits, count, b.w[kBlockHeaderRecordUnits], uvec2(0)));
    else if (me == 0u) {
        Words driver = Words(unitAddress(push.staging, kPlanUnits));
        const uvec2 end = unitAddress(push.begin, unitsOfBytes(uvec2(driver.w[10], driver.w[11])));
        const bool boxes = b.w[kBlockHeaderKind] == kDescriptorBoxes;
        storeDescriptor(push.descriptor, Descriptor(end, boxes ? kDescriptorBoxes : kDescriptorPlain, 0u, 0u, 0u,
                                  boxes ? uvec2(0u, b.w[kBlockHeaderOpaqueBoxes]) : uvec2(0)));
    }
    if (me == 0u)
        sign();
    Units from = Units(unitAddress(push.blob, block + kBlockUnits));
    Units to = Units(tail);
    for (uint i = me; i < tailUnits; i += all) {
        uvec4 value = from.at[i];
        if (i < count && value.z == kDataNamed) {
            const uint offset = from.at[count + i].z;
            const uvec2 micromap = micromapInHeader(value.w, p.w[kPlanNamed], offset, value.y);
            value.zw = unitAddress(micromap, offset);
            // The micromap is missing: the geometry becomes one without a micromap.
            if ((micromap.x | micromap.y) == 0u)
                value = uvec4(value.x & kGeometryRecordOpaque, uvec3(0));
        } else if (i < count) {
            value.zw = unitAddress(tail, value.z);
        } else if (i < 2u * count && isNamed(value)) {
            value.xy = micromapInHeader(from.at[i - count].w, p.w[kPlanNamed], value.z, from.at[i - count].y);
        }
        to.at[i] = value;
    }
}

bool isBuiltTop()
{
    return kind == kDescriptorTop && Words(push.staging).w[kPlanOk] != 0u;
}

void copyUnits(uvec2 from, uvec2 to, uint units, uint me, uint all)
{
    for (uint i = me; i < units; i += all)
        Units(to).at[i] = Units(from).at[i];
}

void main()
{
    const uint me = gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    const uint all = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    kind = push.pass == kPassCheck ? kindOfData() : Words(push.staging).w[kPlanKind];
    switch (push.pass) {
    case kPassCheck:
        if (me == 0u)
            check();
        break;
    case kPassAddUp: addUp(me, all); break;
    case kPassDecide:
        if (me == 0u)
            decide();
        break;
    case kPassStage: stage(me, all); break;
    case kPassKeep:
        if (!isBuiltTop())
            copyUnits(push.begin, push.kept, push.keptUnits, me, all);
        break;
    case kPassRestoreKept:
        if (isBuiltTop())
            copyUnits(push.begin, push.kept, push.fallbackBuiltUnits, me, all);
        else
            copyUnits(push.kept, push.begin, push.keptUnits, me, all);
        break;
    case kPassRestoreKeptLast:
        if (isBuiltTop() || kind == kDescriptorMicromap)
            copyUnits(push.kept, push.begin, push.fallbackBuiltUnits, me, all);
        break;
    default: finish(me, all); break;
    }
}
