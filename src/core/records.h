// Memory layouts that Vellum's shaders write and read, in 32-bit words. C++ and GLSL; see shared.h.
//
//   micromap    header (16 words), one triangle record (2 words) per micromap triangle, padding to 16 bytes, data units
//   BLAS tail   one geometry record (4 words) per geometry, then triangle records
//   slot page   2^kSlotsPerPageLog2 instance records (4 words); the pages of the first kFirstSlots lie one after the other
//   root        header (16 words), then kDirectoryPages page addresses (2 words each)
#ifndef VELLUM_CORE_RECORDS_H
#define VELLUM_CORE_RECORDS_H

#ifdef __cplusplus
#include "core/shared.h"
#else
#include "shared.h"
#endif

VELLUM_SHARED_BEGIN

// --- triangle record: what lookup needs of one triangle ---
// word 0: kind in the low 5 bits, index of the first 16-byte data unit in the other 27
// word 1: kindInline: the 16 states of subdivision level 2, two bits each, and there is no data
//         kindData + n: for each sub-triangle of level 2: 0 transparent, 1 opaque, 2 look at the data
//         kindFar: the index of the first data unit; bits 5..9 of word 0 hold the n of kindData
// n = (level - 3) * 2 + (4-state ? 1 : 0)
VELLUM_CONST uint kTriangleRecordWords = 2u;
VELLUM_CONST uint kKindInline = 0u;
VELLUM_CONST uint kKindData = 1u;
VELLUM_CONST uint kKindFar = 31u;
VELLUM_CONST uint kKindMask = 31u;
VELLUM_CONST uint kUnitShift = 5u;
VELLUM_CONST uint kMaxNearUnit = 0x07ffffffu;
VELLUM_CONST uint kCoarseLevel = 2u;
VELLUM_CONST uint kCoarseLook = 2u;

VELLUM_CONST uint kDataUnitBytes = 16u;

// --- micromap header ---
VELLUM_CONST uint kMicromapHeaderWords = 16u;
VELLUM_CONST uint kMicromapMagic = 0x4d4d4f56u; // "VOMM"
VELLUM_CONST uint kMicromapHeaderMagic = 0u;
VELLUM_CONST uint kMicromapHeaderTriangles = 1u; // number of triangle records
VELLUM_CONST uint kMicromapHeaderUnits = 2u;     // data units in use

// --- geometry record ---
// word 0: bit 0: VK_GEOMETRY_OPAQUE_BIT_KHR; the other 31: index of its first triangle record, counted in triangle
// records
//         from the first geometry record of the BLAS; 0: no micromap
// word 1: 0
// word 2, 3: address of the micromap's data units
VELLUM_CONST uint kGeometryRecordWords = 4u;
VELLUM_CONST uint kGeometryRecordOpaque = 1u;
VELLUM_CONST uint kGeometryTrianglesShift = 1u;

// --- instance record ---
// word 0: instanceCustomIndex in the low 24 bits. Of instances of boxes: bit kInstanceBoxes, and in bits 24..27 the
//         instance flags 2..5
// word 1: of instances of boxes: which geometries are opaque, see BLAS cell
// word 2, 3: address of the BLAS's geometry records, which is a multiple of 16; 0: it has none. The low 4 bits of word
// 2 hold instance flags 2..5: all of those that resolution needs (opacity.h). Lookup reads as few words as can be: a
// driver for the CPU gathers each one lane by lane.
VELLUM_CONST uint kInstanceRecordWords = 4u;
VELLUM_CONST uint kInstanceFlagsShift = 2u;
VELLUM_CONST uint kInstanceFlagsMask = 15u;
VELLUM_CONST uint kInstanceBoxes = 0x10000000u;
VELLUM_CONST uint kInstanceBoxFlagsShift = 24u;
VELLUM_CONST uint kSlotsPerPageLog2 = 12u;
VELLUM_CONST uint kDirectoryPages = 4096u;
VELLUM_CONST uint kFirstSlots = 65536u;

// --- root ---
VELLUM_CONST uint kRootHeaderWords = 16u;
VELLUM_CONST uint kRootHashTable = 0u; // words 0, 1: address of the BLAS hash table

// --- BLAS hash table: header (4 words: mask of the bucket index), then buckets ---
// bucket word 0, 1: key, the BLAS's acceleration structure reference; 0 empty, ~0 deleted
// bucket word 2, 3: address of a BLAS cell
VELLUM_CONST uint kHashHeaderWords = 4u;
VELLUM_CONST uint kHashBucketWords = 4u;

// --- BLAS cell: written by the GPU when a build with that reference executes ---
// word 0, 1: address of the geometry records, 0: none
// word 2: 1: it is known which geometries of boxes are opaque; else 0
// word 3: and these are: bit (geometry % 32), which says it for any number of geometries if they are all alike
VELLUM_CONST uint kBlasCellWords = 4u;

VELLUM_FN uint hashReference(VELLUM_IN uint low, VELLUM_IN uint high)
{
    uint h = (low >> 4u) ^ (high * 0x9e3779b1u);
    h = (h ^ (h >> 15u)) * 0x85ebca6bu;
    h = (h ^ (h >> 13u)) * 0xc2b2ae35u;
    return h ^ (h >> 16u);
}

VELLUM_SHARED_END

#endif
