// SPDX-License-Identifier: Apache-2.0
// The states of 16 neighbouring micro-triangles on the curve, as bits of 4-state data; of all, if there are fewer.
#include "gpubake/bake_mask.glsl"
#include "gpubake/bake_texels.glsl"
#include "gpubake/bake_placement.glsl"
#include "gpubake/bake_piece.glsl"
#include "gpubake/bake_walk.glsl"
#include "gpubake/bake_guess.glsl"

// A sub-triangle at a lattice point, and whether the curve runs through it from the point (i + size, j).
struct Node {
    int i;
    int j;
    int size;
    bool swapped;
};

// The curve enters a triangle at one corner, turns in the middle, and leaves it at vertex 2's.
Node childOf(Node node, uint child)
{
    const int half_ = node.size / 2;
    if (child == 1u)
        return Node(node.i + half_, node.j + half_, -half_, !node.swapped);
    if (child == 3u)
        return Node(node.i, node.j + half_, half_, !node.swapped);
    return Node((child == 2u) != node.swapped ? node.i + half_ : node.i, node.j, half_, node.swapped);
}

// The state for flags; `guess` is used where both outcomes are possible.
uint stateOf(uint flags, bool guess)
{
    uint state = guess ? kStateUnknownOpaque : kStateUnknownTransparent;
    if (flags == kMayNotBeTransparent)
        state = kStateOpaque;
    else if (flags == kMayNotBeOpaque)
        state = kStateTransparent;
    const uint set = alphaFlags;
    if ((set & kBakeSwap) != 0u)
        state ^= 1u;
    if ((set & kBakeTwoState) != 0u && state >= kStateUnknownTransparent) {
        state &= 1u;
        if ((set & kBakeUnknownIsOpaque) != 0u)
            state = kStateOpaque;
        else if ((set & kBakeUnknownIsTransparent) != 0u)
            state = kStateTransparent;
    }
    return state;
}

// The shape of a part of a node's shape.
Shape shapeIn(Shape s, Node node, Node part)
{
    const float scale = 1.0 / float(node.size);
    return partOf(s, float(part.i - node.i) * scale, float(part.j - node.j) * scale, float(part.size) * scale);
}

// The node of 4^below micro-triangles that is `number` on the curve.
Node nodeAt(uint level, uint below, uint number)
{
    Node node = Node(0, 0, 1 << level, false);
    for (uint d = level - below; d-- > 0u;)
        node = childOf(node, (number >> (2u * d)) & 3u);
    return node;
}

// A triangle that is being classified.
struct Subject {
    Uvs uvs;
    uint level;
    bool resolved;
    uint state; // where it is resolved
    Mip mip;    // level 0
    Placement place;
};

Subject subjectOf(uint triangle)
{
    const uint info = SCRATCH(triangleAt(triangle) + kBakeInfo);
    Subject s;
    s.level = info & kBakeInfoLevel;
    s.resolved = (info & kBakeInfoResolved) != 0u;
    s.state = s.resolved ? uint(findLSB(SCRATCH(triangleAt(triangle) + kBakeStates))) : 0u;
    s.uvs = loadUvs(triangle);
    s.mip = makeMip(0u);
    // Otherwise coordinates may be of any size and have no location.
    if (!s.resolved)
        s.place = place(s.uvs, s.mip, s.level);
    return s;
}

// The flags of a node, by the blocks of cells around it.
uint nodeFlags(Subject subject, Node node)
{
    uint flags = 0u;
    for (uint number = 0u; number < SCRATCH(kBakeMips) && flags != kMayBeBoth; ++number) {
        Mip mip = subject.mip;
        Placement p = subject.place;
        if (number > 0u) {
            mip = makeMip(number);
            p = place(subject.uvs, mip, subject.level);
        }
        const ivec4 box = cellsAround(shapeAt(p, node.i, node.j, node.size));
        flags |= boxFlags(mip, box.xy, box.zw);
    }
    return flags;
}

// A state for all of an item's micro-triangles.
uint filled(uint state, uint level)
{
    return state * 0x55555555u & (level > 1u ? ~0u : level == 1u ? 0xffu : 0x3u);
}

// The states of all micro-triangles of an item from what may be in them and the guesses, 2 bits each.
uint statesOfFlags(uint flags, uint guesses)
{
    const uint mayNotBeOpaque = flags & 0x55555555u;
    const uint mayNotBeTransparent = flags >> 1u & 0x55555555u;
    uint unknown = ~(mayNotBeOpaque ^ mayNotBeTransparent) & 0x55555555u;
    uint opaque = (mayNotBeTransparent & ~mayNotBeOpaque) | (unknown & guesses);
    const uint set = alphaFlags;
    if ((set & kBakeSwap) != 0u)
        opaque ^= 0x55555555u;
    if ((set & kBakeTwoState) != 0u) {
        if ((set & kBakeUnknownIsOpaque) != 0u)
            opaque |= unknown;
        else if ((set & kBakeUnknownIsTransparent) != 0u)
            opaque &= ~unknown;
        unknown = 0u;
    }
    return opaque | unknown << 1u;
}

// The lowest bit of 64; takes it away.
uint takeBit(inout uvec2 bits)
{
    const bool low = bits.x != 0u;
    const uint n = uint(findLSB(low ? bits.x : bits.y));
    if (low)
        bits.x &= bits.x - 1u;
    else
        bits.y &= bits.y - 1u;
    return low ? n : 32u + n;
}

// The states of up to four items of a triangle from `first` on: 16 micro-triangles each, or all.
//
// Neighbouring invocations have different micro-triangles to look at closely. They go from one to the next together,
// each to its own.
uvec4 statesOf(Subject subject, uint first, uint items)
{
    const uint level = subject.level;
    if (subject.resolved)
        return uvec4(filled(subject.state, level));
    const uint below = min(level, 2u);
    uvec4 flags = uvec4(0u); // kMayNotBe* of each, 2 bits
    for (uint number = 0u; number < SCRATCH(kBakeMips); ++number) {
        Mip mip = subject.mip;
        Placement p = subject.place;
        if (number > 0u) {
            mip = makeMip(number);
            p = place(subject.uvs, mip, level);
        }
        uvec2 open = uvec2(0u);
        for (uint i = 0u; i < items; ++i) {
            const Node node = nodeAt(level, below, first + i);
            const Shape s = shapeAt(p, node.i, node.j, node.size);
            const ivec4 box = cellsAround(s);
            const uint all = boxFlags(mip, box.xy, box.zw);
            uint leaves = level > 1u ? 0u : level == 1u ? 0xfu : 0x1u;
            flags[i] |= all != kMayBeBoth ? all * 0x55555555u : 0u;
            for (uint child = 0u; child < 4u && all == kMayBeBoth && level > 1u; ++child) {
                const ivec4 around = cellsAround(shapeIn(s, node, childOf(node, child)));
                const uint four = boxFlags(mip, around.xy, around.zw);
                flags[i] |= four != kMayBeBoth ? (four * 0x55u) << (8u * child) : 0u;
                leaves |= four == kMayBeBoth ? 0xfu << (4u * child) : 0u;
            }
            leaves = all == kMayBeBoth ? leaves << (16u * (i & 1u)) : 0u;
            if (i < 2u)
                open.x |= leaves;
            else
                open.y |= leaves;
        }
        while ((open.x | open.y) != 0u) {
            const uint n = takeBit(open);
            const Node leaf = nodeAt(level, 0u, first * 16u + n);
            flags[n / 16u] |= shapeFlags(mip, shapeAt(p, leaf.i, leaf.j, leaf.size)) << (2u * (n & 15u));
        }
    }
    // Guesses for those that may be both.
    const uvec4 both = flags & flags >> 1u & 0x55555555u;
    uvec4 guesses = uvec4(0u);
    for (uint i = 0u; i < items; ++i) {
        uint open = both[i] & (level > 1u ? ~0u : level == 1u ? 0x55u : 0x1u);
        while (open != 0u) {
            const uint bit = uint(findLSB(open));
            open &= open - 1u;
            const Node leaf = nodeAt(level, 0u, (first + i) * 16u + bit / 2u);
            if (mostlyOpaque(subject.mip, shapeAt(subject.place, leaf.i, leaf.j, leaf.size)))
                guesses[i] |= 1u << bit;
        }
    }
    uvec4 states;
    for (uint i = 0u; i < 4u; ++i)
        states[i] = statesOfFlags(flags[i], guesses[i]) & filled(3u, level);
    return states;
}

// The items of a unit; and its states, if blocks of cells decide them.
uint itemsOf(uint level)
{
    return level > 2u ? 4u : 1u;
}
bool uniformUnit(Subject subject, uint unit, out uint state)
{
    state = subject.state;
    if (subject.resolved)
        return true;
    if (subject.level < 3u)
        return false;
    const uint flags = nodeFlags(subject, nodeAt(subject.level, 3u, unit));
    state = stateOf(flags, true);
    return flags != kMayBeBoth;
}
