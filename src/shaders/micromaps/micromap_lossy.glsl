// SPDX-License-Identifier: Apache-2.0
// Lossy micromap builds (core/lossy.h): triangles are coarsened into scratch memory, from which the ordinary build then
// reads. Needs micromap_source.glsl; in these passes push.micromap is the address of the coarsened micromap:
//   entries    3 words per triangle: a VkMicromapTriangleEXT with offsets from here, and the states of up to level 2
//   units      coarsened data, in any order: the ordinary build places it
//   parts      4 words for each entry of the list of parts: a Measured, packed

const uint kPartLevels = 6u; // a part of 4-state data is a sub-triangle of that many levels

// Codes of the nodes of the curve's tree. Bit 0: not all transparent, bit 1: not all opaque.
const uint kCodeTransparent = 2u;
const uint kCodeOpaque = 1u;
const uint kCodeMixed = 3u;

Words entryOf(uint triangle)
{
    return Words(elementAddress(push.micromap, triangle, kLossyEntryBytes));
}

// Bytes of the entries, and of the units behind them, padded to 16: less than 4 GiB, as offsets reach no further.
uint entryBytes()
{
    return (push.triangleCount * kLossyEntryBytes + 15u) & ~15u;
}

Words partOf(uint i)
{
    const uvec2 parts = elementAddress(addressPlus(push.micromap, entryBytes()), push.capacityUnits, kDataUnitBytes);
    return Words(elementAddress(parts, i, kLossyPartBytes));
}

// Word i of a triangle's data, which may begin at any byte.
uint sourceWord(uvec2 data, uint i)
{
    return (data.x & 3u) == 0u ? Words(data).w[i] : loadBytes(addressPlus(data, i * 4u), 4u);
}

uint codeOf(uint states, uint opaque)
{
    return min(states, 1u) | min(states ^ opaque, 1u) << 1u;
}

// The state of a node of n micro-triangles, `low` of them opaque or unknown-opaque.
uint stateOf(uint code, uint low, uint n)
{
    if (code != kCodeMixed)
        return code == kCodeOpaque ? kStateOpaque : kStateTransparent;
    return 2u * low >= n ? kStateUnknownOpaque : kStateUnknownTransparent;
}

// Counts of known nodes on the four levels above a row of nodes, which are visited in the curve's order.
struct Climb {
    uvec4 known;
    uvec4 open; // codes of the nodes that are not complete
};

void climb(inout Climb c, uint i, uint code)
{
    const uvec4 last = uvec4(3u, 15u, 63u, 255u);
    c.open |= code;
    const uvec4 ends = mix(uvec4(0u), uvec4(1u), equal(i & last, last));
    c.known += ends & mix(uvec4(0u), uvec4(1u), notEqual(c.open, uvec4(kCodeMixed)));
    c.open &= ends - 1u;
}

// Measurements of some words of 4-state data.
struct Measured {
    uint known[6]; // known nodes, by the number of levels that they are above the micro-triangles
    uint low;      // micro-triangles that are opaque or unknown-opaque
    uint code;     // of all of them together
};

uint bytesWithBits(uint x)
{
    x |= x >> 1u;
    x |= x >> 2u;
    return (x | x >> 4u) & 0x01010101u;
}

Measured measure(uvec2 data, uint first, uint words)
{
    uvec3 known = uvec3(0u);
    uint low = 0u;
    uint code = 0u;
    Climb above = Climb(uvec4(0u), uvec4(0u));
    for (uint i = 0u; i < words; ++i) {
        const uint x = sourceWord(data, first + i);
        const uint own = codeOf(x, 0x55555555u);
        known.x += 16u - bitCount(x & 0xaaaaaaaau);
        known.y += 4u - bitCount(bytesWithBits(x) & bytesWithBits(x ^ 0x55555555u));
        known.z += own != kCodeMixed ? 1u : 0u;
        low += bitCount(x & 0x55555555u);
        code |= own;
        climb(above, i, own);
    }
    return Measured(uint[6](known.x, known.y, known.z, above.known.x, above.known.y, above.known.z), low, code);
}

// The cost of a level that is k levels lower: the number of its states, and the price of those that become unknown.
// `micros`, `nodes`: how many of the triangle's micro-triangles, and of the micro-triangles of that level, are known.
uint costOf(uint level, uint k, uint micros, uint nodes)
{
    const uint states = level - k > kCoarseLevel ? 1u << (2u * (level - k)) : 0u;
    return states + ((micros - (nodes << (2u * k))) << kLossyPriceLog2);
}

// The state of node `node` of the level k > 0 levels above the micro-triangles.
uint nodeState(uvec2 data, uint node, uint k)
{
    if (k == 1u) {
        const uint x = sourceWord(data, node >> 2u) >> (8u * (node & 3u)) & 0xffu;
        return stateOf(codeOf(x, 0x55u), bitCount(x & 0x55u), 4u);
    }
    const uint words = 1u << (2u * k - 4u);
    uint low = 0u;
    uint code = 0u;
    for (uint i = 0u; i < words; ++i) {
        const uint x = sourceWord(data, node * words + i);
        code |= codeOf(x, 0x55555555u);
        low += bitCount(x & 0x55555555u);
    }
    return stateOf(code, low, 16u * words);
}

// Word i of a triangle's data, k levels lower.
uint coarsenedWord(uvec2 data, uint i, uint k)
{
    if (k == 0u)
        return sourceWord(data, i);
    uint states = 0u;
    for (uint n = 0u; n < 16u; ++n)
        states |= nodeState(data, 16u * i + n, k) << (2u * n);
    return states;
}

// Writes a triangle's entry and allocates units for its data. The entry of an invalid triangle has no format: the ordinary
// build rejects it.
bool writeEntry(uint triangle, Source s, uint level)
{
    Source lower = s;
    lower.level = level;
    const uint units = unitsOf(lower);
    uint offset = triangle * kLossyEntryBytes + 8u;
    if (units > 0u) {
        const uint first = atomicAdd(Words(push.scratch).w[kScratchStaged], units);
        if (first > push.capacityUnits || units > push.capacityUnits - first)
            s.valid = false;
        offset = entryBytes() + first * kDataUnitBytes;
    }
    Words entry = entryOf(triangle);
    entry.w[0] = offset;
    entry.w[1] = s.valid ? level | s.bitsPerState << 16u : 0u;
    return s.valid;
}
