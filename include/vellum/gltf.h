// libvellum's part for glTF files: reads the opacity micromaps that a file has by EXT_mesh_opacity_micromap, and bakes
// them into files. For C99 and everything that calls C, as vellum/vellum.h, whose rules for structures, errors and
// callbacks hold here, too. It is a library of its own, libvellum_gltf, as it needs other libraries to read glTF:
// find_package(Vellum COMPONENTS Gltf) and Vellum::gltf, or pkg-config vellum-gltf.
//
//     VellumGltf *file;
//     VellumResult result = vellumReadGltf("tree.omm.glb", onMessage, NULL, &file);
//     VellumGltfInfo info = {sizeof info};
//     vellumGetGltfInfo(file, &info);
//     for (size_t i = 0; i < info.primitiveCount; ++i) {
//         VellumGltfPrimitiveInfo primitive = {sizeof primitive};
//         vellumGetGltfPrimitiveInfo(file, i, &primitive); // the indices of meshes[mesh].primitives[primitive]
//     }
//     vellumDestroyGltf(file);
//
// FILES
// Paths and all other strings are UTF-8; paths are relative to the current folder. Files are not trusted: whatever is
// in one, what is read of it obeys every rule of the extension, and so may go to a micromap build as it is. Files that
// cannot be read or written, and files that are not what they should be, are VELLUM_ERROR_FILE, with a message that
// names the file and the place in it. So is one that takes more memory to read than there is.
//
// LIFETIMES
// What vellumGetGltf...() points to belongs to the VellumGltf, and lives until vellumDestroyGltf(). The file itself
// is not kept open. What callbacks are given lives until they return.
//
// THREADS
// All functions may be called from any number of threads at a time; there is no global state. A VellumGltf does not
// change once it is there: everything but its destruction may happen at the same time.
#ifndef VELLUM_GLTF_H_
#define VELLUM_GLTF_H_

#include "vellum/vellum.h"

#ifdef __cplusplus
extern "C" {
#endif

// ----------------------------------------------------------------------------------------------------------- reading

typedef struct VellumGltf VellumGltf;

// Reads the micromaps of a .glb or .gltf file and checks them. A file without any is read, too, and has 0 of them.
//
//   message   told of an error, as that of VellumBakeOptions is; may be null
//   userData  for the callback
//   gltf      where the result goes, for vellumDestroyGltf(); null after an error
//
// VELLUM_ERROR_FILE also for micromaps that break a rule of the extension: the message is the first finding.
VELLUM_API VellumResult vellumReadGltf(const char *path, VellumMessageCallback message, void *userData,
                                       VellumGltf **gltf);

// Does nothing for null.
VELLUM_API void vellumDestroyGltf(VellumGltf *gltf);

typedef struct VellumGltfInfo {
    size_t structSize;
    // The spelling that the file has: "EXT_mesh_opacity_micromap", or its earlier name "KHR_mesh_opacity_micromap"; ""
    // where it has none.
    const char *extension;
    size_t micromapCount;
    size_t primitiveCount; // primitives that have a micromap
} VellumGltfInfo;

// Fills `info`, whose structSize must be set; what the library does not know of it becomes 0.
// VELLUM_ERROR_INVALID_ARGUMENT: a null pointer, or a structSize of less than its first version's. Both hold for all
// functions of this kind.
VELLUM_API VellumResult vellumGetGltfInfo(const VellumGltf *gltf, VellumGltfInfo *info);

// What a micromap build reads, ready to copy.
typedef struct VellumGltfMicromapInfo {
    size_t structSize;
    const uint8_t *data;
    size_t dataSize;
    const VellumMicromapTriangle *triangles;
    size_t triangleCount;
    const VellumMicromapUsage *usages; // how many triangles there are of each format and level, in this order
    size_t usageCount;
} VellumGltfMicromapInfo;

// VELLUM_ERROR_INVALID_ARGUMENT also for a `micromap` that is not less than micromapCount.
VELLUM_API VellumResult vellumGetGltfMicromapInfo(const VellumGltf *gltf, size_t micromap,
                                                  VellumGltfMicromapInfo *info);

// What a geometry that is made of a primitive needs, beside the micromap.
typedef struct VellumGltfPrimitiveInfo {
    size_t structSize;
    const char *name;   // for messages: mesh 2 "leaves" primitive 0
    uint32_t mesh;      // it is meshes[mesh].primitives[primitive]
    uint32_t primitive; //
    size_t micromap;    // for vellumGetGltfMicromapInfo()
    // For each of its triangles a VellumSpecialIndex, or a triangle of the micromap less baseTriangle.
    const int32_t *indices;
    size_t indexCount;
    // How many of its triangles use triangles of the micromap of each format and level.
    const VellumMicromapUsage *usages;
    size_t usageCount;
    uint32_t baseTriangle;
    uint32_t reserved; // 0
} VellumGltfPrimitiveInfo;

// Primitives with a micromap are numbered in the order of the file's meshes, and of the primitives in them.
// VELLUM_ERROR_INVALID_ARGUMENT also for a `number` that is not less than primitiveCount.
VELLUM_API VellumResult vellumGetGltfPrimitiveInfo(const VellumGltf *gltf, size_t number,
                                                   VellumGltfPrimitiveInfo *info);

// The number of meshes[mesh].primitives[primitive] for vellumGetGltfPrimitiveInfo(); VELLUM_GLTF_NO_MICROMAP where it
// has no micromap, where there is no such primitive, and where `gltf` is null.
#define VELLUM_GLTF_NO_MICROMAP SIZE_MAX
VELLUM_API size_t vellumFindGltfPrimitive(const VellumGltf *gltf, uint32_t mesh, uint32_t primitive);

// ---------------------------------------------------------------------------------------------------------- checking

// One thing about a place in a file: `mesh 2 "leaves" primitive 0` and a sentence, both for people.
typedef void (*VellumGltfNoteCallback)(void *userData, const char *place, const char *note);

// Calls `finding` for whatever breaks a rule of the extension, at most `most` times, in the file's order, before it
// returns. Success, whether there are findings or not, if the file can be read.
//
//   message, userData  as vellumReadGltf(); userData is for both callbacks
VELLUM_API VellumResult vellumCheckGltf(const char *path, size_t most, VellumGltfNoteCallback finding,
                                        VellumMessageCallback message, void *userData);

// ------------------------------------------------------------------------------------------------------------ baking

typedef enum VellumGltfBakeFlagBits {
    // Materials with the alphaMode BLEND are baked, too: opaque only where alpha is 1, transparent only where it is 0.
    VELLUM_GLTF_BAKE_BLEND_BIT = 1,
    // The micromaps of a .gltf go into the file itself, in a data URI, instead of into a file beside it.
    VELLUM_GLTF_BAKE_EMBED_BIT = 2,
    // With VELLUM_GLTF_BAKE_BLEND_BIT: as masks with the cutoff blendCutoff, which is wrong for renderers that blend or
    // dither.
    VELLUM_GLTF_BAKE_BLEND_CUTOFF_BIT = 4
} VellumGltfBakeFlagBits;

typedef struct VellumGltfBakeOptions {
    size_t structSize;
    uint32_t flags;    // VellumGltfBakeFlagBits; default 0
    float blendCutoff; // any number but NaN; default 0.5; used with VELLUM_GLTF_BAKE_BLEND_CUTOFF_BIT
    // Primitives whose material or mesh has a name that matches one of these are not baked. Shell patterns: * ? [...].
    const char *const *excludedMaterials;
    size_t excludedMaterialCount;
    const char *const *excludedMeshes;
    size_t excludedMeshCount;
    // Called for every alpha-tested primitive that got no micromap, with the reason, once the output is written. With
    // userData of the VellumBakeOptions. May be null; default null.
    VellumGltfNoteCallback skipped;
} VellumGltfBakeOptions;

VELLUM_API void vellumInitGltfBakeOptions(VellumGltfBakeOptions *options, size_t structSize);

// What vellumBakeGltf() did.
typedef struct VellumGltfBakeInfo {
    size_t structSize;
    size_t micromapCount;  // one for all primitives whose alpha is read the same way
    size_t primitiveCount; // that got a micromap
    size_t skippedCount;   // alpha-tested primitives that did not
    uint64_t micromapSize; // bytes of micromap data, with 8 for each micromap triangle
    uint64_t inputSize;    // bytes of the input, without what is beside it
    uint64_t outputSize;   // of the output, with the file of micromaps beside it
    uint32_t replaced;     // 1 where the input had micromaps, which are not in the output; else 0
    uint32_t reserved;     // 0
} VellumGltfBakeInfo;

// Bakes the alpha-tested primitives of a glTF file and writes the file with their micromaps; everything else in it
// stays as it was. The input is never written, and the output is all there or not at all. docs/gltf.md says what is
// baked.
//
//   input, output  paths of two different files; .glb becomes .glb, and .gltf becomes .gltf. The micromaps of
//                  tree.gltf lie beside it, in tree.omm-<hash of them>.bin; what a .gltf names beside it is copied
//                  where the output is in another folder. An output that is there is replaced.
//   bake           null for the defaults, and no callbacks. The cutoff is the material's. compareOp must be
//                  VELLUM_COMPARE_OP_GREATER_OR_EQUAL, which is glTF's, and flags 0. The budget is for the whole file,
//                  maxDataSize for each micromap, or, with a budget, for all of them.
//   options        null for the defaults
//   info           what was done, with structSize set; may be null. Not changed after an error.
VELLUM_API VellumResult vellumBakeGltf(const char *input, const char *output, const VellumBakeOptions *bake,
                                       const VellumGltfBakeOptions *options, VellumGltfBakeInfo *info);

#ifdef __cplusplus
}
#endif

#endif
