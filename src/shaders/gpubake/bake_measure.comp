// SPDX-License-Identifier: Apache-2.0
// Finds out which states a triangle has, until it has two. With PROBE, looks at four words of each triangle only, which
// are all of those of a low level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_work.glsl"

layout(local_size_x = 64) in;

const uint kProbes = 4u;

bool hasTwo(uint states)
{
    return (states & (states - 1u)) != 0u;
}

// The set of states that occur among 16 or fewer, as bits.
uint occurring(uint states, uint level)
{
    const uint those = filled(1u, level);
    const uint low = states & those;
    const uint high = states >> 1u & those;
    uint occur = (~low & ~high & those) != 0u ? 1u << kStateTransparent : 0u;
    occur |= (low & ~high) != 0u ? 1u << kStateOpaque : 0u;
    occur |= (~low & high) != 0u ? 1u << kStateUnknownTransparent : 0u;
    return occur | ((low & high) != 0u ? 1u << kStateUnknownOpaque : 0u);
}

#ifdef PROBE
void main()
{
    loadAlpha();
    const uint number = INVOCATION;
    uint listed = 0u;
    for (uint level = 0u; level < kBakeLevels; ++level)
        listed += SCRATCH(kBakeWork + level);
    if (number / kProbes >= listed)
        return;
    const uint triangle = listedTriangle(number / kProbes);
    const Subject subject = subjectOf(triangle);
    const uint items = subject.level > 2u ? 1u << (2u * subject.level - 4u) : 1u;
    const uint probe = number % kProbes;
    if (items == 1u && probe != 0u)
        return;
    const uint item = items > 1u ? probe * ((items - 1u) / (kProbes - 1u)) : 0u;
    const uint ignored = atomicOr(SCRATCH(triangleAt(triangle) + kBakeStates),
                                  occurring(statesOf(subject, item, 1u).x, subject.level));
}
#else
void main()
{
    loadAlpha();
    const Work work = workAt(INVOCATION);
    if (!work.any || work.level <= 3u) // these are decided already
        return;
    const uint at = triangleAt(work.triangle) + kBakeStates;
    uint seen = atomicOr(SCRATCH(at), 0u);
    if (hasTwo(seen))
        return;
    const Subject subject = subjectOf(work.triangle);
    uint state;
    if (uniformUnit(subject, work.unit, state)) {
        seen |= 1u << state;
    } else {
        const uvec4 states = statesOf(subject, work.unit * 4u, 4u); // of a level above 3
        for (uint i = 0u; i < 4u; ++i)
            seen |= occurring(states[i], work.level);
    }
    const uint ignored = atomicOr(SCRATCH(at), seen);
}
#endif
