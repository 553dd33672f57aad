// SPDX-License-Identifier: Apache-2.0
// libvellum_gltf: reads, checks and bakes opacity micromaps in glTF files (EXT_mesh_opacity_micromap, a draft). In C99.
// The rules of vellum/vellum.h for structures, errors, callbacks and threads apply. It is a separate library because it
// depends on decoders: find_package(Vellum COMPONENTS Gltf) and Vellum::gltf, or pkg-config vellum-gltf.
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
// All strings, including paths, are UTF-8. Files are not trusted: what the functions return obeys every rule of the
// extension and can be passed to a micromap build as it is. A file that cannot be read or written, or is invalid, fails
// with VELLUM_ERROR_FILE and a message that names the file and the place in it; one that needs more memory than there
// is, with VELLUM_ERROR_OUT_OF_MEMORY.
//
// LIFETIMES
// Memory that vellumGetGltf...() returns belongs to the VellumGltf and is valid until vellumDestroyGltf(). The file is
// closed after reading. Arguments of callbacks are valid during the call.
#ifndef VELLUM_GLTF_H_
#define VELLUM_GLTF_H_

#include "vellum/vellum.h"

#ifdef __cplusplus
extern "C" {
#endif

// ----------------------------------------------------------------------------------------------------------- reading

typedef struct VellumGltf VellumGltf;

// Reads and checks the micromaps of a .glb or .gltf file. A file without micromaps is not an error.
//
//   message   called on error, as in VellumBakeOptions; may be null
//   userData  passed to the callback
//   gltf      receives the result, to be destroyed by vellumDestroyGltf(); null after an error
//
// VELLUM_ERROR_FILE also if a micromap breaks a rule of the extension; the message is the first finding.
VELLUM_API VellumResult VELLUM_CALL vellumReadGltf(const char *path, VellumMessageCallback message, void *userData,
                                                   VellumGltf **gltf);

// The same for the bytes of such a file in memory.
//
//   name  for messages, and the path to which files that a .gltf names are relative; not empty
VELLUM_API VellumResult VELLUM_CALL vellumReadGltfMemory(const void *bytes, size_t size, const char *name,
                                                         VellumMessageCallback message, void *userData,
                                                         VellumGltf **gltf);

// `gltf` may be null.
VELLUM_API void VELLUM_CALL vellumDestroyGltf(VellumGltf *gltf);

typedef struct VellumGltfInfo {
    size_t structSize;
    // The name in the file: "EXT_mesh_opacity_micromap", the earlier "KHR_mesh_opacity_micromap", or "" without
    // micromaps.
    const char *extension;
    size_t micromapCount;
    size_t primitiveCount; // primitives with a micromap
} VellumGltfInfo;

// Fills `info`, whose structSize must be set. Members that the library does not know become 0.
// VELLUM_ERROR_INVALID_ARGUMENT: a pointer is null, or structSize is smaller than in version 0.1. This applies to all
// vellumGetGltf...Info() functions.
VELLUM_API VellumResult VELLUM_CALL vellumGetGltfInfo(const VellumGltf *gltf, VellumGltfInfo *info);

// Input of a micromap build, ready to copy, as in VellumMicromapInfo.
typedef struct VellumGltfMicromapInfo {
    size_t structSize;
    const uint8_t *data;
    size_t dataSize;
    const VellumMicromapTriangle *triangles;
    size_t triangleCount;
    const VellumMicromapUsage *usages; // number of triangles by format and level
    size_t usageCount;
} VellumGltfMicromapInfo;

//   micromap  0 to micromapCount - 1, otherwise VELLUM_ERROR_INVALID_ARGUMENT
VELLUM_API VellumResult VELLUM_CALL vellumGetGltfMicromapInfo(const VellumGltf *gltf, size_t micromap,
                                                              VellumGltfMicromapInfo *info);

// Values that a geometry made of a primitive needs in addition to the micromap.
typedef struct VellumGltfPrimitiveInfo {
    size_t structSize;
    const char *name;   // for messages: mesh 2 "leaves" primitive 0
    uint32_t mesh;      // the primitive is meshes[mesh].primitives[primitive]
    uint32_t primitive; //
    size_t micromap;    // for vellumGetGltfMicromapInfo()
    // For each triangle: a VellumSpecialIndex, or an index to which baseTriangle is added.
    const int32_t *indices;
    size_t indexCount;
    // Number of its triangles with data, by format and level.
    const VellumMicromapUsage *usages;
    size_t usageCount;
    uint32_t baseTriangle;
    uint32_t reserved; // 0
} VellumGltfPrimitiveInfo;

// Primitives with a micromap are numbered in the order of meshes, and of primitives in a mesh.
//   number  0 to primitiveCount - 1, otherwise VELLUM_ERROR_INVALID_ARGUMENT
VELLUM_API VellumResult VELLUM_CALL vellumGetGltfPrimitiveInfo(const VellumGltf *gltf, size_t number,
                                                               VellumGltfPrimitiveInfo *info);

// Returns the number of meshes[mesh].primitives[primitive] for vellumGetGltfPrimitiveInfo(), or VELLUM_GLTF_NO_MICROMAP
// if it has no micromap, there is no such primitive, or `gltf` is null.
#define VELLUM_GLTF_NO_MICROMAP SIZE_MAX
VELLUM_API size_t VELLUM_CALL vellumFindGltfPrimitive(const VellumGltf *gltf, uint32_t mesh, uint32_t primitive);

// ---------------------------------------------------------------------------------------------------------- checking

// Something about a place in a file, for people: `mesh 2 "leaves" primitive 0` and a sentence.
typedef void(VELLUM_CALL *VellumGltfNoteCallback)(void *userData, const char *place, const char *note);

// Calls `finding` for whatever breaks a rule of the extension, at most `most` times, in the file's order, before it
// returns. Success, whether there are findings or not, if the file can be read.
//
//   message, userData  as vellumReadGltf(); userData is for both callbacks
VELLUM_API VellumResult VELLUM_CALL vellumCheckGltf(const char *path, size_t most, VellumGltfNoteCallback finding,
                                                    VellumMessageCallback message, void *userData);

// The same for the bytes of a file in memory, as vellumReadGltfMemory().
VELLUM_API VellumResult VELLUM_CALL vellumCheckGltfMemory(const void *bytes, size_t size, const char *name, size_t most,
                                                          VellumGltfNoteCallback finding, VellumMessageCallback message,
                                                          void *userData);

// ------------------------------------------------------------------------------------------------------------ baking

typedef enum VellumGltfBakeFlagBits {
    // Materials with alphaMode BLEND are also baked: opaque only where alpha is 1, transparent only where it is 0.
    VELLUM_GLTF_BAKE_BLEND_BIT = 1,
    // Micromaps of a .gltf are written into the file, in a data URI, instead of into a separate file.
    VELLUM_GLTF_BAKE_EMBED_BIT = 2,
    // With VELLUM_GLTF_BAKE_BLEND_BIT: they are baked as masks with the cutoff blendCutoff, which is wrong for
    // renderers that blend or dither.
    VELLUM_GLTF_BAKE_BLEND_CUTOFF_BIT = 4,
    // Textures with an image of an unsupported kind (KTX2, DDS) and another one are baked from the latter. The alpha of
    // the former, which renderers may take, differs.
    VELLUM_GLTF_BAKE_FALLBACK_IMAGES_BIT = 8,
    // The smallest micromaps that know the share targetKnown of the surface.
    VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT = 16,
    // Files that are copied to the folder of the output replace different ones of the same names, which other models in
    // it may name. Without it these are an error.
    VELLUM_GLTF_BAKE_REPLACE_COPIES_BIT = 32
} VellumGltfBakeFlagBits;

// A cache of the caller's, such as the derived-data cache of an engine: values of a few kilobytes by keys of
// VELLUM_GLTF_CACHE_KEY_SIZE bytes. vellumBakeGltf() asks for the result of each micromap before it bakes it, or with a
// budget or targetKnown, which all micromaps share, for the results of the whole file at once. A result that is found
// costs neither decoding an image nor baking, and the output has the same bytes.
//
// The key is a digest (SHA-256) of all that a result depends on: vellumGetBakeVersion(), the members of
// VellumBakeOptions that matter to it, the image as it is stored, the sampler, the factors of alpha, the cutoff, and
// the texture coordinates of each triangle; with a budget or targetKnown, also of the area of each triangle in the
// scene. So equal parts of different files have one key, and names, other meshes, `threads` and callbacks are not in
// it. Values have a checksum: one that was damaged, or put with another key, is baked again. Nothing protects against
// someone who forges values on purpose.
//
// Both are called on the thread that called vellumBakeGltf(), and return normally, as all callbacks. They cannot fail:
// a value that cannot be read is not there, and one that cannot be written is not kept.
#define VELLUM_GLTF_CACHE_KEY_SIZE 32
// Takes the value that is found, at most once in each VellumGltfCacheGetCallback. It is copied: `value` needs to be
// valid during this call only.
typedef void(VELLUM_CALL *VellumGltfCacheValueCallback)(void *receiver, const void *value, size_t size);
// Looks a key up. Calls found(receiver, value, size) before it returns if there is a value; otherwise not.
typedef void(VELLUM_CALL *VellumGltfCacheGetCallback)(void *userData, const uint8_t *key,
                                                      VellumGltfCacheValueCallback found, void *receiver);
// Keeps a value for a key, in place of an earlier one. Both are valid during the call.
typedef void(VELLUM_CALL *VellumGltfCachePutCallback)(void *userData, const uint8_t *key, const void *value,
                                                      size_t size);

typedef struct VellumGltfBakeOptions {
    size_t structSize;
    uint32_t flags;    // VellumGltfBakeFlagBits; default 0
    float blendCutoff; // for VELLUM_GLTF_BAKE_BLEND_CUTOFF_BIT; finite; default 0.5
    // Primitives whose material or mesh has a name that matches one of these are not baked. Shell patterns: * ? [...].
    const char *const *excludedMaterials;
    size_t excludedMaterialCount;
    const char *const *excludedMeshes;
    size_t excludedMeshCount;
    // Called for every alpha-tested primitive that got no micromap, with the reason, once the output is written. With
    // userData of the VellumBakeOptions. May be null; default null.
    VellumGltfNoteCallback skipped;
    // A cache, with userData of the VellumBakeOptions. Each may be null; default null.
    VellumGltfCacheGetCallback cacheGet;
    VellumGltfCachePutCallback cachePut;
    // For VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT, as --target-known of the command: the share of the file's alpha-tested
    // surface that is opaque or transparent, 0 to 1. Levels are lowered, and automatic ones raised, for the smallest
    // micromaps that know so much. A file of which no levels do fails with VELLUM_ERROR_FILE; the message has the share
    // that they know. Not with a budget or 2 states, which leave nothing unknown. Default 1.
    double targetKnown;
} VellumGltfBakeOptions;

VELLUM_API void VELLUM_CALL vellumInitGltfBakeOptions(VellumGltfBakeOptions *options, size_t structSize);

// Statistics of vellumBakeGltf().
typedef struct VellumGltfBakeInfo {
    size_t structSize;
    size_t micromapCount;  // one for each image, sampler, factor and cutoff
    size_t primitiveCount; // primitives that got a micromap
    size_t skippedCount;   // alpha-tested primitives that did not
    uint64_t micromapSize; // bytes of micromap data, with 8 for each micromap triangle
    uint64_t inputSize;    // bytes of the input, without files that it refers to
    uint64_t outputSize;   // bytes of the output, with its file of micromaps
    uint32_t replaced;     // 1 if the input had micromaps, all of which were replaced or removed; otherwise 0
    uint32_t reserved;     // 0
    size_t cacheHits;      // results that cacheGet found
    size_t cacheMisses;    // results that were baked although there is a cache
} VellumGltfBakeInfo;

// Bakes the alpha-tested primitives of a glTF file and writes the file with their micromaps; everything else stays byte
// for byte. The input is never modified, and the output appears whole or not at all. docs/gltf.md says what is baked.
//
//   input, output  paths of two different files, both .glb or both .gltf. Micromaps of tree.gltf are written to
//                  tree.omm-<digest>.bin in the folder of the output; files that a .gltf refers to are copied there if
//                  it is another folder. An existing output is replaced.
//   bake           null for the defaults without callbacks. The cutoff is that of the material. compareOp must be
//                  VELLUM_COMPARE_OP_GREATER_OR_EQUAL, and flags 0. The budget is for the whole file, maxDataSize for
//                  each micromap, or, with a budget, for all of them.
//   options        null for the defaults
//   info           receives statistics if not null; structSize must be set. Unchanged after an error.
//
// Returns VELLUM_SUCCESS, VELLUM_CANCELLED or an error. A file without anything to bake is copied.
VELLUM_API VellumResult VELLUM_CALL vellumBakeGltf(const char *input, const char *output, const VellumBakeOptions *bake,
                                                   const VellumGltfBakeOptions *options, VellumGltfBakeInfo *info);

// Takes the next bytes of an output, which are valid during the call.
typedef void(VELLUM_CALL *VellumGltfOutputCallback)(void *userData, const void *bytes, size_t size);

// The same for a file in memory: calls `output` with the parts of the output, in order, on the thread that called. A
// .glb becomes a .glb, and a .gltf a .gltf with its micromaps inside (VELLUM_GLTF_BAKE_EMBED_BIT). Nothing is copied.
//
//   bytes, size, name  as vellumReadGltfMemory()
//   output             with userData of `bake`; not called after an error
VELLUM_API VellumResult VELLUM_CALL vellumBakeGltfMemory(const void *bytes, size_t size, const char *name,
                                                         const VellumBakeOptions *bake,
                                                         const VellumGltfBakeOptions *options,
                                                         VellumGltfOutputCallback output, VellumGltfBakeInfo *info);

#ifdef __cplusplus
}
#endif

#endif
