// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Serializes a bottom-level acceleration structure: the driver's serialized data, and the tail. Micromaps of
// VK_KHR_opacity_micromap are named in the header; the data units of others are copied into the tail, since
// VK_EXT_opacity_micromap has no way to name a micromap for a deserialized structure.
// Two passes: one invocation plans, then all copy.
#include "shared.h"
#include "records.h"
#include "base/memory.glsl"
#include "base/structure_descriptor.glsl"
#include "serialized.glsl"
#include "push.h"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    StructureSavePush push;
};

// The number of named micromaps; writes their addresses to `target`, unless that is 0.
uint writeNames(Descriptor descriptor, uvec2 target)
{
    Units records = recordsOf(descriptor, push.descriptor);
    uint named = 0u;
    for (uint g = 0u; g < descriptor.count; ++g) {
        const uvec4 name = micromapName(records, descriptor, g);
        if (!isNamed(name))
            continue;
        if (any(notEqual(target, uvec2(0)))) {
            Words at = Words(elementAddress(target, named, 8u));
            at.w[0] = name.x;
            at.w[1] = name.y;
        }
        ++named;
    }
    return named;
}

// Data units of the geometries; writes the geometries' records to `target`, unless that is 0.
uint writeData(Descriptor descriptor, uvec2 target)
{
    Units records = recordsOf(descriptor, push.descriptor);
    uint units = 0u;
    uvec4 before = uvec4(0);
    uint beforeOffset = 0u;
    uint named = 0u;
    for (uint g = 0u; g < descriptor.count; ++g) {
        const uvec4 record = records.at[g];
        if (isNamed(micromapName(records, descriptor, g))) {
            if (any(notEqual(target, uvec2(0))))
                Units(target).at[g] = uvec4(record.xy, kDataNamed, named);
            ++named;
            continue;
        }
        uint offset = descriptor.recordUnits + units;
        if (g > 0u && record.yzw == before.yzw)
            offset = beforeOffset;
        else
            units = saturatingAdd(units, record.y);
        if (any(notEqual(target, uvec2(0))))
            Units(target).at[g] = uvec4(record.xy, offset, 0u);
        before = record;
        beforeOffset = offset;
    }
    return units;
}

void plan()
{
    Words driver = Words(unitAddress(push.staging, kPlanUnits));
    Descriptor descriptor = loadDescriptor(push.descriptor);
    const uint offset = unitsBetween(push.begin, descriptor.tail);
    if (descriptor.kind != kDescriptorBoxes && (descriptor.kind != kDescriptorBottom || !fits(offset, descriptor.units, push.structureUnits)))
        descriptor = Descriptor(descriptor.kind == kDescriptorPlain ? descriptor.tail : uvec2(0), kDescriptorPlain, 0u, 0u, 0u, uvec2(0));

    uint driverUnits = driverUnitsOf(uvec2(driver.w[8], driver.w[9]), push.structureUnits);
    uint tailOffset = unitsOfBytes(uvec2(driver.w[10], driver.w[11]));
    const bool ends = any(notEqual(descriptor.tail, uvec2(0))) && offset <= push.structureUnits;
    if (ends && push.wholeCopies != 0u) {
        // The driver also serialized the tail and the memory after the structure: they are cut off.
        driverUnits = min(driverUnits, offset + kSerializedHeaderUnits);
        tailOffset = min(tailOffset, offset);
        const uvec2 size = bytesOfUnits(tailOffset);
        driver.w[10] = size.x;
        driver.w[11] = size.y;
    }
    if (driverUnits != unitsOfBytes(uvec2(driver.w[8], driver.w[9]))) {
        const uvec2 total = bytesOfUnits(driverUnits);
        driver.w[8] = total.x;
        driver.w[9] = total.y;
    }
    tailOffset = bottomLevelSizeUnits(tailOffset);
    const uint dataUnits = writeData(descriptor, uvec2(0));
    const uint tailUnits = saturatingAdd(descriptor.recordUnits, dataUnits);
    const uint named = writeNames(descriptor, uvec2(0));
    const uint block = headerUnits(named) + driverUnits;
    const uint total = saturatingAdd(block + kBlockUnits, tailUnits);

    Words p = Words(push.staging);
    p.w[kPlanOk] = 0u;
    if (driverUnits > push.stagingUnits || total > push.capacity) {
        gpuError(push.root, kGpuErrorMemoryTooSmall);
        return;
    }
    p.w[kPlanOk] = 1u;
    p.w[kPlanDriverUnits] = driverUnits;
    p.w[kPlanTailUnits] = tailUnits;
    p.w[kPlanHeaderUnits] = headerUnits(named);

    Words header = Words(push.blob);
    for (uint w = 0u; w < 8u; ++w)
        header.w[w] = w < 4u ? driver.w[w] : driver.w[w] ^ kCompatibilityWord;
    const uvec2 totalBytes = bytesOfUnits(total);
    const uvec2 size = bytesOfUnits(max(tailOffset + bottomLevelSizeUnits(tailUnits), push.leastUnits));
    header.w[8] = totalBytes.x;
    header.w[9] = totalBytes.y;
    header.w[10] = size.x;
    header.w[11] = size.y;
    for (uint w = 12u; w < headerUnits(named) * 4u; ++w)
        header.w[w] = 0u;
    if (push.blocks != 0u)
        header.w[13] = kBlockFormat;
    if (named != 0u) {
        header.w[12] = 1u;
        header.w[kBlockType] = 0u; // VK_ACCELERATION_STRUCTURE_SERIALIZED_BLOCK_TYPE_OPACITY_MICROMAP_KHR
        header.w[kBlockAddressCount] = named;
        writeNames(descriptor, addressPlus(push.blob, kBlockAddresses * 4u));
    }
    Words b = Words(unitAddress(push.blob, block));
    for (uint w = 8u; w < 16u; ++w)
        b.w[w] = 0u;
    b.w[kBlockHeaderMagic] = kBlockMagic;
    b.w[kBlockHeaderVersion] = kBlockVersion;
    b.w[kBlockHeaderKind] = descriptor.kind;
    b.w[kBlockHeaderCount] = descriptor.count;
    b.w[kBlockHeaderRecordUnits] = descriptor.recordUnits;
    b.w[kBlockHeaderTailUnits] = tailUnits;
    b.w[kBlockHeaderTailOffset] = tailOffset;
    b.w[kBlockHeaderChecksum] = 0u;
    b.w[kBlockHeaderOpaqueBoxes] = descriptor.kind == kDescriptorBoxes ? descriptor.extra.y : 0u;
    writeData(descriptor, unitAddress(push.blob, block + kBlockUnits));
}

void copy(uint me, uint all)
{
    Words p = Words(push.staging);
    if (p.w[kPlanOk] == 0u)
        return;
    const uint driverUnits = p.w[kPlanDriverUnits];
    const uint header = p.w[kPlanHeaderUnits];
    const uint block = header + driverUnits;
    Units blob = Units(push.blob);
    Units driver = Units(unitAddress(push.staging, kPlanUnits));
    uint sum = 0u;
    for (uint i = me; i < driverUnits; i += all) {
        const uvec4 value = driver.at[i];
        blob.at[header + i] = value;
        sum += checkOf(value, i);
    }
    // The first units are the geometry records, which the plan has written.
    const uvec2 tail = unitAddress(push.blob, block + kBlockUnits);
    Words b = Words(unitAddress(push.blob, block));
    const Descriptor descriptor = loadDescriptor(push.descriptor);
    const uint count = b.w[kBlockHeaderCount];
    const uint recordUnits = b.w[kBlockHeaderRecordUnits];
    for (uint i = me; i < recordUnits; i += all) {
        const uvec4 value = i < count ? Units(tail).at[i] : Units(descriptor.tail).at[i];
        if (i >= count)
            Units(tail).at[i] = value;
        sum += checkOf(value, driverUnits + i);
    }
    uint next = recordUnits;
    for (uint g = 0u; g < count; ++g) {
        const uvec4 saved = Units(tail).at[g];
        if (saved.z != next)
            continue; // shares the data of the geometry before it
        const uvec4 record = recordsOf(descriptor, push.descriptor).at[g];
        for (uint i = me; i < record.y; i += all) {
            const uvec4 value = Units(record.zw).at[i];
            Units(tail).at[next + i] = value;
            sum += checkOf(value, driverUnits + next + i);
        }
        next += record.y;
    }
    atomicAdd(b.w[kBlockHeaderChecksum], sum);
}

void main()
{
    const uint me = gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (push.pass == 0u) {
        if (me == 0u)
            plan();
    } else {
        copy(me, gl_NumWorkGroups.x * gl_WorkGroupSize.x);
    }
}
