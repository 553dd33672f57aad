// SPDX-License-Identifier: Apache-2.0
// A triangle's data in a micromap build: its copy; its analysis, which is the state of each sub-triangle of level 2, and a hash.
// Needs micromap_source.glsl.

layout(buffer_reference, std430, buffer_reference_align = 16) buffer Quads { uvec4 at[]; };

// A data unit of the input at an address that is a multiple of 4; `bytes` is 8 or 16.
uvec4 loadAlignedUnit(uvec2 address, uint bytes)
{
    Words words = Words(address);
    uvec4 v = uvec4(words.w[0], words.w[1], 0u, 0u);
    if (bytes == 16u)
        v.zw = uvec2(words.w[2], words.w[3]);
    return v;
}

// Loads a unit at any other address. Reads only words that hold one of the bytes.
uvec4 loadShiftedUnit(uvec2 address, uint bytes)
{
    const uint shift = (address.x & 3u) * 8u;
    const uvec2 aligned = uvec2(address.x & ~3u, address.y);
    const uvec4 v = loadAlignedUnit(aligned, bytes);
    const uint last = Words(aligned).w[bytes >> 2u];
    const uvec4 next = bytes == 16u ? uvec4(v.yzw, last) : uvec4(v.y, last, 0u, 0u);
    const uvec4 both = v >> shift | next << (32u - shift);
    return bytes == 16u ? both : uvec4(both.xy, 0u, 0u);
}

uvec4 loadUnit(uvec2 address, uint bytes)
{
    return (address.x & 3u) == 0u ? loadAlignedUnit(address, bytes) : loadShiftedUnit(address, bytes);
}

// The hash of a triangle is the sum of this over its units, so that several invocations can share the work. It depends on
// the order of the units.
uint hashUnit(uvec4 v, uint unit)
{
    uint h = unit * 0x9e3779b1u + 0x7f4a7c15u;
    h = (h ^ v.x) * 0x85ebca6bu;
    h = ((h ^ (h >> 15u)) ^ v.y) * 0xc2b2ae35u;
    h = ((h ^ (h >> 13u)) ^ v.z) * 0x27d4eb2fu;
    h = ((h ^ (h >> 16u)) ^ v.w) * 0x165667b1u;
    return h ^ (h >> 15u);
}

// The sixteen states of level 2 of a triangle of level 0 to 2, two bits each.
uint coarseStates(Source s)
{
    const uint bits = s.bitsPerState << (2u * s.level);
    uint x = loadBytes(addressPlus(push.data, s.dataOffset), bits + 7u >> 3u);
    x = bits >= 32u ? x : x & ((1u << bits) - 1u);
    if (s.bitsPerState == 1u) {
        x = (x | x << 8u) & 0x00ff00ffu;
        x = (x | x << 4u) & 0x0f0f0f0fu;
        x = (x | x << 2u) & 0x33333333u;
        x = (x | x << 1u) & 0x55555555u;
    }
    if (s.level == 0u)
        return x * 0x55555555u;
    if (s.level == 1u)
        return ((x & 3u) | (x >> 2u & 3u) << 8u | (x >> 4u & 3u) << 16u | (x >> 6u & 3u) << 24u) * 0x55u;
    return x;
}

// The record of a triangle without data units.
uvec2 recordWithoutData(Source s)
{
    return s.valid ? uvec2(kKindInline, coarseStates(s)) : uvec2(kRejected, ~0u);
}

// A word's groups of subBits (4, 8 or 16) bits: which of them have a set bit, as every second bit.
uint groupsWithBits(uint x, uint subBits)
{
    x |= x >> 1u;
    x |= x >> 2u;
    if (subBits == 4u) {
        x &= 0x11111111u;
        x = (x | x >> 2u) & 0x05050505u;
        x = (x | x >> 4u) & 0x00550055u;
        return (x | x >> 8u) & 0x5555u;
    }
    x |= x >> 4u;
    if (subBits == 8u) {
        x &= 0x01010101u;
        x = (x | x >> 6u) & 0x00050005u;
        return (x | x >> 12u) & 0x55u;
    }
    x |= x >> 8u;
    return (x & 1u) | (x >> 14u & 4u);
}

// The coarse mask (0 transparent, 1 opaque, 2 look at the data) of gathered bits, which are two for each sub-triangle of
// level 2: 1: not entirely transparent, 2: not entirely opaque.
uint coarseMask(uint gathered)
{
    const uint a = gathered & 0x55555555u;
    const uint b = gathered >> 1u & 0x55555555u;
    return (a & ~b) | (a & b) << 1u;
}

bool describesAll(uint mask)
{
    return (mask & 0xaaaaaaaau) == 0u;
}

struct Walk {
    uint gathered;
    uint hash;
};

// The gathered bits of a unit that holds a part of a sub-triangle of level 2, or several.
uint gatherUnit(uvec4 v, uvec4 w, uint i, uint subBits, uint bytes)
{
    if (subBits == 64u) {
        const uint low = ((v.x | v.y) != 0u ? 1u : 0u) | ((w.x | w.y) != 0u ? 2u : 0u);
        const uint high = ((v.z | v.w) != 0u ? 4u : 0u) | ((w.z | w.w) != 0u ? 8u : 0u);
        return (low | high) << (4u * i);
    }
    if (subBits == 32u) {
        const uvec4 a = mix(uvec4(0u), uvec4(1u, 4u, 16u, 64u), notEqual(v, uvec4(0u)));
        const uvec4 b = mix(uvec4(0u), uvec4(2u, 8u, 32u, 128u), notEqual(w, uvec4(0u)));
        const uvec4 c = a | b;
        return (c.x | c.y | c.z | c.w) << (8u * i);
    }
    // 2, 4 or 8 sub-triangles a word; 64 bits in all at level 3 of the 2-state format.
    const uint shift = 64u / subBits;
    uint gathered = 0u;
    for (uint k = 0u; k < bytes >> 2u; ++k)
        gathered |= (groupsWithBits(v[k], subBits) | groupsWithBits(w[k], subBits) << 1u) << (shift * (4u * i + k));
    return gathered;
}

// Reads units first .. last - 1 of a triangle.
Walk walkUnits(Source s, uint first, uint last)
{
    Walk walk;
    walk.gathered = 0u;
    walk.hash = 0u;
    const uint opaque = s.bitsPerState == 1u ? ~0u : 0x55555555u;
    const uint subBits = s.bitsPerState << (2u * (s.level - kCoarseLevel));
    const uint bytes = min(sourceBytes(s.level, s.bitsPerState), 16u);
    const uvec2 source = addressPlus(push.data, s.dataOffset);
    if (subBits >= 128u && (source.x & 3u) == 0u) {
        // Fast path: most of the data of large micromaps.
        const uint subShift = findMSB(subBits) - 7u;
        for (uint i = first; i < last; ++i) {
            const uvec4 v = loadAlignedUnit(addressPlus(source, i * 16u), 16u);
            walk.hash += hashUnit(v, i);
            const uvec4 w = v ^ opaque;
            const uint code = min(v.x | v.y | v.z | v.w, 1u) | min(w.x | w.y | w.z | w.w, 1u) << 1u;
            walk.gathered |= code << (2u * (i >> subShift));
        }
        return walk;
    }
    for (uint i = first; i < last; ++i) {
        const uvec4 v = loadUnit(addressPlus(source, i * 16u), bytes);
        walk.hash += hashUnit(v, i);
        const uvec4 w = v ^ opaque;
        if (subBits >= 128u) {
            const uint code = min(v.x | v.y | v.z | v.w, 1u) | min(w.x | w.y | w.z | w.w, 1u) << 1u;
            walk.gathered |= code << (2u * (i / (subBits >> 7u)));
        } else {
            walk.gathered |= gatherUnit(v, w, i, subBits, bytes);
        }
    }
    return walk;
}

// Copies every `step`-th of the units first .. last - 1 of a triangle to `target`, the address of its first unit.
void copyUnits(Source s, uint first, uint last, uint step, uvec2 target)
{
    const uint bytes = min(sourceBytes(s.level, s.bitsPerState), 16u);
    const uvec2 source = addressPlus(push.data, s.dataOffset);
    Quads to = Quads(target);
    for (uint i = first; i < last; i += step)
        to.at[i] = loadUnit(addressPlus(source, i * 16u), bytes);
}
