// SPDX-License-Identifier: Apache-2.0
// The formats of what validation finds in data on the GPU: the log of findings, the records of structures that the
// checks compare with, and the rule for one triangle of a micromap's input, which the device and the host check. C++
// and GLSL; see shared.h.
#ifndef VELLUM_CORE_FINDINGS_H
#define VELLUM_CORE_FINDINGS_H

#ifdef __cplusplus
#include "core/shared.h"
#else
#include "shared.h"
#endif

VELLUM_SHARED_BEGIN

// --- log of findings: header (8 words), then kLogCapacity entries (8 words) ---
// header word 0: number of entries, including those that did not fit
// entry words: what (written last), command << kSiteCommandShift | element of its infos, geometry, triangle or
// instance, two values, handle of an object (2 words)
VELLUM_CONST uint kLogHeaderWords = 8u;
VELLUM_CONST uint kLogCount = 0u;
VELLUM_CONST uint kLogEntryWords = 8u;
VELLUM_CONST uint kLogCapacity = 4096u;
VELLUM_CONST uint kSiteCommandShift = 24u;
VELLUM_CONST uint kSiteInfoMask = 0xffffffu;
VELLUM_CONST uint kNoGeometry = 0xffffffffu;

// what: kFinding*, and these bits.
VELLUM_CONST uint kFindingKhr = 0x100u;       // by VK_KHR_opacity_micromap
VELLUM_CONST uint kFindingStructure = 0x200u; // the object is a VkAccelerationStructureKHR, not a VkMicromapEXT
VELLUM_CONST uint kFindingMask = 0xffu;
// About a triangle of a micromap; value 0: data offset, value 1: level | format << 16.
VELLUM_CONST uint kFindingFormat = 1u;
VELLUM_CONST uint kFindingLevel = 2u;      // above the limit of the format
VELLUM_CONST uint kFindingLossyLevel = 3u; // above the limit of lossy builds
VELLUM_CONST uint kFindingLossyFormat = 4u;
VELLUM_CONST uint kFindingUndeclared = 5u; // level above the highest one of the usage counts
VELLUM_CONST uint kFindingData = 6u;       // outside the buffer
// About a micromap.
VELLUM_CONST uint kFindingCounts = 7u; // triangle: level | format << 16; value 0, 1: declared, found
// About a triangle of a geometry; value 0: the index, value 1: triangles of the micromap, which is the object.
VELLUM_CONST uint kFindingIndex = 8u;
VELLUM_CONST uint kFindingNumber = 9u;       // the same, without an index buffer: value 0 is the triangle's number
VELLUM_CONST uint kFindingNotSpecial = 10u;  // an index without a micromap
VELLUM_CONST uint kFindingIndexBuffer = 11u; // about a geometry: the first triangle whose index is outside the buffer
// About a geometry; value 0, 1: triangles by its usage counts, triangles with an index into the micromap.
VELLUM_CONST uint kFindingAttachedCounts = 12u;
// About an instance; value 0, 1: its reference; of kFindingPointer its address.
VELLUM_CONST uint kFindingDisable = 13u;     // disables micromaps of a structure that does not allow it
VELLUM_CONST uint kFindingFeature = 14u;     // micromap flags without the feature
VELLUM_CONST uint kFindingMicromap = 15u;    // names a micromap
VELLUM_CONST uint kFindingTopLevel = 16u;    // names a top-level structure
VELLUM_CONST uint kFindingDestroyed = 17u;   // names a structure that was destroyed
VELLUM_CONST uint kFindingNoStructure = 18u; // names nothing
VELLUM_CONST uint kFindingPointer = 19u;     // its address is no multiple of 16

// --- record of a structure: what the last build or copy that the device executed put there (4 words) ---
// word 0: kRecord*, word 1: flags of the build, word 2: triangles of a micromap
VELLUM_CONST uint kStructureRecordWords = 4u;
VELLUM_CONST uint kRecordUnknown = 0u; // never built, or by a command that validation does not follow
VELLUM_CONST uint kRecordMicromap = 1u;
VELLUM_CONST uint kRecordBottom = 2u;
VELLUM_CONST uint kRecordTop = 3u;
VELLUM_CONST uint kRecordDestroyed = 4u;
// word of record 0, which no structure uses; 1: the table has all references that the application got
VELLUM_CONST uint kRecordAllReferences = 3u;

// --- table of references: open addressing; bucket: reference (2 words), index of a record,
// 1: several structures have had the reference at the same time ---
VELLUM_CONST uint kReferenceBucketWords = 4u;
VELLUM_CONST uint kReferenceBucketsLog2 = 16u;
VELLUM_CONST uint kReferenceProbes = 64u;
VELLUM_FN uint referenceBucket(VELLUM_IN uint low, VELLUM_IN uint high)
{
    uint h = ((low >> 4u) ^ (high * 0x9e3779b1u)) * 0x85ebca6bu;
    h = (h ^ (h >> 13u)) * 0xc2b2ae35u;
    return (h ^ (h >> 16u)) & ((1u << kReferenceBucketsLog2) - 1u);
}

// --- usage counts of a micromap build, one for each level and format ---
VELLUM_CONST uint kUsageLevels = 13u;
VELLUM_CONST uint kUsageKinds = 26u;
VELLUM_FN uint usageKind(VELLUM_IN uint level, VELLUM_IN uint format)
{
    return level * 2u + format - 1u;
}
// memory of the check: numbers declared, numbers found, then whether a triangle has a finding of its own
VELLUM_CONST uint kUsageFound = 26u;
VELLUM_CONST uint kUsageWrong = 52u;
VELLUM_CONST uint kUsageWords = 53u;

// memory of the check of a geometry with a micromap: triangles with an index into it, then whether an index has a
// finding
VELLUM_CONST uint kAttachedFound = 0u;
VELLUM_CONST uint kAttachedWrong = 1u;

// --- limits of a micromap's triangles, in one word ---
VELLUM_CONST uint kLimitFourStateShift = 4u; // below: the greatest level of 2-state triangles
VELLUM_CONST uint kLimitLossyShift = 8u;
VELLUM_CONST uint kLimitDeclaredShift = 12u;
VELLUM_CONST uint kLimitLossy = 0x10000u; // the build is lossy

VELLUM_FN uint triangleBytes(VELLUM_IN uint level, VELLUM_IN uint format)
{
    return ((format << (2u * level)) + 7u) >> 3u;
}

// The finding about one triangle of a micromap; 0: none. `dataBytes`: to the end of the buffer of the data; 0xffffffff:
// unknown, or more than offsets reach.
VELLUM_FN uint findingOfTriangle(VELLUM_IN uint dataOffset, VELLUM_IN uint level, VELLUM_IN uint format,
                                 VELLUM_IN uint limits, VELLUM_IN uint dataBytes)
{
    if (format != 1u && format != 2u)
        return kFindingFormat;
    const bool lossy = (limits & kLimitLossy) != 0u;
    if (lossy && format != 2u)
        return kFindingLossyFormat;
    if (lossy && level > ((limits >> kLimitLossyShift) & 15u))
        return kFindingLossyLevel;
    if (!lossy && level > ((limits >> (format == 2u ? kLimitFourStateShift : 0u)) & 15u))
        return kFindingLevel;
    if (level > ((limits >> kLimitDeclaredShift) & 15u))
        return kFindingUndeclared;
    const uint bytes = triangleBytes(level, format);
    if (dataBytes != 0xffffffffu && (bytes > dataBytes || dataOffset > dataBytes - bytes))
        return kFindingData;
    return 0u;
}

VELLUM_SHARED_END

#endif
