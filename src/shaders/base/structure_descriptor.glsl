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

// The pair of the root that leads to the hash table, and changes when the table grows. The host writes it at once, but the
// shader may read one word after the other, and repeats this until it reads the same pair twice: the pair never returns to an
// earlier value.
uvec2 hashTable(uvec2 root)
{
    uvec2 pair = changingPairAt(root, kRootHashTable / 2u);
    uvec2 again = changingPairAt(root, kRootHashTable / 2u);
    while (again != pair) {
        pair = again;
        again = changingPairAt(root, kRootHashTable / 2u);
    }
    return pair;
}

// Address of the descriptor of a key in the hash table (core/records.h); 0: not found. The table always has an empty bucket.
uvec2 findDescriptor(uvec2 table, uvec2 key)
{
    const uint mask = ~(~0u << (table.x & kBucketsLog2Mask));
    const uvec2 buckets = uvec2(table.x & ~kBucketsLog2Mask, table.y);
    uint bucket = hashReference(key.x, key.y);
    uvec2 found;
    uvec2 descriptor;
    // Read twice: the halves of two other keys, of which one has replaced the other, may look like this key.
    uvec2 again;
    do {
        const uint at = (bucket & mask) * (kHashBucketWords / 2u);
        found = changingPairAt(buckets, at);
        descriptor = changingPairAt(buckets, at + 1u);
        again = changingPairAt(buckets, at);
        ++bucket;
    } while ((found != key || again != key) && (found.x | found.y) != 0u);
    const bool isKey = (found.x | found.y) != 0u && (found.x & found.y) != ~0u; // of no empty or deleted bucket
    return isKey ? descriptor : uvec2(0);
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
