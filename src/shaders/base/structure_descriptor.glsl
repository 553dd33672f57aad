// Descriptors (core/records.h), and 64-bit addresses counted in units of 16 bytes. Needs records.h and memory.glsl.

struct Cell {
    uvec2 tail;
    uint kind;
    uint units;
    uint count;
    uint recordUnits;
    uvec2 extra; // words 6 and 7
};

layout(buffer_reference, std430, buffer_reference_align = 16) buffer Units { uvec4 at[]; };

Cell loadDescriptor(uvec2 address)
{
    Words c = Words(address);
    return Cell(uvec2(c.w[0], c.w[1]), c.w[2], c.w[3], c.w[4], c.w[5], uvec2(c.w[6], c.w[7]));
}

void storeDescriptor(uvec2 address, Cell descriptor)
{
    Words c = Words(address);
    c.w[0] = descriptor.tail.x;
    c.w[1] = descriptor.tail.y;
    c.w[2] = descriptor.kind;
    c.w[3] = descriptor.units;
    c.w[4] = descriptor.count;
    c.w[5] = descriptor.recordUnits;
    c.w[6] = descriptor.extra.x;
    c.w[7] = descriptor.extra.y;
}

// Words that the host changes while shaders read them, two at a time.
layout(buffer_reference, std430, buffer_reference_align = 4) readonly volatile buffer ChangingWords { uint w[]; };

// Two words of which the host writes both at once. They are read one after the other, until nothing has changed between
// them: no value that they had comes back.
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

// The descriptor of a key in the hash table (core/records.h) that the root table leads to; 0: there is none.
uvec2 findDescriptor(uvec2 root, uvec2 key)
{
    if ((key.x | key.y) == 0u || (key.x & key.y) == ~0u) // empty and deleted entries
        return uvec2(0);
    const uvec2 address = changingPair(root, kRootHashTable); // another one once the table has grown
    Words table = Words(address);
    const uint mask = table.w[0];
    uint bucket = hashReference(key.x, key.y) & mask;
    for (uint probes = 0u; probes <= mask; ++probes) {
        const uint at = kHashHeaderWords + bucket * kHashBucketWords;
        const uvec2 found = uvec2(table.w[at], table.w[at + 1u]);
        // Halves of two other keys, of which one took the place of the other, may look like this one.
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

// Units from `begin` to `address`; ~0 where address comes before it or far behind.
uint unitsBetween(uvec2 begin, uvec2 address)
{
    const uvec2 bytes = addressMinus(address, begin);
    return bytes.y >= 16u ? ~0u : bytes.x >> 4u | bytes.y << 28u;
}

// Whether `units` units from `at` on lie inside `all` units.
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
