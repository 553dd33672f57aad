// SPDX-License-Identifier: Apache-2.0
// Finds the triangle of a unit of work by its number.
#include "gpubake/bake_scratch.glsl"
#include "opacity.h"
#include "gpubake/bake_word.glsl"

struct Work {
    uint triangle;
    uint level;
    uint rank; // among the listed triangles of the level
    uint unit; // of the triangle
    bool any;
};

uint listedTriangle(uint place)
{
    return SCRATCH(bakeListStart(SCRATCH(kBakeTriangles)) + place);
}

Work workAt(uint number)
{
    uint before = 0u;
    for (uint level = 0u; level < kBakeLevels; ++level) {
        const uint count = SCRATCH(kBakeWork + level);
        const uint units = bakeUnits(level);
        const uint most = count * units;
        if (number < most) {
            const uint rank = number / units;
            return Work(listedTriangle(before + rank), level, rank, number % units, true);
        }
        number -= most;
        before += count;
    }
    return Work(0u, 0u, 0u, 0u, false);
}
