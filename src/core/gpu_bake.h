// SPDX-License-Identifier: Apache-2.0
// The words of the GPU baker's scratch memory: what the host sets, and what its shaders hand each other. C++ and GLSL;
// see shared.h.
#ifndef VELLUM_CORE_GPU_BAKE_H
#define VELLUM_CORE_GPU_BAKE_H

#ifdef __cplusplus
#include "core/shared.h"
#else
#include "shared.h"
#endif

VELLUM_SHARED_BEGIN

VELLUM_CONST uint kBakeLevels = 13u; // subdivision levels 0..12
VELLUM_CONST uint kBakeMostMips = 16u;
// Triangles that are counted and placed together: a workgroup, no larger than every device allows.
VELLUM_CONST uint kBakeBlock = 128u;
// Workgroups in x; the rest goes to y.
VELLUM_CONST uint kBakeMostGroups = 65535u;
// Words that one dispatch of bake_params.comp carries in its push constants.
VELLUM_CONST uint kBakePushedWords = 28u;

// Words that the host sets. Addresses take two, the lower half first.
VELLUM_CONST uint kBakeTriangles = 0u; // how many
VELLUM_CONST uint kBakeVertices = 1u;
VELLUM_CONST uint kBakeUvs = 2u; // an address
VELLUM_CONST uint kBakeUvStride = 4u;
VELLUM_CONST uint kBakeUvFormat = 5u;
VELLUM_CONST uint kBakeIndices = 6u;    // an address
VELLUM_CONST uint kBakeIndexBytes = 8u; // of an index; 0: no indices
VELLUM_CONST uint kBakeLevel = 9u;      // of all triangles, or the most of any
VELLUM_CONST uint kBakeFlags = 10u;
VELLUM_CONST uint kBakeMips = 11u;
VELLUM_CONST uint kBakeTexelsPerEdge = 12u; // squared, times kLevelSlack
VELLUM_CONST uint kBakeSubtexel = 13u;
VELLUM_CONST uint kBakeInterpolation = 14u;
VELLUM_CONST uint kBakeBarycentric = 15u;
VELLUM_CONST uint kBakeOpaqueFrom = 16u;       // a filtered value is surely opaque from here on,
VELLUM_CONST uint kBakeTransparentBelow = 17u; // and surely transparent below
VELLUM_CONST uint kBakeCutoff = 18u;
VELLUM_CONST uint kBakeBorder = 19u;
VELLUM_CONST uint kBakeWidth = 20u; // of mip level 0
VELLUM_CONST uint kBakeHeight = 21u;
VELLUM_CONST uint kBakeData = 22u;           // addresses of the output
VELLUM_CONST uint kBakeRecords = 24u;        //
VELLUM_CONST uint kBakeSpecialIndices = 26u; //
VELLUM_CONST uint kBakeResult = 28u;         //
VELLUM_CONST uint kBakeCapacity = 30u;       // records of each level
VELLUM_CONST uint kBakeSetWords = 43u;

VELLUM_CONST uint kBakeUvFloat = 0u;
VELLUM_CONST uint kBakeUvHalf = 1u;
VELLUM_CONST uint kBakeUvUnorm16 = 2u;

// kBakeFlags
VELLUM_CONST uint kBakeAutomatic = 0x1u; // a level for each triangle
VELLUM_CONST uint kBakeTwoState = 0x2u;
VELLUM_CONST uint kBakeUnknownIsOpaque = 0x4u;
VELLUM_CONST uint kBakeUnknownIsTransparent = 0x8u;
VELLUM_CONST uint kBakeNoSpecial = 0x10u; // every triangle gets data
VELLUM_CONST uint kBakeNegate = 0x20u;    // texels count as their negatives
VELLUM_CONST uint kBakeSwap = 0x40u;      // opaque and transparent change places at the end
VELLUM_CONST uint kBakeNearest = 0x80u;
VELLUM_CONST uint kBakeSizesOnly = 0x100u;
VELLUM_CONST uint kBakeComponentShift = 12u;
VELLUM_CONST uint kBakeWrapUShift = 16u;
VELLUM_CONST uint kBakeWrapVShift = 20u;

VELLUM_CONST uint kBakeRepeat = 0u;
VELLUM_CONST uint kBakeMirror = 1u;
VELLUM_CONST uint kBakeClamp = 2u;
VELLUM_CONST uint kBakeBorderMode = 3u;
VELLUM_CONST uint kBakeMirrorOnce = 4u;

// Words that shaders set.
VELLUM_CONST uint kBakeProbeGroups = 48u;   // VkDispatchIndirectCommand
VELLUM_CONST uint kBakeMeasureGroups = 52u; //
VELLUM_CONST uint kBakeWriteGroups = 56u;   //
VELLUM_CONST uint kBakeTooMuch = 60u;       // more unresolved units than there are numbers
VELLUM_CONST uint kBakeWork = 64u;          // listed triangles by level
VELLUM_CONST uint kBakeSpecials = 80u;      // triangles that became a special index, by state
VELLUM_CONST uint kBakeMipTable = 128u;     // kBakeMipWords for each mip level

VELLUM_CONST uint kBakeMipWords = 32u;
VELLUM_CONST uint kBakeMipCellsX = 0u;
VELLUM_CONST uint kBakeMipCellsY = 1u;
VELLUM_CONST uint kBakeMipMasks = 4u; // where the mask of each size of block is

VELLUM_CONST uint kBakeHeaderWords = 640u;

// Behind the header: kBakeTriangleWords for each triangle; a list of triangles; 16 counts for each block of triangles;
// the masks.
VELLUM_CONST uint kBakeTriangleWords = 8u;
VELLUM_CONST uint kBakeInfo = 6u; // of a triangle, behind its texture coordinates
VELLUM_CONST uint kBakeInfoLevel = 0xfu;
VELLUM_CONST uint kBakeInfoResolved = 0x10u; // it is one state all over, and which is known
VELLUM_CONST uint kBakeStates = 7u;          // a bit for each state that occurs

VELLUM_FN uint bakeBlocks(VELLUM_IN uint triangles)
{
    return (triangles + kBakeBlock - 1u) / kBakeBlock;
}
VELLUM_FN uint bakeListStart(VELLUM_IN uint triangles)
{
    return kBakeHeaderWords + triangles * kBakeTriangleWords;
}
VELLUM_FN uint bakeBlockStart(VELLUM_IN uint triangles)
{
    return bakeListStart(triangles) + triangles;
}
VELLUM_FN uint bakeMaskStart(VELLUM_IN uint triangles)
{
    return bakeBlockStart(triangles) + bakeBlocks(triangles) * 16u;
}

// Stored cells of an axis with so many texels, and how many of them are in front of cell 0. As Axis of the baker.
VELLUM_FN uint bakeCells(VELLUM_IN uint texels, VELLUM_IN uint wrap, VELLUM_IN bool bilinear)
{
    const uint more = bilinear ? 1u : 0u;
    return wrap == kBakeRepeat ? texels : wrap == kBakeBorderMode ? texels + 2u + more : texels + more;
}
VELLUM_FN uint bakeLead(VELLUM_IN uint wrap, VELLUM_IN bool bilinear)
{
    const uint more = bilinear ? 1u : 0u;
    return wrap == kBakeRepeat ? 0u : wrap == kBakeBorderMode ? 1u + more : more;
}
// Blocks of 2^step cells along an axis.
VELLUM_FN uint bakeBlocksOfCells(VELLUM_IN uint cells, VELLUM_IN uint step)
{
    return ((cells - 1u) >> step) + 1u;
}
// Pairs of words in a row of a mask: 32 blocks a pair, and one pair more that may be read.
VELLUM_FN uint bakeMaskPitch(VELLUM_IN uint blocks)
{
    return (blocks + 31u) / 32u + 1u;
}
VELLUM_FN uint bakeMaskWords(VELLUM_IN uint cellsX, VELLUM_IN uint cellsY, VELLUM_IN uint step)
{
    return bakeMaskPitch(bakeBlocksOfCells(cellsX, step)) * bakeBlocksOfCells(cellsY, step) * 2u;
}
// How often cells can be combined, two by two along each axis, until there is one block.
VELLUM_FN uint bakeMaskSteps(VELLUM_IN uint cellsX, VELLUM_IN uint cellsY)
{
    uint steps = 1u;
    while (((cellsX - 1u) >> (steps - 1u)) != 0u || ((cellsY - 1u) >> (steps - 1u)) != 0u)
        steps = steps + 1u;
    return steps;
}
VELLUM_FN uint bakeMipSize(VELLUM_IN uint size, VELLUM_IN uint mip)
{
    return (size >> mip) > 0u ? size >> mip : 1u;
}

// A triangle is classified in units of up to 64 micro-triangles, an invocation each.
VELLUM_FN uint bakeUnits(VELLUM_IN uint level)
{
    return level > 3u ? 1u << (2u * level - 6u) : 1u;
}

// Words of packed states of one triangle. They begin at a word each.
VELLUM_FN uint bakeDataWords(VELLUM_IN uint level, VELLUM_IN bool twoState)
{
    const uint bits = (1u << (2u * level)) * (twoState ? 1u : 2u);
    return (bits + 31u) / 32u;
}

VELLUM_SHARED_END

#endif
