// SPDX-License-Identifier: Apache-2.0
// Push constants of the layer's compute shaders, and the values of their fields. C++ and GLSL; see shared.h.
//
// A shader declares them by layout(push_constant, std430) uniform Push { XPush push; };
#ifndef VELLUM_CORE_PUSH_H
#define VELLUM_CORE_PUSH_H

#ifdef __cplusplus
#include "core/shared.h"
#define VELLUM_ADDRESS uint64_t
#define VELLUM_UVEC2(name) uint name[2]
#define VELLUM_UVEC4(name) uint name[4]
#else
#include "shared.h"
#define VELLUM_ADDRESS uvec2
#define VELLUM_UVEC2(name) uvec2 name
#define VELLUM_UVEC4(name) uvec4 name
#endif

VELLUM_SHARED_BEGIN

// micromaps/micromap_source.glsl: all passes of a build
struct MicromapPush {
    VELLUM_ADDRESS micromap;      // destination
    VELLUM_ADDRESS triangleArray; // VkMicromapTriangleEXT, each triangleArrayStride bytes
    VELLUM_ADDRESS data;
    VELLUM_ADDRESS scratch;
    uint triangleArrayStride;
    uint triangleCount;          // records in the destination
    uint readable;               // elements of triangleArray inside its buffer
    uint dataBytes;              // bytes of data inside its buffer
    uint capacityUnits;          // data units in the destination
    uint partCapacity;           // entries of the list of parts
    uint flags;                  // kBuild*
    uint alike;                  // level | format << 16, if all triangles have the same; 0: they do not
    uint lastOffset;             // the greatest data offset of such triangles in place
    uint trianglesPerInvocation; // of micromap_in_place.comp
    uint pack;                   // kPack*, of micromap_pack.comp
    uint copiersLog2;            // invocations for each block in its last pass
};

// micromaps/micromap_compact.glsl: all passes of a compaction (core/compaction.h)
struct MicromapCompactPush {
    VELLUM_ADDRESS source;
    VELLUM_ADDRESS target; // 0: only the size is needed
    VELLUM_ADDRESS value;  // its 64-bit number; 0: a copy
    VELLUM_ADDRESS scratch;
    VELLUM_ADDRESS root;
    VELLUM_ADDRESS targetBytes;
    uint sourceUnits;  // size of the source's memory in units of 16 bytes
    uint most;         // triangles that the scratch memory has tables for
    uint partCapacity; // entries of the list of parts
    uint pass;         // kCompact*
    uint invocations;  // of the pass
    uint mark;         // kQueryMarked, or 0
};

// micromaps/micromap_move.comp
struct MicromapMovePush {
    VELLUM_ADDRESS micromap;   // copies: the target
    VELLUM_ADDRESS serialized; // copies: the source
    VELLUM_ADDRESS micromapBytes;
    VELLUM_ADDRESS serializedBytes; // up to the end of their buffer; copies: of the source
    VELLUM_UVEC4(driverUuid);
    VELLUM_ADDRESS root;
    VELLUM_ADDRESS compaction; // its scratch memory; 0: none precedes the copy
    uint mode;                 // kMove*
    uint invocations;
};

// query_pool/query_value.comp
struct QueryValuePush {
    VELLUM_ADDRESS target; // 64-bit value
    VELLUM_ADDRESS micromap;
    VELLUM_ADDRESS micromapBytes; // size of the micromap: the header of one that was never built is not trusted
    uint kind;                    // kQuery*
    uint padding;
};

// structures/blas_records.comp
struct BlasRecordsPush {
    VELLUM_ADDRESS tail;       // target: geometry records, names, triangle records
    VELLUM_ADDRESS micromap;   // 0: special indices only
    VELLUM_ADDRESS indices;    // 0: the index is the triangle's number
    VELLUM_ADDRESS descriptor; // to be written; 0: another dispatch writes it
    VELLUM_ADDRESS range;      // indirect builds: a VkAccelerationStructureBuildRangeInfoKHR; 0: the build is direct
    VELLUM_ADDRESS source;     // updates: the descriptor of the source; 0: the build is not an update
    VELLUM_ADDRESS sourceBegin;
    VELLUM_ADDRESS begin; // of the structure
    uint triangleCount;
    uint indexBytes; // 1, 2 or 4
    uint indexStride;
    uint readable; // indices inside their buffer
    uint baseTriangle;
    uint geometryWord; // word 0 of the geometry record; names no triangle records if the geometry has no micromap
    uint geometryCount;
    uint tailUnits;    // of all records
    uint geometry;     // index of the geometry
    uint named;        // 1: the micromap is one of VK_KHR_opacity_micromap
    uint micromapSize; // in units of 16 bytes
    uint commonUnits;  // updates: of the source and the structure, what surely belongs to both
};

// structures/tlas_gather.comp
// Sources of instances.
VELLUM_CONST uint kFromArray = 0u;
VELLUM_CONST uint kFromPointers = 1u;
VELLUM_CONST uint kFromStructure = 2u;  // copies: the instances of another structure
VELLUM_CONST uint kFromSerialized = 3u; // the same in serialized data, with the references in a separate array
struct TlasGatherPush {
    VELLUM_ADDRESS source; // instances, pointers to them, or a descriptor that leads to them
    VELLUM_ADDRESS root;
    VELLUM_ADDRESS tail;       // target
    VELLUM_ADDRESS descriptor; // of the structure that is built
    VELLUM_ADDRESS range;      // indirect builds: a VkAccelerationStructureBuildRangeInfoKHR; 0: the build is direct
    uint count;                // instances that the driver builds
    uint firstSlot;
    uint from; // kFrom*
    uint padding;
};

// structures/tlas_instances.comp
struct TlasInstancesPush {
    VELLUM_ADDRESS source; // the application's instances; `tail`: they are there already
    VELLUM_ADDRESS tail;   // target: what the driver builds from
    VELLUM_ADDRESS root;
    VELLUM_ADDRESS records;  // instance record of the first one
    VELLUM_ADDRESS counters; // of GPU errors
    VELLUM_UVEC2(hitTables); // hitTable() of each combination of the first three of the flags, a byte each
    uint count;
    uint firstSlot;
    uint usableKinds;  // one bit for each kDescriptor*: what an instance may reference
    uint wrongKinds;   // likewise: references that are errors
    uint unknownError; // kGpuError* of a reference that leads to no bottom-level structure
    uint unbuiltError; // of one that leads to a structure that was not built
};

// structures/structure_copy.comp
struct StructureCopyPush {
    VELLUM_ADDRESS sourceDescriptor;
    VELLUM_ADDRESS targetDescriptor;
    VELLUM_ADDRESS sourceBegin;
    VELLUM_ADDRESS targetBegin;
    VELLUM_ADDRESS root;
    uint sourceUnits; // sizes of the structures
    uint targetUnits;
    uint compact;
    uint whole; // 1: the driver's part is copied as well
};

// structures/structure_save.comp
struct StructureSavePush {
    VELLUM_ADDRESS descriptor;
    VELLUM_ADDRESS begin;   // of the structure
    VELLUM_ADDRESS staging; // plan (kPlanUnits), then what the driver has serialized
    VELLUM_ADDRESS blob;    // destination
    VELLUM_ADDRESS root;
    uint structureUnits;
    uint stagingUnits; // of the driver's data
    uint leastUnits;   // of any deserialized structure
    uint capacity;     // units in the destination's buffer
    uint wholeCopies;  // 1: the driver serializes whole structures, whatever was built in them
    uint pass;
    uint blocks; // 1: the header has the form of VK_KHR_opacity_micromap
    uint padding;
};

// structures/structure_restore.comp
VELLUM_CONST uint kPassCheck = 0u;
VELLUM_CONST uint kPassAddUp = 1u;
VELLUM_CONST uint kPassDecide = 2u;
VELLUM_CONST uint kPassStage = 3u;
VELLUM_CONST uint kPassFinish = 4u;
VELLUM_CONST uint kPassKeep = 5u;            // before the build of a top-level structure
VELLUM_CONST uint kPassRestoreKept = 6u;     // after it
VELLUM_CONST uint kPassRestoreKeptLast = 7u; // after the driver's deserialization
struct StructureRestorePush {
    VELLUM_ADDRESS blob;
    VELLUM_ADDRESS staging; // plan (kPlanUnits), then the driver's data
    VELLUM_ADDRESS descriptor;
    VELLUM_ADDRESS begin; // of the structure
    VELLUM_ADDRESS root;
    VELLUM_ADDRESS fallback; // serialized by the driver; its first 32 bytes are the driver's UUIDs
    VELLUM_ADDRESS kept;     // copy of the memory that a wrong guess overwrites
    uint fallbackUnits;
    uint capacity;           // units in the source's buffer
    uint stagingUnits;       // of the driver's data
    uint targetUnits;        // of the structure
    uint kind;               // kDescriptorBottom or kDescriptorTop: expected; kDescriptorUnbuilt: the data states it
    uint keptUnits;          // capacity at `kept`
    uint fallbackBuiltUnits; // of a structure that the fallback is deserialized to
    uint topPath;            // 1: a top-level structure is built before the driver deserializes
    uint pass;               // kPass*
    uint serial;             // of this command
};

// structures/structure_size.comp
VELLUM_CONST uint kPropertyCompactedSize = 0u;
VELLUM_CONST uint kPropertySerializationSize = 1u;
VELLUM_CONST uint kPropertySize = 2u;
VELLUM_CONST uint kPropertyPointers = 3u;
struct StructureSizePush {
    VELLUM_ADDRESS descriptor;
    VELLUM_ADDRESS begin;
    VELLUM_ADDRESS value;
    uint structureUnits;
    uint property;    // kProperty*
    uint wholeCopies; // 1: the driver serializes whole structures, whatever was built in them
};

// structures/top_save.comp
struct TopSavePush {
    VELLUM_ADDRESS descriptor;
    VELLUM_ADDRESS begin;
    VELLUM_ADDRESS blob;
    VELLUM_ADDRESS root;
    VELLUM_ADDRESS fallback; // serialized by the driver: its first 32 bytes are the driver's UUIDs
    uint structureUnits;
    uint leastUnits; // of any top-level structure
    uint capacity;   // units in the destination's buffer
    uint pass;       // 0: headers, 1: instances
};

// pipelines/hit_records.comp. An invocation copies so many units of 16 bytes, or looks at so many copied records.
VELLUM_CONST uint kHitUnitsOfThread = 8u;
VELLUM_CONST uint kHitRecordsOfThread = 8u;
struct HitRecordsPush {
    VELLUM_ADDRESS source; // hit records; with a command, the address in it is used
    VELLUM_ADDRESS target;
    VELLUM_ADDRESS command; // 0: the table is given here
    VELLUM_ADDRESS commandCopy;
    VELLUM_ADDRESS standIn;      // a record with the handle of the layer's group
    VELLUM_ADDRESS recordOffset; // kGreatestRecordOffset
    uint size;                   // with a command, size and stride in it are used
    uint stride;                 // 0, or such that records do not overlap
    uint capacity;               // bytes at `target`
    uint reach;                  // greatest record index of a hit above its instance's record offset
    uint oneForAll;              // 1: the one record of a command's table may serve for all indices
    uint copied;                 // 1: the records are at `target` already
    uint first;                  // of copied records: those before are done
};

// khr_over_ext/micromap_triangles.comp
struct MicromapTrianglesPush {
    VELLUM_ADDRESS source; // VkMicromapTriangleKHR, each `stride` bytes
    VELLUM_ADDRESS target;
    uint stride;
    uint count;
    uint readable; // triangles inside their buffer
    uint shift;    // bytes between the data's address for the driver and its first byte
};

// khr_over_ext/marked_size.comp
struct MarkedSizePush {
    VELLUM_ADDRESS value; // a 64-bit number
};

// khr_over_ext/wide_indices.comp
struct WideIndicesPush {
    VELLUM_ADDRESS source; // 8-bit indices, `stride` bytes apart
    VELLUM_ADDRESS target;
    uint stride;
    uint count;
    uint readable; // indices inside their buffer
    uint unused;
};

// The location of a finding of validation in the log of core/findings.h.
struct FindingPush {
    VELLUM_ADDRESS log;
    VELLUM_ADDRESS object; // its handle
    uint bits;             // kFindingKhr, kFindingStructure
    uint site;             // the command, and the element of its infos
    uint geometry;
    uint padding;
};

// validation/usage_begin.comp
struct UsageBeginPush {
    VELLUM_ADDRESS counts;
    uint declared[26]; // for each usageKind()
};

// validation/triangle_check.comp
VELLUM_CONST uint kCheckedTriangles = 64u; // by each invocation
struct TriangleCheckPush {
    FindingPush finding;
    VELLUM_ADDRESS triangles;
    VELLUM_ADDRESS counts;
    uint stride;
    uint count;     // triangles inside their buffer
    uint dataBytes; // to the end of their buffer
    uint limits;    // kLimit*
    uint comparing; // 0: the triangles are checked and counted; 1: then the numbers are compared
    uint padding;
};

// validation/index_check.comp
struct IndexCheckPush {
    FindingPush finding;
    VELLUM_ADDRESS indices;
    VELLUM_ADDRESS record; // of the micromap
    VELLUM_ADDRESS range;  // indirect builds: a VkAccelerationStructureBuildRangeInfoKHR; 0: the build is direct
    uint triangleCount;
    uint indexBytes; // 1, 2 or 4; 0: the index is the triangle's number
    uint indexStride;
    uint readable; // indices inside their buffer
    uint baseTriangle;
    uint attached;         // 0: no micromap
    VELLUM_ADDRESS counts; // 0: the triangles are not counted
    uint declared;         // triangles by the usage counts
    uint comparing;        // 0: the indices are checked and counted; 1: then the numbers are compared
};

// validation/instance_check.comp
struct InstanceCheckPush {
    FindingPush finding;
    VELLUM_ADDRESS instances;
    VELLUM_ADDRESS records;
    VELLUM_ADDRESS references;
    VELLUM_ADDRESS range; // indirect builds: a VkAccelerationStructureBuildRangeInfoKHR; 0: the build is direct
    uint count;
    uint pointers;     // 1: an array of pointers to instances
    uint feature;      // 0: no micromap feature is enabled
    uint allowDisable; // build flag of structures whose micromaps instances may disable
};

// validation/instances_contents.comp
struct InstancesContentsPush {
    VELLUM_ADDRESS source; // instances, or pointers to them
    // The number of instances written, 0 before; a word of padding; their references; their masks.
    VELLUM_ADDRESS target;
    uint count;
    uint pointers; // 1: of pointers
};

// validation/index_kinds.comp
VELLUM_CONST uint kIndexKindSpecial = 1u;
VELLUM_CONST uint kIndexKindMicromap = 2u;
struct IndexKindsPush {
    VELLUM_ADDRESS source;
    VELLUM_ADDRESS target; // the number of indices read; kIndexKind*; both 0 before
    uint stride;
    uint count;
    uint bytes; // 1, 2 or 4
    uint unused;
};

// validation/deserialized_words.comp
VELLUM_CONST uint kDeserializedWordsAt = 2u; // in the target
struct DeserializedWordsPush {
    VELLUM_ADDRESS source;
    VELLUM_ADDRESS target; // how often it was written, 0 before; a word of padding; the words
    VELLUM_ADDRESS record; // of the target (findings.h): becomes that of a micromap, or states nothing
    uint count;
    uint unused;
};

VELLUM_SHARED_END

#undef VELLUM_ADDRESS
#undef VELLUM_UVEC4

#endif
