// SPDX-License-Identifier: Apache-2.0
// Descriptors (core/records.h), and 64-bit addresses counted in units of 16 bytes. Needs records.h and memory.glsl.

struct Descriptor {
    uvec2 tail;
    uint kind;
    uint units;
    uint count;
    uint recordUnits;
    uvec2 extra; // words 6 and 7
};

layout(buffer_reference, std430, buffer_reference_align = 16) buffer Units { uvec4 at[]; };

// The low bits of the address of a descriptor are its generation.
uint generationOf(uvec2 address)
{
    return address.x & kDescriptorGenerations - 1u;
}

uvec2 descriptorWords(uvec2 address)
{
    return uvec2(address.x - generationOf(address), address.y);
}

Descriptor loadDescriptor(uvec2 address)
{
    Words c = Words(descriptorWords(address));
    if (c.w[2] >> kDescriptorGenerationShift != generationOf(address))
        return Descriptor(uvec2(0), kDescriptorUnbuilt, 0u, 0u, 0u, uvec2(0));
    return Descriptor(uvec2(c.w[0], c.w[1]), c.w[2] & kDescriptorKindMask, c.w[3], c.w[4], c.w[5], uvec2(c.w[6], c.w[7]));
}

// Coherent, since the host may read a descriptor before the work is complete: sign() in structure_restore.comp.
void storeDescriptor(uvec2 address, Descriptor descriptor)
{
    CoherentWords c = CoherentWords(descriptorWords(address));
    c.w[0] = descriptor.tail.x;
    c.w[1] = descriptor.tail.y;
    c.w[2] = descriptor.kind | generationOf(address) << kDescriptorGenerationShift;
    c.w[3] = descriptor.units;
    c.w[4] = descriptor.count;
    c.w[5] = descriptor.recordUnits;
    c.w[6] = descriptor.extra.x;
    c.w[7] = descriptor.extra.y;
}

// Words that the host may change, two at a time, while shaders read them.
layout(buffer_reference, std430, buffer_reference_align = 4) readonly volatile buffer ChangingWords { uint w[]; };

// Two words that the host writes at once. The shader reads one after the other, and repeats this until it reads the
// same pair twice: the pair never returns to an earlier value.
uvec2 changingPair(uvec2 words, uint at)
{
    ChangingWords c = ChangingWords(words);
    uvec2 pair = uvec2(c.w[at], c.w[at + 1u]);
    for (;;) {
        const uvec2 again = uvec2(c.w[at], c.w[at + 1u]);
        if (again == pair)
            return pair;
        pair = again;
    }
}

// Address of the descriptor of a key in the hash table (core/records.h) that the root table leads to; 0: not found.
uvec2 findDescriptor(uvec2 root, uvec2 key)
{
    if ((key.x | key.y) == 0u || (key.x & key.y) == ~0u) // empty and deleted entries
        return uvec2(0);
    const uvec2 address = changingPair(root, kRootHashTable); // changes when the table grows
    Words table = Words(address);
    const uint mask = table.w[0];
    uint bucket = hashReference(key.x, key.y) & mask;
    for (uint probes = 0u; probes <= mask; ++probes) {
        const uint at = kHashHeaderWords + bucket * kHashBucketWords;
        const uvec2 found = uvec2(table.w[at], table.w[at + 1u]);
        // The halves of two other keys, of which one has replaced the other, may look like this key.
        if (found == key && changingPair(address, at) == key)
            return uvec2(table.w[at + 2u], table.w[at + 3u]);
        if ((found.x | found.y) == 0u)
            break;
        bucket = (bucket + 1u) & mask;
    }
    return uvec2(0);
}

uvec2 addressMinus(uvec2 a, uvec2 b)
{
    uint borrow;
    const uint low = usubBorrow(a.x, b.x, borrow);
    return uvec2(low, a.y - b.y - borrow);
}

// address + units * 16
uvec2 unitAddress(uvec2 address, uint units)
{
    return elementAddress(address, units, 16u);
}

// A number of bytes in units of 16, rounded up; ~0 where that does not fit.
uint unitsOfBytes(uvec2 bytes)
{
    uint carry;
    const uint low = uaddCarry(bytes.x, 15u, carry);
    const uint high = bytes.y + carry;
    return high >= 16u ? ~0u : low >> 4u | high << 28u;
}

uvec2 bytesOfUnits(uint units)
{
    return uvec2(units << 4u, units >> 28u);
}

// Units from `begin` to `address`; ~0 where `address` is below it, or too far above.
uint unitsBetween(uvec2 begin, uvec2 address)
{
    const uvec2 bytes = addressMinus(address, begin);
    return bytes.y >= 16u ? ~0u : bytes.x >> 4u | bytes.y << 28u;
}

// Returns whether `units` units from `at` on lie inside `all` units.
bool fits(uint at, uint units, uint all)
{
    return at <= all && units <= all - at;
}

void gpuError(uvec2 root, uint number)
{
    Words header = Words(root);
    Words counters = Words(uvec2(header.w[kRootGpuErrors], header.w[kRootGpuErrors + 1u]));
    atomicAdd(counters.w[number], 1u);
    memoryBarrierBuffer();
    atomicAdd(counters.w[kGpuErrorTotal], 1u);
}
