// SPDX-License-Identifier: Apache-2.0
// Compaction of micromaps: which triangles share data. Host and device must find the same ones, in every run, since a
// copy must fit in the size that a query has reported before. C++ and GLSL; see shared.h.
//
// In each round, every triangle that still looks for an owner hashes its data to a slot of the round's table, in which
// the lowest of its triangles remains. If that one has the same data, it is the owner. All triangles with the same data
// come to the same slots, so they find their owner in the same round, and it is the lowest of them. Those that find no
// owner in the last round, which is hardly ever any, keep data of their own.
#ifndef VELLUM_CORE_COMPACTION_H
#define VELLUM_CORE_COMPACTION_H

#ifdef __cplusplus
#include "core/shared.h"
#else
#include "shared.h"
#endif

VELLUM_SHARED_BEGIN

VELLUM_CONST uint kShareRounds = 4u;
// Of larger micromaps, no data is shared.
VELLUM_CONST uint kMostSharing = 1u << 26u; // triangles
// One invocation compares the data of two triangles: those with more units only share data at the same location.
VELLUM_CONST uint kMaxComparedUnits = 16384u;

// Slots of a round's table. Most triangles find their owner in the first round.
VELLUM_FN uint shareSlots(VELLUM_IN uint triangles, VELLUM_IN uint round)
{
    return (triangles >> round) + 64u;
}

// The first slot of a round's table, where the tables follow each other; for kShareRounds their end.
VELLUM_FN uint shareTable(VELLUM_IN uint triangles, VELLUM_IN uint round)
{
    uint first = 0u;
    for (uint r = 0u; r < round; ++r)
        first += shareSlots(triangles, r);
    return first;
}

VELLUM_FN uint mixBits(VELLUM_IN uint x)
{
    const uint y = (x ^ (x >> 16u)) * 0x7feb352du;
    const uint z = (y ^ (y >> 15u)) * 0x846ca68bu;
    return z ^ (z >> 16u);
}

// The slot of a hash in a round's table.
VELLUM_FN uint shareSlot(VELLUM_IN uint triangles, VELLUM_IN uint round, VELLUM_IN uint hash)
{
    return mixBits(hash + round * 0x9e3779b9u) % shareSlots(triangles, round);
}

// The hash of a triangle is the sum of this over its data units, so that several invocations can share the work, and of
// mixBits() of its kind; also of its location if it has more than kMaxComparedUnits.
VELLUM_FN uint hashUnit(VELLUM_IN uint x, VELLUM_IN uint y, VELLUM_IN uint z, VELLUM_IN uint w, VELLUM_IN uint unit)
{
    uint h = unit * 0x9e3779b1u + 0x7f4a7c15u;
    h = (h ^ x) * 0x85ebca6bu;
    h = ((h ^ (h >> 15u)) ^ y) * 0xc2b2ae35u;
    h = ((h ^ (h >> 13u)) ^ z) * 0x27d4eb2fu;
    h = ((h ^ (h >> 16u)) ^ w) * 0x165667b1u;
    return h ^ (h >> 15u);
}

// --- scratch memory of a compaction: 8 words, then tables of words ---
//   sums        one per kPlaceBlock triangles: units of the block, then of all blocks before it
//   parts       two words each, {triangle, part}: parts of triangles with more than kPartUnits units
//   triangles   three words each: hash, then data units of the block before the triangle's; coarse mask; owner
//   tables      one for each round: the lowest triangle of each slot
VELLUM_CONST uint kCompactionTables = 8u; // words before the tables
VELLUM_CONST uint kCompactionParts = 0u;  // entries of the list of parts
// kCompaction*, below: for the passes after the sizes are known.
VELLUM_CONST uint kCompactionOutcome = 1u;
VELLUM_CONST uint kTriangleWords = 3u;
VELLUM_CONST uint kNoTriangle = 0xffffffffu; // no owner yet; an empty slot; an unused entry of the list of parts
VELLUM_CONST uint kNoData = 0xfffffffeu;     // in place of an owner: the triangle needs no data

VELLUM_CONST uint kCompactionLeft = 0u;   // the micromap is copied as it is
VELLUM_CONST uint kCompactionWrites = 1u; // the compacted micromap is written
VELLUM_CONST uint kCompactionFails = 2u;  // nothing is written

// --- passes, in this order; those from kCompactWrite on of copies only ---
VELLUM_CONST uint kCompactClear = 0u;        // micromap_compact_share.comp
VELLUM_CONST uint kCompactAnalyse = 1u;      // micromap_compact_analyse.comp
VELLUM_CONST uint kCompactAnalyseParts = 2u; // the same, of the list of parts
VELLUM_CONST uint kCompactRound = 3u;        // micromap_compact_share.comp: this and the next kShareRounds
VELLUM_CONST uint kCompactCount = kCompactRound + kShareRounds + 1u; // micromap_compact_place.comp
VELLUM_CONST uint kCompactScan = kCompactCount + 1u;                 // the same
VELLUM_CONST uint kCompactWrite = kCompactScan + 1u;                 // micromap_compact_write.comp
VELLUM_CONST uint kCompactWriteParts = kCompactWrite + 1u;           // the same, of the list of parts
VELLUM_CONST uint kCompactPasses = kCompactWriteParts + 1u;

VELLUM_SHARED_END

#endif
