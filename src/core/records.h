// SPDX-License-Identifier: Apache-2.0
// Memory layouts that Vellum's shaders write and read, in 32-bit words. C++ and GLSL; see shared.h.
//
//   micromap    header (16 words), one triangle record (2 words) per micromap triangle, padding to 16 bytes, data units
//   BLAS tail   one geometry record (4 words) per geometry, one micromap name (4 words) per geometry, then triangle
//               records; in a structure that was deserialized, then the data units of its unnamed micromaps
//   TLAS tail   the instances (16 words each) that the driver has built from: the application's, with slots as custom
//               indices and without some flags, which the instance records keep
//   slot page   2^kSlotsPerPageLog2 instance records (4 words)
//   root        header (16 words), then kDirectoryPages page addresses (2 words each), see below
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
//         kindFar: the index of the first data unit, all of which is looked at; bits 5..9 of word 0 hold the n of
//                  kindData, bits 10..13 the byte of the unit at which the data begins
// n = (level - 3) * 2 + (4-state ? 1 : 0)
VELLUM_CONST uint kTriangleRecordWords = 2u;
VELLUM_CONST uint kKindInline = 0u;
VELLUM_CONST uint kKindData = 1u;
VELLUM_CONST uint kDataKinds = 20u;
VELLUM_CONST uint kKindFar = 31u;
VELLUM_CONST uint kKindMask = 31u;
VELLUM_CONST uint kUnitShift = 5u;
VELLUM_CONST uint kFarByteShift = 10u;
VELLUM_CONST uint kFarByteMask = 15u;
VELLUM_CONST uint kMaxNearUnit = 0x07ffffffu;
VELLUM_CONST uint kCoarseLevel = 2u;
VELLUM_CONST uint kCoarseLook = 2u;

VELLUM_CONST uint kDataUnitBytes = 16u;

// Returns whether the data that a triangle record names, if any, lies inside a micromap with so many data units.
VELLUM_FN bool staysInside(VELLUM_IN uint word0, VELLUM_IN uint word1, VELLUM_IN uint units)
{
    const uint kind = word0 & kKindMask;
    const bool far = kind == kKindFar;
    const uint n = far ? word0 >> kUnitShift & kKindMask : kind - kKindData;
    if (kind == kKindInline || n >= kDataKinds)
        return kind == kKindInline;
    const uint before = far ? (word0 >> kFarByteShift & kFarByteMask) * 8u : 0u;
    const uint bits = before + ((1u + (n & 1u)) << (2u * (kCoarseLevel + 1u + (n >> 1u))));
    const uint needed = (bits + kDataUnitBytes * 8u - 1u) / (kDataUnitBytes * 8u);
    return needed <= units && (far ? word1 : word0 >> kUnitShift) <= units - needed;
}

// --- micromap header ---
VELLUM_CONST uint kMaxMicromapTriangles = 0x08000000u; // VkPhysicalDeviceOpacityMicromapPropertiesKHR
VELLUM_CONST uint kMicromapHeaderWords = 16u;
VELLUM_CONST uint kMicromapMagic = 0x4d4d4f56u; // "VOMM"
VELLUM_CONST uint kMicromapHeaderMagic = 0u;
VELLUM_CONST uint kMicromapHeaderTriangles = 1u; // number of triangle records
VELLUM_CONST uint kMicromapHeaderUnits = 2u;     // data units in use
VELLUM_CONST uint kMicromapHeaderFlags = 3u;     // VkBuildMicromapFlagsEXT of the build
VELLUM_CONST uint kMicromapHeaderCompacted = 4u; // 1: a compacted copy

// --- serialized micromap: this header, then the bytes of the micromap that are in use ---
// words 0..3: VkPhysicalDeviceIDProperties::driverUUID, 4..7: kMicromapLayoutUuid; both as the specification demands
// words 8, 9: total bytes; 10, 11: the least size of a micromap that it can be deserialized into; the rest 0
VELLUM_CONST uint kSerializedMicromapHeaderWords = 16u;
VELLUM_CONST uint kSerializedLayoutUuid = 4u;
// Increment it with every change of the layout or meaning of micromap, triangle record or data, and kBlockVersion with
// it.
VELLUM_CONST uint kMicromapLayoutVersion = 3u;
VELLUM_CONST uint kMicromapLayoutUuid0 = 0x6c6c6556u; // "Vell"
VELLUM_CONST uint kMicromapLayoutUuid1 = 0x6d206d75u; // "um m"
VELLUM_CONST uint kMicromapLayoutUuid2 = 0x6f726369u; // "icro"

// --- scratch memory of a micromap build ---
// 8 words of counters; VkDispatchIndirectCommands of the passes of micromap_pack.comp, three words for each kPack*,
// initially of 0 groups, then those that micromap_in_place.comp copies over them to start the passes; tables of words:
//   sums        one per kPlaceBlock triangles: units of the block, then of all blocks before it
// for lossy builds:
//   parts       two words each, {triangle, part}: parts of triangles with more than kPartUnits units
VELLUM_CONST uint kScratchCounterWords = 8u;
VELLUM_CONST uint kScratchArguments = 8u;
VELLUM_CONST uint kArgumentWords = 9u;
VELLUM_CONST uint kScratchTables = 32u; // words before the tables
VELLUM_CONST uint kScratchPartCount = 0u;
VELLUM_CONST uint kScratchStaged = 3u; // data units that are allocated to triangles of lossy builds
VELLUM_CONST uint kPlaceBlock = 256u;
VELLUM_CONST uint kPartUnits = 64u;

// --- flags of a micromap build's push constants: VkBuildMicromapFlagsEXT, and ---
VELLUM_CONST uint kBuildFlagsMask = 0xffffu;
VELLUM_CONST uint kBuildAllowsCompaction = 4u; // VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT
VELLUM_CONST uint kBuildMaxLevelShift = 16u;   // 4 bits: the highest level of the usage counts
VELLUM_CONST uint kBuildAnalysing = 0x80000000u;

// --- passes of micromap_pack.comp ---
VELLUM_CONST uint kPackSums = 0u;   // units of each block
VELLUM_CONST uint kPackScan = 1u;   // units of all blocks before each, and the micromap's header
VELLUM_CONST uint kPackCopies = 2u; // records and data
VELLUM_CONST uint kPackPasses = 3u;

// --- lossy builds (core/lossy.h); the coarsened micromap follows the other tables (micromaps/micromap_lossy.glsl) ---
// A micro-triangle that becomes unknown must save the states of 2^kLossyPriceLog2.
VELLUM_CONST uint kLossyPriceLog2 = 4u;
VELLUM_CONST uint kLossyEntryBytes = 12u;
VELLUM_CONST uint kLossyPartBytes = 16u;

// --- geometry record ---
// word 0: bit 0: VK_GEOMETRY_OPAQUE_BIT_KHR; the other 31: index of its first triangle record, counted in triangle
//         records from the first geometry record of the BLAS; 0: no micromap
// word 1: number of the micromap's data units
// word 2, 3: address of the micromap's data units
VELLUM_CONST uint kGeometryRecordWords = 4u;
VELLUM_CONST uint kGeometryRecordOpaque = 1u;
VELLUM_CONST uint kGeometryTrianglesShift = 1u;

// --- micromap name: identifies a geometry's micromap in serialized data ---
// word 0, 1: device address of the memory of a micromap of VK_KHR_opacity_micromap; 0: the geometry has no micromap, or
//            one of VK_EXT_opacity_micromap, which serialized data cannot name
// word 2: offset of the micromap's data units from that address, in units
VELLUM_CONST uint kMicromapNameWords = 4u;

// --- instance record ---
// word 0: instanceCustomIndex in the low 24 bits. Of instances of boxes: bit kInstanceBoxes, and in bits 24..27 the
//         instance flags 2..5. Of others: in the upper 8 bits hitTable() of the instance's flags (opacity.h); of no
//         flags if the BLAS has no geometry records, because then the driver gets the flags. The table of no flags
//         does not set the bit kInstanceBoxes, so for a box the bit states whether the record is one of boxes
// word 1: of instances of boxes: 0, so that a shader that looks a triangle up there follows no address
//         of others: a copy of word 0 of the BLAS's geometry record if it has one geometry, which saves lookup a load
//         before that of the triangle record; 0 if it has no records. Of several geometries: kManyGeometries, and a
//         mask for their words 0. With DISABLE_OPACITY_MICROMAPS: kInstanceWithoutMicromaps, which names no triangle
//         record
// word 2, 3: address of the BLAS's geometry records, a multiple of 16. If it has none:
//         of instances of boxes: which geometries are opaque, see word 7 of the descriptor; kInstanceNoRecords
//         of others: the instance flags 4 and 5, which the driver does not get; 0
// Nothing is repeated here that an update of the BLAS may change, such as the address of the data: after an update of
// the BLAS the TLAS need not be built again.
VELLUM_CONST uint kInstanceRecordWords = 4u;
VELLUM_CONST uint kInstanceRecordLog2 = 4u; // bytes
VELLUM_CONST uint kManyGeometries = 0x80000000u;
VELLUM_CONST uint kManyGeometriesMask = 0x7fffffffu;
VELLUM_CONST uint kInstanceWithoutMicromaps = kManyGeometries | kGeometryRecordOpaque;
VELLUM_CONST uint kCustomIndexMask = 0x00ffffffu;
VELLUM_CONST uint kInstanceFlagsShift = 2u;
VELLUM_CONST uint kInstanceFlagsMask = 15u;
VELLUM_CONST uint kInstanceBoxes = 0x10000000u;
VELLUM_CONST uint kInstanceBoxFlagsShift = 24u;
VELLUM_CONST uint kInstanceNoRecords = 0xffffffffu;
// Neither a page nor the root crosses a multiple of 2^32, so the upper word of the address is the same for all of it.
// In the root, the bytes of all pages before a page are subtracted from the lower word of its address.
VELLUM_CONST uint kSlotsPerPageLog2 = 16u;
VELLUM_CONST uint kSlotsPerPage = 1u << kSlotsPerPageLog2;
VELLUM_CONST uint kDirectoryPages = 256u;
VELLUM_CONST uint kFirstSlots = 65536u; // in the first page

// --- root ---
VELLUM_CONST uint kRootHeaderWords = 16u;
// words 0, 1: address of the hash table, a multiple of 32, plus the base-2 logarithm of its number of buckets
VELLUM_CONST uint kRootHashTable = 0u;
VELLUM_CONST uint kBucketsLog2Mask = 31u;

VELLUM_CONST uint kRootGpuErrors = 2u; // words 2, 3: address of the counters of GPU errors

// GPU errors: errors of builds and copies that only the GPU can find. Indices of counters, one word each, which only
// the GPU writes.
VELLUM_CONST uint kGpuErrorForeignData = 0u;      // UUIDs of another driver or layer version
VELLUM_CONST uint kGpuErrorDamagedData = 1u;      // data that is not serialized data, or not complete
VELLUM_CONST uint kGpuErrorWrongType = 2u;        // serialized data of the other type of structure
VELLUM_CONST uint kGpuErrorTargetTooSmall = 3u;   // acceleration structure that is too small for the data
VELLUM_CONST uint kGpuErrorMemoryTooSmall = 4u;   // buffer that is too small for the serialized data
VELLUM_CONST uint kGpuErrorUnknownReference = 5u; // instance of a bottom-level structure that does not exist
VELLUM_CONST uint kGpuErrorUnbuiltReference = 6u; // instance of a bottom-level structure that was never built
VELLUM_CONST uint kGpuErrorCopyTooSmall = 7u;     // acceleration structure that is too small for a copy of another
VELLUM_CONST uint kGpuErrorUnknownMicromap = 8u; // serialized data names a micromap that does not exist or is too small
VELLUM_CONST uint kGpuErrorMicromapTooSmall = 9u;  // micromap, or buffer, that is too small for a copy of a micromap
VELLUM_CONST uint kGpuErrorMicromapNotBuilt = 10u; // copy of a micromap that was never built
VELLUM_CONST uint kGpuErrorMicromapData = 11u;     // data that is not a serialized micromap, or not complete
VELLUM_CONST uint kGpuErrorMicromapOverlap = 12u;  // source and target of a copy of a micromap overlap
VELLUM_CONST uint kGpuErrorNoBottomLevel = 13u;    // instance, of a build, that references no bottom-level structure
VELLUM_CONST uint kGpuErrorNoBottomLevelIndirect = 14u; // the same, of an indirect build
VELLUM_CONST uint kGpuErrors = 15u;
VELLUM_CONST uint kGpuErrorTotal = kGpuErrors; // counts all of them; incremented after the error's own counter
VELLUM_CONST uint kGpuErrorCounters = kGpuErrors + 1u;
// The word after the counters: the greatest instanceShaderBindingTableRecordOffset of all instances that were built.
VELLUM_CONST uint kGreatestRecordOffset = kGpuErrorCounters;

// --- hash table of acceleration structures: buckets ---
// bucket word 0, 1: key, the acceleration structure reference; 0 empty, ~0 deleted
// bucket word 2, 3: address of a descriptor, with its generation
VELLUM_CONST uint kHashBucketWords = 4u;

// --- descriptor: states what an acceleration structure holds; the GPU writes it when a build or a copy executes ---
// Its memory is used again for other structures, and is not zeroed. So each use has a generation, which is in the low
// bits of every address of the descriptor. A descriptor that was written with another one states nothing.
// word 0, 1: address of the tail; of a BLAS without records: end of the driver's part, 0 if that is unknown
// word 2: kDescriptor* in the low 8 bits, and the generation
// word 3: 16-byte units of the tail
// word 4: number of geometry records or of instances
// word 5: of a BLAS: 16-byte units of the tail without data units, which come last
// word 6: of a BLAS: 16-byte units of the driver's part of a compacted copy; 0: its size was not queried
//         of a TLAS: the first of its instance slots
// word 7: of kDescriptorBoxes: which geometries are opaque: bit (geometry % 32), which is valid for any number of
//         geometries if all are alike
//         of others, and for kDescriptorBoxes in word 6: serial of the deserialization that wrote the descriptor; 0: it
//         was not written by one
// A descriptor of instances in serialized data has the address of the handles in words 6, 7.
VELLUM_CONST uint kDescriptorWords = 8u;
VELLUM_CONST uint kDescriptorFirstSlot = 6u;
VELLUM_CONST uint kDescriptorGenerations = 32u; // equal to the bytes of a descriptor, so that the low bits are free
VELLUM_CONST uint kDescriptorKindMask = 0xffu;
VELLUM_CONST uint kDescriptorGenerationShift = 8u;
VELLUM_CONST uint kDescriptorUnbuilt = 0u; // nothing was built
VELLUM_CONST uint kDescriptorBottom = 1u;  // a BLAS with geometry records
VELLUM_CONST uint kDescriptorTop = 2u;     // a TLAS
VELLUM_CONST uint kDescriptorBroken = 3u;  // a copy that failed: must not be instanced
VELLUM_CONST uint kDescriptorPlain = 4u;   // a BLAS without geometry records
VELLUM_CONST uint kDescriptorBoxes = 5u;   // a BLAS of boxes, and it is known which geometries are opaque
// If the key is "address of a micromap + kMicromapKey", word 3 is the size of its memory in units. If the key is the
// address of a structure, only word 2 is valid: a micromap was deserialized there.
VELLUM_CONST uint kDescriptorMicromap = 6u;
VELLUM_CONST uint kMicromapKey = 1u;

// --- serialized acceleration structures: the header of the specification, padded to 16 bytes; for a BLAS the driver's
// serialized data; the layer's block: header (16 words), then the tail, in which data units have an offset in units
// from the tail's beginning in place of their address. A geometry with a named micromap has the offset kDataNamed, and
// in the next word the index of the micromap's address in the specification's header ---
VELLUM_CONST uint kSerializedHeaderWords = 14u; // two UUIDs, total and deserialized size, number of handles
VELLUM_CONST uint kDataNamed = 0xffffffffu;
VELLUM_CONST uint kMaxBlockAddresses = 0x01000000u;
VELLUM_CONST uint kBlockMagic = 0x534d4f56u; // "VOMS"
VELLUM_CONST uint kBlockVersion = 4u;
VELLUM_CONST uint kBlockUnits = 4u;
// words of the block's header
VELLUM_CONST uint kBlockHeaderMagic = 0u;
VELLUM_CONST uint kBlockHeaderVersion = 1u;
VELLUM_CONST uint kBlockHeaderKind = 2u;
VELLUM_CONST uint kBlockHeaderCount = 3u;
VELLUM_CONST uint kBlockHeaderRecordUnits = 4u;
VELLUM_CONST uint kBlockHeaderTailUnits = 5u;
VELLUM_CONST uint kBlockHeaderTailOffset = 6u;  // 16-byte units from the beginning of the structure
VELLUM_CONST uint kBlockHeaderChecksum = 7u;    // of the driver's data and the tail
VELLUM_CONST uint kBlockHeaderOpaqueBoxes = 8u; // word 7 of the descriptor
// The compatibility UUID is the driver's, XORed with this word: the driver alone would use slots as custom indices, and
// data of the driver alone has no block.
VELLUM_CONST uint kCompatibilityWord = 0x564d4f04u; // changes with kBlockVersion
// Sizes of structures modulo 256 state what they hold, in queries and in serialized data: this for a TLAS, 0 for a
// BLAS. They cost no memory, since structures begin at multiples of 256. A structure of the size that any query has
// reported for the source of serialized data is large enough, unless data of EXT micromaps is serialized with it: "dst
// must have been created with a size greater than or equal to that used to serialize the data"
// (VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746).
VELLUM_CONST uint kTopLevelSizeMark = 128u;
VELLUM_FN uint topLevelSizeUnits(VELLUM_IN uint needed) // in 16-byte units
{
    return ((needed + 8u + 15u) & ~15u) - 8u;
}
VELLUM_FN uint bottomLevelSizeUnits(VELLUM_IN uint needed)
{
    return (needed + 15u) & ~15u;
}
// The size modulo 256 of micromaps that are acceleration structures.
VELLUM_CONST uint kMicromapSizeMark = 64u;

VELLUM_CONST uint kInstanceUnits = 4u; // 16-byte units of a VkAccelerationStructureInstanceKHR

// --- copies of micromaps (shaders/micromaps/micromap_move.comp) ---
VELLUM_CONST uint kMoveSerialize = 0u;
VELLUM_CONST uint kMoveDeserialize = 1u;
VELLUM_CONST uint kMoveCopy = 2u;          // the bytes in use
VELLUM_CONST uint kMoveMarked = 4u;        // a bit: the deserialized size becomes kMicromapSizeMark modulo 256
VELLUM_CONST uint kMoveOnlyMicromaps = 8u; // a bit: other data is ignored, without an error
VELLUM_CONST uint kMoveUnitsPerInvocation = 8u;

// --- values of queries (shaders/query_pool/query_value.comp) ---
VELLUM_CONST uint kQueryMicromapSize = 0u; // the bytes in use, which a clone needs
VELLUM_CONST uint kQueryMicromapSerialized = 1u;
VELLUM_CONST uint kQueryMarked = 4u; // a bit: the size becomes kMicromapSizeMark modulo 256

VELLUM_FN uint hashReference(VELLUM_IN uint low, VELLUM_IN uint high)
{
    uint h = (low >> 4u) ^ (high * 0x9e3779b1u);
    h = (h ^ (h >> 15u)) * 0x85ebca6bu;
    h = (h ^ (h >> 13u)) * 0xc2b2ae35u;
    return h ^ (h >> 16u);
}

VELLUM_SHARED_END

#endif
