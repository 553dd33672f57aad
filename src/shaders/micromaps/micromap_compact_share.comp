// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Compaction of a micromap: clears the tables; then, in rounds, assigns each triangle the owner of its data.
layout(local_size_x = 64) in;

#include "micromap_compact.glsl"

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

bool sameData(uint triangles, uint triangle, uint other)
{
    const Data a = dataOf(triangles, recordOf(triangle));
    const Data b = dataOf(triangles, recordOf(other));
    if (a.kind != b.kind || a.address == b.address)
        return a.kind == b.kind;
    if (a.units > kMaxComparedUnits)
        return false;
    const uint bytes = unitBytes(a);
    for (uint i = 0u; i < a.units; ++i) {
        if (loadUnit(addressPlus(a.address, i * 16u), bytes) != loadUnit(addressPlus(b.address, i * 16u), bytes))
            return false;
    }
    return true;
}

void clear(uint triangles)
{
    if (globalInvocation() < kCompactionTables)
        Words(push.scratch).w[globalInvocation()] = 0u;
    Words tables = Words(tablesAddress(triangles));
    const uint slots = shareTable(triangles, kShareRounds);
    for (uint i = globalInvocation(); i < slots; i += push.invocations)
        tables.w[i] = kNoTriangle;
}

void main()
{
    const uint triangles = compactedTriangles();
    if (push.pass == kCompactClear) {
        clear(triangles);
        return;
    }
    const uint round = push.pass - kCompactRound;
    Words last = Words(elementAddress(tablesAddress(triangles), shareTable(triangles, max(round, 1u) - 1u), 4u));
    Words next = Words(elementAddress(tablesAddress(triangles), shareTable(triangles, round), 4u));
    for (uint t = globalInvocation(); t < triangles; t += push.invocations) {
        Words words = wordsOf(triangles, t);
        if (words.w[2] != kNoTriangle)
            continue;
        const uint hash = words.w[0];
        if (round == 0u) {
            const uint mask = coarseMask(words.w[1]);
            words.w[1] = mask;
            if (describesAll(mask)) {
                words.w[2] = kNoData;
                continue;
            }
        } else {
            const uint owner = last.w[shareSlot(triangles, round - 1u, hash)];
            if (owner == t || (wordsOf(triangles, owner).w[0] == hash && sameData(triangles, t, owner))) {
                words.w[2] = owner;
                continue;
            }
        }
        if (round == kShareRounds)
            words.w[2] = t;
        else
            atomicMin(next.w[shareSlot(triangles, round, hash)], t);
    }
}
