// The states of 16 neighbouring micro-triangles on the curve, as bits of 4-state data; of all, if there are fewer.
#include "gpubake/bake_mask.glsl"
#include "gpubake/bake_texels.glsl"
#include "gpubake/bake_placement.glsl"
#include "gpubake/bake_piece.glsl"
#include "gpubake/bake_walk.glsl"

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

// What becomes of flags; `guess` is asked for where both outcomes may be.
uint stateOf(uint flags, bool guess)
{
    uint state = guess ? kStateUnknownOpaque : kStateUnknownTransparent;
    if (flags == kMayNotBeTransparent)
        state = kStateOpaque;
    else if (flags == kMayNotBeOpaque)
        state = kStateTransparent;
    const uint set = SCRATCH(kBakeFlags);
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

// Item `item` of a triangle, states as 2 bits each.
uint wordOf(uint triangle, uint item)
{
    const uint info = SCRATCH(triangleAt(triangle) + kBakeInfo);
    const uint level = info & kBakeInfoLevel;
    const uint below = min(level, 2u); // levels below the node that has all of them
    const uint count = 1u << (2u * below);
    if ((info & kBakeInfoResolved) != 0u) {
        const uint state = uint(findLSB(SCRATCH(triangleAt(triangle) + kBakeStates)));
        return state * 0x55555555u & (count == 16u ? ~0u : (1u << (2u * count)) - 1u);
    }
    Node node = Node(0, 0, 1 << level, false);
    for (uint d = level - below; d-- > 0u;)
        node = childOf(node, (item >> (2u * d)) & 3u);

    const Uvs uvs = loadUvs(triangle);
    uint flags = 0u; // kMayNotBe* of each
    for (uint number = 0u; number < SCRATCH(kBakeMips); ++number) {
        const Mip mip = makeMip(number);
        const Shape s = shapeAt(place(uvs, mip, level), node.i, node.j, node.size);
        const ivec4 box = cellsAround(s);
        const uint all = boxFlags(mip, box.xy, box.zw);
        if (all != kMayBeBoth) {
            flags |= all * 0x55555555u;
            continue;
        }
        for (uint n = 0u; n < count;) {
            if (below == 2u && (n & 3u) == 0u) {
                // Four at a time.
                const Node parent = childOf(node, n >> 2u);
                const ivec4 around = cellsAround(shapeIn(s, node, parent));
                const uint four = boxFlags(mip, around.xy, around.zw);
                if (four != kMayBeBoth) {
                    flags |= (four * 0x55u) << (2u * n);
                    n += 4u;
                    continue;
                }
            }
            if (((flags >> (2u * n)) & 3u) != kMayBeBoth) {
                Node leaf = node;
                for (uint d = below; d-- > 0u;)
                    leaf = childOf(leaf, (n >> (2u * d)) & 3u);
                flags |= shapeFlags(mip, shapeIn(s, node, leaf)) << (2u * n);
            }
            ++n;
        }
    }

    const Mip mip = makeMip(0u);
    const Shape s = shapeAt(place(uvs, mip, level), node.i, node.j, node.size);
    uint word = 0u;
    for (uint n = 0u; n < count; ++n) {
        const uint some = (flags >> (2u * n)) & 3u;
        bool guess = false;
        if (some == kMayBeBoth) {
            Node leaf = node;
            for (uint d = below; d-- > 0u;)
                leaf = childOf(leaf, (n >> (2u * d)) & 3u);
            guess = mostlyOpaque(mip, shapeIn(s, node, leaf));
        }
        word |= stateOf(some, guess) << (2u * n);
    }
    return word;
}
