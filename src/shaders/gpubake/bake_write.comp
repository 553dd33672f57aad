// SPDX-License-Identifier: Apache-2.0
// Writes the data of all triangles that get some.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_work.glsl"

layout(local_size_x = 64) in;

// The low bit of each pair.
uint pack(uint states)
{
    uint r = states & 0x55555555u;
    r = (r | r >> 1u) & 0x33333333u;
    r = (r | r >> 2u) & 0x0f0f0f0fu;
    r = (r | r >> 4u) & 0x00ff00ffu;
    return (r | r >> 8u) & 0xffffu;
}

void main()
{
    loadAlpha();
    const Work work = workAt(INVOCATION);
    if (!work.any)
        return;
    const bool twoState = flagSet(kBakeTwoState);
    const Subject subject = subjectOf(work.triangle);
    const uint items = itemsOf(work.level);
    uint before = 0u; // words of lower levels
    for (uint level = 0u; level < work.level; ++level)
        before += SCRATCH(kBakeCapacity + level) * bakeDataWords(level, twoState);
    const uint perWord = twoState && items > 1u ? 2u : 1u;
    const uint at = before + work.rank * bakeDataWords(work.level, twoState) + work.unit * (items / perWord);
    uint state;
    uvec4 states;
    if (uniformUnit(subject, work.unit, state))
        states = uvec4(filled(state, work.level));
    else
        states = statesOf(subject, work.unit * items, items);
    uint data = 0u;
    for (uint i = 0u; i < items; ++i) {
        data |= twoState ? pack(states[i]) << (16u * (i % perWord)) : states[i];
        if (i % perWord == perWord - 1u) {
            Words(scratchAddress(kBakeData)).w[at + i / perWord] = data;
            data = 0u;
        }
    }
}
