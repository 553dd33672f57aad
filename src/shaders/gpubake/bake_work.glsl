// From the number of a word of data to its triangle.
#include "gpubake/bake_scratch.glsl"
#include "opacity.h"
#include "gpubake/bake_word.glsl"

struct Work {
    uint triangle;
    uint level;
    uint rank; // among the listed triangles of the level
    uint word; // of the triangle
    bool any;
};

uint listedTriangle(uint place)
{
    return SCRATCH(bakeListStart(SCRATCH(kBakeTriangles)) + place);
}

Work workAt(uint number)
{
    const bool twoState = flagSet(kBakeTwoState);
    uint before = 0u;
    for (uint level = 0u; level < kBakeLevels; ++level) {
        const uint count = SCRATCH(kBakeWork + level);
        const uint words = bakeDataWords(level, twoState);
        const uint most = count * words;
        if (number < most) {
            const uint rank = number / words;
            return Work(listedTriangle(before + rank), level, rank, number % words, true);
        }
        number -= most;
        before += count;
    }
    return Work(0u, 0u, 0u, 0u, false);
}

// 4-state words that a word of data is made of.
uint itemsOf(uint level)
{
    return flagSet(kBakeTwoState) && level > 2u ? 2u : 1u;
}
