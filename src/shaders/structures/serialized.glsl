// SPDX-License-Identifier: Apache-2.0
// Serialized acceleration structures (core/records.h). Needs structure_descriptor.glsl.

const uint kSerializedHeaderUnits = 4u; // the header of a BLAS without blocks: 56 bytes, padded

// Words of a block in the header: "serialized-as-header" of the specification.
const uint kBlockFormat = 0xffffffffu; // word 13 of the header, where word 12 is the number of blocks
const uint kBlockType = 14u;
const uint kBlockAddressCount = 16u; // and 17
const uint kBlockAddresses = 18u;

// Units of the header of a BLAS that names so many micromaps; all are in one block.
uint headerUnits(uint named)
{
    return named == 0u ? kSerializedHeaderUnits : (kBlockAddresses * 4u + named * 8u + 15u) / 16u;
}

// The geometry records and micromap names in the tail of a descriptor, for loops over them.
Units recordsOf(Descriptor descriptor, uvec2 other)
{
    return Units(readable(descriptor.tail, descriptorWords(other)));
}

// The name of geometry g's micromap; 0: it has no name.
uvec4 micromapName(Units records, Descriptor descriptor, uint g)
{
    return records.at[descriptor.count + g];
}

bool isNamed(uvec4 name)
{
    return (name.x | name.y) != 0u;
}

// The plan: words at the beginning of staging memory, by which one pass of (de)serialization informs the next ones.
const uint kPlanUnits = 16u; // keeps what follows aligned to 256 bytes
const uint kPlanOk = 0u;
const uint kPlanDriverUnits = 1u;
const uint kPlanTailUnits = 2u;
const uint kPlanChecksum = 3u;
const uint kPlanHeaderUnits = 4u;
const uint kPlanNamed = 5u; // micromaps in the header's block
const uint kPlanKind = 6u;  // kDescriptorBottom, kDescriptorTop or kDescriptorMicromap: what the data holds
const uint kPlanDescriptor = 8u; // a descriptor that describes the instances of a serialized TLAS

uint saturatingAdd(uint a, uint b)
{
    return a > ~b ? ~0u : a + b;
}

// Units of the driver's serialized data, by the total in its header. For an empty structure lavapipe writes 0, and copies all
// of it.
uint driverUnitsOf(uvec2 total, uint structureUnits)
{
    const uint units = unitsOfBytes(total);
    return units < kSerializedHeaderUnits ? kSerializedHeaderUnits + structureUnits : units;
}

// The checksum is the sum of this over all units, in any order.
uint checkOf(uvec4 value, uint index)
{
    uint h = index * 0x9e3779b1u;
    for (uint i = 0u; i < 4u; ++i)
        h = (h ^ value[i]) * 0x85ebca6bu + 0x1b873593u;
    return h ^ (h >> 15u);
}
