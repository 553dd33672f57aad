// Finds out which states a triangle has, until it has two. With PROBE, looks at four words of each triangle only, which
// are all of those of a low level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_work.glsl"

layout(local_size_x = 64) in;

const uint kProbes = 4u;

void addItem(uint triangle, uint level, uint item)
{
    const uint at = triangleAt(triangle) + kBakeStates;
    const uint seen = atomicOr(SCRATCH(at), 0u);
    if ((seen & (seen - 1u)) != 0u)
        return;
    const uint states = wordOf(triangle, item);
    const uint count = 1u << (2u * min(level, 2u));
    const uint those = count == 16u ? 0x55555555u : 0x55555555u & ((1u << (2u * count)) - 1u);
    const uint low = states & those;
    const uint high = states >> 1u & those;
    uint occur = (~low & ~high & those) != 0u ? 1u << kStateTransparent : 0u;
    occur |= (low & ~high) != 0u ? 1u << kStateOpaque : 0u;
    occur |= (~low & high) != 0u ? 1u << kStateUnknownTransparent : 0u;
    occur |= (low & high) != 0u ? 1u << kStateUnknownOpaque : 0u;
    const uint ignored = atomicOr(SCRATCH(at), occur);
}

#ifdef PROBE
void main()
{
    const uint number = INVOCATION;
    uint listed = 0u;
    for (uint level = 0u; level < kBakeLevels; ++level)
        listed += SCRATCH(kBakeWork + level);
    if (number / kProbes >= listed)
        return;
    const uint triangle = listedTriangle(number / kProbes);
    const uint level = SCRATCH(triangleAt(triangle) + kBakeInfo) & kBakeInfoLevel;
    const uint items = level > 2u ? 1u << (2u * level - 4u) : 1u;
    const uint probe = number % kProbes;
    if (items >= kProbes)
        addItem(triangle, level, probe * ((items - 1u) / (kProbes - 1u)));
    else if (probe == 0u)
        addItem(triangle, level, 0u);
}
#else
void main()
{
    const Work work = workAt(INVOCATION);
    if (!work.any || work.level <= 3u) // those have been looked at
        return;
    const uint items = itemsOf(work.level);
    for (uint i = 0u; i < items; ++i)
        addItem(work.triangle, work.level, work.word * items + i);
}
#endif
