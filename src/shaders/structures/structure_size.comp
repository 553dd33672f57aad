// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Corrects the driver's answer to a property query of an acceleration structure: adds the layer's part to the 64-bit number
// at push.value.
#include "shared.h"
#include "records.h"
#include "base/memory.glsl"
#include "base/structure_descriptor.glsl"
#include "serialized.glsl"
#include "push.h"

layout(local_size_x = 1) in;

layout(push_constant, std430) uniform Push
{
    StructureSizePush push;
};

void main()
{
    Words value = Words(push.value);
    Descriptor descriptor = loadDescriptor(push.descriptor);
    const uint offset = unitsBetween(push.begin, descriptor.tail);
    if (!fits(offset, descriptor.units, push.structureUnits))
        descriptor.kind = kDescriptorPlain;
    // True if the end of the driver's part is known, for a structure without records.
    const bool ends = (descriptor.kind == kDescriptorPlain || descriptor.kind == kDescriptorBoxes) && any(notEqual(descriptor.tail, uvec2(0))) &&
                      offset <= push.structureUnits;
    const uvec2 driver = uvec2(value.w[0], value.w[1]);
    uvec2 result = driver;
    if (descriptor.kind == kDescriptorTop) {
        if (push.property == kPropertyPointers)
            result = uvec2(descriptor.count, 0u);
        else if (push.property == kPropertySerializationSize)
            result = bytesOfUnits(kSerializedHeaderUnits + (descriptor.count + 1u) / 2u + kBlockUnits + descriptor.units);
        else
            result = bytesOfUnits(topLevelSizeUnits(offset + descriptor.units));
    } else if (push.property == kPropertyPointers) {
        result = uvec2(0);
    } else if (push.property == kPropertySerializationSize) {
        // structure_save.comp plans the same.
        uint units = driverUnitsOf(driver, push.structureUnits);
        if (ends && push.wholeCopies != 0u)
            units = min(units, saturatingAdd(offset, kSerializedHeaderUnits));
        uint tail = 0u;
        uint named = 0u;
        if (descriptor.kind == kDescriptorBottom) {
            if (push.wholeCopies != 0u)
                units = min(units, saturatingAdd(offset, kSerializedHeaderUnits));
            tail = descriptor.recordUnits;
            uvec4 before = uvec4(0);
            Units records = recordsOf(descriptor, push.descriptor);
            for (uint g = 0u; g < descriptor.count; ++g) {
                if (isNamed(micromapName(records, descriptor, g))) {
                    ++named;
                    continue;
                }
                const uvec4 record = records.at[g];
                if (g == 0u || record.yzw != before.yzw)
                    tail = saturatingAdd(tail, record.y);
                before = record;
            }
        }
        result = bytesOfUnits(saturatingAdd(headerUnits(named) + units + kBlockUnits, tail));
    } else if (descriptor.kind == kDescriptorBottom) {
        // A clone has its tail where the source has it, and a compacted copy behind the driver's part, which may be smaller.
        uint part = offset;
        if (push.property == kPropertyCompactedSize) {
            part = min(unitsOfBytes(driver) + 15u & ~15u, offset);
            Words(descriptorWords(push.descriptor)).w[6] = part; // which the copy reads
        }
        result = bytesOfUnits(bottomLevelSizeUnits(part + descriptor.units));
    } else if (descriptor.kind == kDescriptorPlain || descriptor.kind == kDescriptorBoxes) {
        result = bytesOfUnits(bottomLevelSizeUnits(ends ? min(unitsOfBytes(driver), offset) : unitsOfBytes(driver)));
    }
    value.w[0] = result.x;
    value.w[1] = result.y;
}
