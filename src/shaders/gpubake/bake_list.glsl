// SPDX-License-Identifier: Apache-2.0
// Lists of triangles, ordered by level: first (push.first is 0) of those whose states are not known to be one, to find
// out; then (1) of those that get data.
#include "gpubake/bake_scratch.glsl"
#include "opacity.h"

// Above all levels: not on the list.
const uint kNotListed = 15u;

uint statesOf(uint triangle)
{
    const uint states = SCRATCH(triangleAt(triangle) + kBakeStates);
    // Nobody looked: there were too many.
    return states != 0u ? states : 1u << kStateUnknownOpaque;
}

// The level of a triangle that is on the list.
uint listedLevel(uint triangle)
{
    if (triangle >= SCRATCH(kBakeTriangles))
        return kNotListed;
    const uint info = SCRATCH(triangleAt(triangle) + kBakeInfo);
    const uint states = statesOf(triangle);
    const bool listed = push.first == 0u ? (info & kBakeInfoResolved) == 0u
                                         : flagSet(kBakeNoSpecial) || (states & (states - 1u)) != 0u;
    return listed ? info & kBakeInfoLevel : kNotListed;
}
