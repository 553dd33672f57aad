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
    const Work work = workAt(INVOCATION);
    if (!work.any)
        return;
    const bool twoState = flagSet(kBakeTwoState);
    const uint items = itemsOf(work.level);
    uint data = 0u;
    for (uint i = 0u; i < items; ++i) {
        const uint states = wordOf(work.triangle, work.word * items + i);
        data |= twoState ? pack(states) << (16u * i) : states;
    }
    uint before = 0u; // words of lower levels
    for (uint level = 0u; level < work.level; ++level)
        before += SCRATCH(kBakeCapacity + level) * bakeDataWords(level, twoState);
    const uint at = before + work.rank * bakeDataWords(work.level, twoState) + work.word;
    Words(scratchAddress(kBakeData)).w[at] = data;
}
