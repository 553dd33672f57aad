// libvellum: opacity micromaps from alpha textures. This is its whole interface, for C99 and everything that calls C;
// vellum/bake.h wraps it for C++20. It needs no other header, Vulkan's neither: numbers that Vulkan has an enumeration
// for are Vulkan's, so the values of either may be given.
//
//     VellumTexture texture;
//     vellumInitTexture(&texture, sizeof texture);
//     texture.texels = rgba; texture.texelsSize = 4 * width * height;
//     texture.width = width; texture.height = height;
//     texture.offset = 3; texture.pixelStride = 4;                     // the alpha of 8-bit RGBA
//     VellumBakeInput mesh;
//     vellumInitBakeInput(&mesh, sizeof mesh);
//     mesh.textures = &texture; mesh.textureCount = 1;
//     mesh.uvs = uvs; mesh.uvsSize = 8 * vertexCount;
//     mesh.indexType = VELLUM_INDEX_TYPE_UINT32; mesh.indices = indices; mesh.indicesSize = 12 * triangleCount;
//     mesh.triangleCount = triangleCount;
//     VellumMicromap *micromap;
//     VellumResult result = vellumBake(&mesh, 1, NULL, &micromap);
//
// WHAT A BAKE PROMISES
// A micro-triangle becomes opaque (transparent) if and only if the filtered alpha is on that side of the cutoff at
// every point of it, and at every point that a GPU's rounding may take for one of it (the tolerances of
// VellumBakeOptions). All others are unknown, so that a renderer that samples the texture for unknown micro-triangles
// draws the picture of one that samples it everywhere. docs/baking.md has the argument.
//
// VERSIONS OF STRUCTURES
// Every structure that is given or filled begins with structSize, its size as the caller knows it; vellumInit...() sets
// it and gives every other member its default. Later versions of the library add members at the end of structures, for
// which what older callers do not know has the default. A member that the caller knows, and the library in use does
// not, must be 0; otherwise the call fails with VELLUM_ERROR_UNSUPPORTED. The elements of an array of structures are
// structSize bytes apart, and that is the same for all of them.
//
// ERRORS
// Functions that can fail return a VellumResult: 0 is success, errors are negative. Of an error that a bake meets, the
// callback `message` of its options is told in one sentence which names the input and what is wrong with it. After an
// error nothing is left behind: no result, no memory, no thread. No exception leaves the library. Pointers are
// believed: memory that is said to be there must be there.
//
// LIFETIMES
// What is given to a function needs to stay only until it returns. What vellumGet...() points to belongs to the
// micromap, and lives until vellumDestroyMicromap().
//
// THREADS
// All functions may be called from any number of threads at a time, callbacks included; there is no global state. A
// micromap does not change once it is there: everything but its destruction may happen at the same time.
#ifndef VELLUM_VELLUM_H_
#define VELLUM_VELLUM_H_

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define VELLUM_API __attribute__((visibility("default")))
#else
#define VELLUM_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

// Encoded as Vulkan's versions are: major << 22 | minor << 12 | patch. Before 1.0, minor versions may break programs
// that were built with another one, and the library's soname has the minor version; from then on, major versions only.
#define VELLUM_MAKE_VERSION(major, minor, patch) ((major)*0x400000u + (minor)*0x1000u + (patch))
#define VELLUM_HEADER_VERSION VELLUM_MAKE_VERSION(0, 1, 0)

// Of the library in use; VELLUM_HEADER_VERSION is that of this header.
VELLUM_API uint32_t vellumGetVersion(void);

typedef enum VellumResult {
    VELLUM_SUCCESS = 0,
    VELLUM_CANCELLED = 1,               // a callback said so
    VELLUM_ERROR_INVALID_ARGUMENT = -1, // out of the range that is written beside it here
    VELLUM_ERROR_OUT_OF_MEMORY = -2,
    VELLUM_ERROR_TOO_LARGE = -3,   // the result would be larger than VellumBakeOptions::maxDataSize
    VELLUM_ERROR_UNSUPPORTED = -4, // a structure uses members that this version of the library does not know
    VELLUM_ERROR_INTERNAL = -5,    // a mistake of the library; the message says more
    VELLUM_ERROR_FILE = -6         // of vellum/gltf.h: a file is not there, cannot be written, or is wrong
} VellumResult;

// The name of a result, such as "VELLUM_ERROR_TOO_LARGE", or "unknown VellumResult"; never null.
VELLUM_API const char *vellumResultName(VellumResult result);

// ---------------------------------------------------------------------------------------------------------- textures

// VkFormat, of one channel's values in native byte order. Values of more channels are read by offset and pixelStride.
// Block-compressed textures are for the caller to decode.
typedef enum VellumFormat {
    VELLUM_FORMAT_R8_UNORM = 9,
    VELLUM_FORMAT_R16_UNORM = 70,
    VELLUM_FORMAT_R16_SFLOAT = 76,
    VELLUM_FORMAT_R16G16_UNORM = 77, // of texture coordinates, as the next but one
    VELLUM_FORMAT_R16G16_SFLOAT = 83,
    VELLUM_FORMAT_R32_SFLOAT = 100,
    VELLUM_FORMAT_R32G32_SFLOAT = 103
} VellumFormat;

// VkSamplerAddressMode
typedef enum VellumAddressMode {
    VELLUM_ADDRESS_MODE_REPEAT = 0,
    VELLUM_ADDRESS_MODE_MIRRORED_REPEAT = 1,
    VELLUM_ADDRESS_MODE_CLAMP_TO_EDGE = 2,
    VELLUM_ADDRESS_MODE_CLAMP_TO_BORDER = 3,
    VELLUM_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE = 4
} VellumAddressMode;

// VkFilter
typedef enum VellumFilter { VELLUM_FILTER_NEAREST = 0, VELLUM_FILTER_LINEAR = 1 } VellumFilter;

// The alpha of one image, or of one mip level of it, and how a sampler reads it.
//
// Texel (x, y) is at byte offset + y * rowStride + x * pixelStride of `texels`, aligned or not; row 0 is at v = 0. All
// of them must lie within texelsSize bytes. A texel that is not finite proves nothing: what it takes part in is
// unknown.
typedef struct VellumTexture {
    size_t structSize;
    const void *texels;
    size_t texelsSize;
    uint32_t width;        // 1 to 2^24
    uint32_t height;       // 1 to 2^24
    uint32_t format;       // a VellumFormat of one channel; default VELLUM_FORMAT_R8_UNORM
    uint32_t filter;       // a VellumFilter; default VELLUM_FILTER_LINEAR
    uint32_t addressModeU; // a VellumAddressMode; default VELLUM_ADDRESS_MODE_REPEAT
    uint32_t addressModeV;
    size_t offset;      // default 0; 3 for the alpha of 8-bit RGBA
    size_t pixelStride; // at least the bytes of a value; 0, the default, is as many
    size_t rowStride;   // at least width * pixelStride; 0, the default, is as many
    float scale;        // what the shader multiplies the alpha with, as glTF's baseColorFactor[3]; default 1
    float border;       // what CLAMP_TO_BORDER reads outside, before `scale`; default 0
} VellumTexture;

VELLUM_API void vellumInitTexture(VellumTexture *texture, size_t structSize);

// ------------------------------------------------------------------------------------------------------------ inputs

// VkIndexType
typedef enum VellumIndexType {
    VELLUM_INDEX_TYPE_UINT16 = 0,
    VELLUM_INDEX_TYPE_UINT32 = 1,
    VELLUM_INDEX_TYPE_NONE = 1000165000,
    VELLUM_INDEX_TYPE_UINT8 = 1000265000
} VellumIndexType;

// VkOpacityMicromapFormatKHR
typedef enum VellumMicromapFormat {
    VELLUM_MICROMAP_FORMAT_2_STATE = 1, // opaque or transparent
    VELLUM_MICROMAP_FORMAT_4_STATE = 2  // and two unknown states
} VellumMicromapFormat;

// Triangles that are alpha-tested with one texture and cutoff: what will be one geometry, or a part of one.
//
// Vertex i has its u and v one after the other at byte i * uvStride of `uvs`. Triangle t has the vertices 3 t, 3 t + 1
// and 3 t + 2, or those that the indices with these numbers name. Vertices and indices need no alignment. Any texture
// coordinates are safe: a triangle with some that are not finite, or further than 2^24 texels from the origin, is
// unknown; one without area is the segment or point that it is.
typedef struct VellumBakeInput {
    size_t structSize;
    // The mip levels that the sampler may read, largest first, at least one. A claim holds on each of them, and so for
    // whatever mixes two. Inputs whose textures are described by equal structures share the work of preparing them.
    const VellumTexture *textures;
    size_t textureCount;
    const void *uvs;
    size_t uvsSize;         // bytes
    size_t uvStride;        // at least the bytes of a u and a v; 0, the default, is as many
    const void *indices;    // null for VELLUM_INDEX_TYPE_NONE
    size_t indicesSize;     // bytes
    size_t triangleCount;   // may be 0; all inputs of a bake together have at most 2^28
    uint32_t uvFormat;      // a VellumFormat of two channels; default VELLUM_FORMAT_R32G32_SFLOAT
    uint32_t indexType;     // a VellumIndexType; default VELLUM_INDEX_TYPE_NONE
    float uvTransform[6];   // (u, v) becomes (m[0] u + m[1] v + m[2], m[3] u + m[4] v + m[5]); default: as it is
    const uint8_t *levels;  // a subdivision level, 0 to 12, for each triangle; null, the default: as the options say
    const uint8_t *formats; // a VellumMicromapFormat for each triangle; null, the default: as the options say
    double cutoff;          // what alpha is compared with, any number but NaN; default 0.5
} VellumBakeInput;

VELLUM_API void vellumInitBakeInput(VellumBakeInput *input, size_t structSize);

// ----------------------------------------------------------------------------------------------------------- options

// VkCompareOp: a sample is opaque where "alpha op cutoff" is true. These four of the eight.
typedef enum VellumCompareOp {
    VELLUM_COMPARE_OP_LESS = 1,
    VELLUM_COMPARE_OP_LESS_OR_EQUAL = 3,
    VELLUM_COMPARE_OP_GREATER = 4,
    VELLUM_COMPARE_OP_GREATER_OR_EQUAL = 6
} VellumCompareOp;

// What a micro-triangle that is not the same all over becomes in 2-state data.
typedef enum VellumTwoStateRule {
    VELLUM_TWO_STATE_NEAREST = 0,                // what most of it is
    VELLUM_TWO_STATE_UNKNOWN_IS_OPAQUE = 1,      // nothing opaque is lost
    VELLUM_TWO_STATE_UNKNOWN_IS_TRANSPARENT = 2, // nothing transparent is hit
} VellumTwoStateRule;

typedef enum VellumBakeFlagBits {
    // The triangles of one input have special indices only where all of them do, as
    // VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR demands of a geometry: triangles that
    // are one state all over get data of level 0 where any other triangle has data.
    VELLUM_BAKE_DISALLOW_MIXED_SPECIAL_INDICES_BIT = 1
} VellumBakeFlagBits;

#define VELLUM_LEVEL_AUTOMATIC (-1)
#define VELLUM_NO_BUDGET UINT64_MAX

// Callbacks get userData of the options. They must return (no longjmp, no exception), and may call this library.
//
// Why a bake ends with an error, in English and UTF-8; the string lives until the callback returns. Called at most
// once, from the thread that called vellumBake(), before that returns `result`.
typedef void (*VellumMessageCallback)(void *userData, VellumResult result, const char *message);
// How far a bake is: `done` triangles of `total` (with a budget, each counts twice). Called some hundred times at most,
// from any thread but one at a time. What it returns cancels the bake unless it is 0.
typedef int (*VellumProgressCallback)(void *userData, uint64_t done, uint64_t total);
// Whether to cancel the bake: not 0 if so. Called between triangles and now and then inside large ones, from several
// threads at a time; it should be as quick as reading an atomic variable.
typedef int (*VellumCancelCallback)(void *userData);

typedef struct VellumBakeOptions {
    size_t structSize;
    uint32_t format;       // a VellumMicromapFormat; default VELLUM_MICROMAP_FORMAT_4_STATE
    uint32_t twoStateRule; // a VellumTwoStateRule; default VELLUM_TWO_STATE_NEAREST
    // The subdivision level of triangles whose input has no levels: 0 to 12, or VELLUM_LEVEL_AUTOMATIC, the default,
    // for that at which the legs of micro-triangles are about texelsPerEdge texels long, but at most maxLevel.
    int32_t level;
    uint32_t maxLevel;    // 0 to 12; default 8
    double texelsPerEdge; // 0 or more, finite; default 4
    uint32_t compareOp;   // a VellumCompareOp; default VELLUM_COMPARE_OP_GREATER_OR_EQUAL
    uint32_t flags;       // VellumBakeFlagBits; default 0
    // Most bytes of data, with 8 for each micromap triangle. Levels are lowered where that makes the least known area
    // unknown, down to special indices, which are free. Default VELLUM_NO_BUDGET.
    uint64_t budget;
    // A 4-state triangle of which less than this share (0 to 1) is known gets a special index for unknown instead of
    // data. Default 0.
    double minKnown;

    // What a GPU may do differently from the mathematics, each 0 or more. With all four at 0, states are those of exact
    // arithmetic.
    double valueTolerance;         // how far a filtered value may be from the exact one; finite; default 2/255
    double subtexelTolerance;      // how far a sample may be from its place, in texels; to 1024; default 1/16
    double barycentricTolerance;   // how far a hit may lie outside its micro-triangle; to 1; default 1e-5
    double interpolationTolerance; // error of interpolated texture coordinates, as a part of the triangle's largest; to
                                   // 2^-10; default 2^-20

    // Most bytes of data, at which the bake gives up with VELLUM_ERROR_TOO_LARGE: at most 2^32 - 1; default 2^30.
    uint64_t maxDataSize;
    uint32_t threads;  // to work with, the calling one included; 0, the default: one per processor. At most 1024.
    uint32_t reserved; // 0
    VellumMessageCallback message; // each of these may be null, and is by default
    VellumProgressCallback progress;
    VellumCancelCallback cancelled;
    void *userData;
} VellumBakeOptions;

VELLUM_API void vellumInitBakeOptions(VellumBakeOptions *options, size_t structSize);

// ----------------------------------------------------------------------------------------------------------- results

// VkOpacityMicromapSpecialIndexKHR: the index of a triangle that is one state all over.
typedef enum VellumSpecialIndex {
    VELLUM_SPECIAL_INDEX_FULLY_TRANSPARENT = -1,
    VELLUM_SPECIAL_INDEX_FULLY_OPAQUE = -2,
    VELLUM_SPECIAL_INDEX_FULLY_UNKNOWN_TRANSPARENT = -3,
    VELLUM_SPECIAL_INDEX_FULLY_UNKNOWN_OPAQUE = -4
} VellumSpecialIndex;

// The states of 4-state data.
typedef enum VellumState {
    VELLUM_STATE_TRANSPARENT = 0,
    VELLUM_STATE_OPAQUE = 1,
    VELLUM_STATE_UNKNOWN_TRANSPARENT = 2, // more of it is transparent
    VELLUM_STATE_UNKNOWN_OPAQUE = 3
} VellumState;

// VkMicromapTriangleKHR (and EXT)
typedef struct VellumMicromapTriangle {
    uint32_t dataOffset;
    uint16_t subdivisionLevel;
    uint16_t format; // a VellumMicromapFormat
} VellumMicromapTriangle;

// VkMicromapUsageKHR (and EXT)
typedef struct VellumMicromapUsage {
    uint32_t count;
    uint32_t subdivisionLevel;
    uint32_t format; // a VellumMicromapFormat
} VellumMicromapUsage;

typedef struct VellumMicromap VellumMicromap;

// Bakes one micromap for the triangles of all inputs. Triangles with the same states share data, whatever their input.
// The result is the same for any number of threads.
//
//   inputs    inputCount structures; null only where there are none
//   options   null for the defaults, and no callbacks
//   micromap  where the result goes, for vellumDestroyMicromap(); null after an error
//
// Memory at its peak: the result, an eighth of it (256 KiB to 64 MiB) and a few MiB for each thread, for each texel of
// the textures 4 bytes and 2 bits (8 bytes and 2 bits with GREATER or LESS_OR_EQUAL), and about 200 bytes for each
// triangle, 350 with a budget.
VELLUM_API VellumResult vellumBake(const VellumBakeInput *inputs, size_t inputCount, const VellumBakeOptions *options,
                                   VellumMicromap **micromap);

// Does nothing for null.
VELLUM_API void vellumDestroyMicromap(VellumMicromap *micromap);

typedef struct VellumMicromapInfo {
    size_t structSize;
    // What a micromap build reads, ready to copy: data, triangles, and how many triangles there are of each format and
    // level, in this order.
    const uint8_t *data;
    size_t dataSize;
    const VellumMicromapTriangle *triangles;
    size_t triangleCount;
    const VellumMicromapUsage *usages;
    size_t usageCount;
    // For each triangle of all inputs, those of the first input first: a micromap triangle or a VellumSpecialIndex.
    const int32_t *indices;
    size_t indexCount;
    uint64_t stateCounts[4];   // micro-triangles of all triangles by VellumState, those of special indices included
    uint64_t specialCounts[4]; // triangles that are one state all over, by VellumState
    uint64_t distinctCount;    // triangles with different coordinates, textures, levels or formats
} VellumMicromapInfo;

// Fills `info`, whose structSize must be set; what the library does not know of it becomes 0.
// VELLUM_ERROR_INVALID_ARGUMENT: a null pointer, or a structSize of less than its first version's.
VELLUM_API VellumResult vellumGetMicromapInfo(const VellumMicromap *micromap, VellumMicromapInfo *info);

// The part of the result that a geometry made of one input needs.
typedef struct VellumGeometryInfo {
    size_t structSize;
    const int32_t *indices; // one for each triangle of the input, as in VellumMicromapInfo
    size_t indexCount;
    // How many of its triangles use micromap triangles of each format and level, for
    // VkAccelerationStructureTrianglesOpacityMicromapKHR (or EXT).
    const VellumMicromapUsage *usages;
    size_t usageCount;
} VellumGeometryInfo;

// As vellumGetMicromapInfo(). VELLUM_ERROR_INVALID_ARGUMENT also for an `input` that the bake did not have.
VELLUM_API VellumResult vellumGetGeometryInfo(const VellumMicromap *micromap, size_t input, VellumGeometryInfo *info);

// The state at a point of a triangle, as a ray that hits it there finds it.
//
//   triangle  0 to indexCount - 1
//   u, v      barycentrics, the weights of vertices 1 and 2; what is outside the triangle, or NaN, counts as a point of
//             its edge
//   state     where the VellumState goes
//
// VELLUM_ERROR_INVALID_ARGUMENT: a null pointer, or no such triangle.
VELLUM_API VellumResult vellumGetState(const VellumMicromap *micromap, size_t triangle, float u, float v,
                                       uint32_t *state);

#ifdef __cplusplus
}
#endif

#endif
