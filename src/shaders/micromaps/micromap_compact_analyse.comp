// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Compaction of a micromap: hash and gathered bits of each triangle with data. Triangles with many units go on the list of
// parts, whose pass is the next one.
layout(local_size_x = 64) in;

#include "micromap_compact.glsl"

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
Walk walkUnits(Data d, uint first, uint last)
{
    Walk walk;
    walk.gathered = 0u;
    walk.hash = 0u;
    const uint opaque = d.bitsPerState == 1u ? ~0u : 0x55555555u;
    const uint subBits = d.bitsPerState << (2u * (d.level - kCoarseLevel));
    const uint bytes = unitBytes(d);
    if (subBits >= 128u && (d.address.x & 3u) == 0u) {
        // Fast path: most of the data of large micromaps.
        const uint subShift = findMSB(subBits) - 7u;
        for (uint i = first; i < last; ++i) {
            const uvec4 v = loadAlignedUnit(addressPlus(d.address, i * 16u), 16u);
            walk.hash += hashUnit(v.x, v.y, v.z, v.w, i);
            const uvec4 w = v ^ opaque;
            const uint code = min(v.x | v.y | v.z | v.w, 1u) | min(w.x | w.y | w.z | w.w, 1u) << 1u;
            walk.gathered |= code << (2u * (i >> subShift));
        }
        return walk;
    }
    for (uint i = first; i < last; ++i) {
        const uvec4 v = loadUnit(addressPlus(d.address, i * 16u), bytes);
        walk.hash += hashUnit(v.x, v.y, v.z, v.w, i);
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

void main()
{
    const uint triangles = compactedTriangles();
    const uint count = itemCount(triangles);
    for (uint i = globalInvocation(); i < count; i += push.invocations) {
        const Item item = itemAt(triangles, i);
        if (item.triangle == kNoTriangle)
            continue;
        // The other passes look at the data of these only, and need not check again where it is.
        const uvec2 record = trustedRecord(recordOf(item.triangle), Words(push.source).w[kMicromapHeaderUnits]);
        const Data d = dataOf(triangles, record);
        const bool part = ofParts();
        const bool listed = !part && listParts(triangles, item.triangle, d.units);
        const Walk walk = walkUnits(d, item.first, part ? item.first + kPartUnits : listed ? 0u : d.units);
        Words words = wordsOf(triangles, item.triangle);
        if (part) {
            atomicAdd(words.w[0], walk.hash);
            atomicOr(words.w[1], walk.gathered);
            continue;
        }
        const uint location = d.units > kMaxComparedUnits ? mixBits(d.location) : 0u;
        words.w[0] = walk.hash + mixBits(d.kind) + location;
        words.w[1] = d.units == 0u ? record.y : walk.gathered;
        words.w[2] = d.units == 0u ? kNoData : kNoTriangle;
    }
}
