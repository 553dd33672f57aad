// SPDX-License-Identifier: Apache-2.0
// Writes all records that fit, VkMicromapTriangleEXT, and the last of the result. Those that no triangle needs
// repeat the first of their level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpubake/bake_scratch.glsl"

layout(local_size_x = 64) in;

void main()
{
    const uint number = INVOCATION;
    if (number < 4u && !flagSet(kBakeSizesOnly))
        Words(scratchAddress(kBakeResult)).w[1u + kBakeLevels + number] = SCRATCH(kBakeSpecials + number);
    const bool twoState = flagSet(kBakeTwoState);
    uint rank = number;
    uint before = 0u; // words of lower levels
    for (uint level = 0u; level < kBakeLevels; ++level) {
        const uint capacity = SCRATCH(kBakeCapacity + level);
        const uint words = bakeDataWords(level, twoState);
        if (rank < capacity) {
            rank = rank < SCRATCH(kBakeWork + level) ? rank : 0u;
            const uint format = twoState ? 1u : 2u; // VkOpacityMicromapFormatEXT
            Words record = Words(elementAddress(scratchAddress(kBakeRecords), number, 8u));
            record.w[0] = (before + rank * words) * 4u;
            record.w[1] = level | format << 16u;
            return;
        }
        rank -= capacity;
        before += capacity * words;
    }
}
