// SPDX-License-Identifier: Apache-2.0
// libvellum: opacity micromaps from alpha textures. This is the whole interface, in C99; vellum/bake.h wraps it for
// C++20. It includes no other headers. Enumerations have the values of Vulkan's, so either may be passed.
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
// THE PROMISE
// A micro-triangle is opaque (transparent) if and only if the filtered alpha is on that side of the cutoff at every
// point of it, and at every point that a GPU's rounding may sample for it (the tolerances of VellumBakeOptions). All
// others are unknown. A renderer that samples the texture for unknown micro-triangles therefore draws the same picture
// as one that samples it everywhere. See docs/baking.md; docs/design/baker.md has the argument.
//
// VERSIONS OF STRUCTURES
// Every structure begins with structSize, its size as the caller was compiled with; vellumInit...() sets it, and every
// other member to its default. Later versions of the library append members, which have their defaults for callers that
// do not know them. Members that the library does not know must be 0; otherwise the call fails with
// VELLUM_ERROR_UNSUPPORTED. All elements of an array of structures must have the same structSize, which is its stride.
//
// ERRORS
// Functions that can fail return a VellumResult: 0 is success, negative values are errors. On error, the callback
// `message` of the options is called with one sentence that names the argument and what is wrong. An error leaves no
// result, memory or thread behind. No exception leaves the library. Pointers are not validated: they must point to as
// many bytes as the sizes say.
//
// LIFETIMES
// Arguments are read only during the call. Memory that vellumGet...() returns belongs to the micromap and is valid
// until vellumDestroyMicromap().
//
// THREADS
// All functions may be called from any number of threads at the same time, and from callbacks. There is no global
// state. A micromap is immutable: threads may read it at the same time; destroying it must not overlap with other use.
#ifndef VELLUM_VELLUM_H_
#define VELLUM_VELLUM_H_

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__) && !defined(_WIN32) // where the linker has a list
#define VELLUM_API __attribute__((visibility("default")))
#else
#define VELLUM_API
#endif

// The calling convention of functions and callbacks, whatever the default of a compiler is (/Gv, /Gr, /Gz).
#if defined(_WIN32)
#define VELLUM_CALL __cdecl
#else
#define VELLUM_CALL
#endif

#ifdef __cplusplus
extern "C" {
#endif

// Encoded as Vulkan versions: major << 22 | minor << 12 | patch. Before 1.0, a new minor version may break programs
// built with another one, and has its own soname; from 1.0 on, only a new major version may.
#define VELLUM_MAKE_VERSION(major, minor, patch) ((major)*0x400000u + (minor)*0x1000u + (patch))
#define VELLUM_HEADER_VERSION VELLUM_MAKE_VERSION(0, 1, 0)

// Returns the version of the library in use; VELLUM_HEADER_VERSION is that of this header.
VELLUM_API uint32_t VELLUM_CALL vellumGetVersion(void);

// Returns a number that is higher in every version of the library whose results for the same arguments may differ from
// those of earlier ones. Caches of results need it in their keys.
VELLUM_API uint32_t VELLUM_CALL vellumGetBakeVersion(void);

typedef enum VellumResult {
    VELLUM_SUCCESS = 0,
    VELLUM_CANCELLED = 1,               // a callback cancelled the call
    VELLUM_ERROR_INVALID_ARGUMENT = -1, // outside of the range given here
    VELLUM_ERROR_OUT_OF_MEMORY = -2,
    VELLUM_ERROR_TOO_LARGE = -3,   // the result would exceed VellumBakeOptions::maxDataSize
    VELLUM_ERROR_UNSUPPORTED = -4, // a structure sets members that this version of the library does not know
    VELLUM_ERROR_INTERNAL = -5,    // a bug in the library; the message has details
    VELLUM_ERROR_FILE = -6         // vellum/gltf.h only: a file is missing, invalid, or cannot be written
} VellumResult;

// Returns the name of a result, such as "VELLUM_ERROR_TOO_LARGE", or "unknown VellumResult". Never null.
VELLUM_API const char *VELLUM_CALL vellumResultName(VellumResult result);

// ---------------------------------------------------------------------------------------------------------- textures

// Formats with the values of VkFormat: components in native byte order. To read one channel of several, set offset and
// pixelStride. Block-compressed textures must be decoded by the caller.
typedef enum VellumFormat {
    VELLUM_FORMAT_R8_UNORM = 9,
    VELLUM_FORMAT_R16_UNORM = 70,
    VELLUM_FORMAT_R16_SFLOAT = 76,
    VELLUM_FORMAT_R16G16_UNORM = 77, // formats of two channels are for texture coordinates
    VELLUM_FORMAT_R16G16_SFLOAT = 83,
    VELLUM_FORMAT_R32_SFLOAT = 100,
    VELLUM_FORMAT_R32G32_SFLOAT = 103
} VellumFormat;

// Values of VkSamplerAddressMode.
typedef enum VellumAddressMode {
    VELLUM_ADDRESS_MODE_REPEAT = 0,
    VELLUM_ADDRESS_MODE_MIRRORED_REPEAT = 1,
    VELLUM_ADDRESS_MODE_CLAMP_TO_EDGE = 2,
    VELLUM_ADDRESS_MODE_CLAMP_TO_BORDER = 3,
    VELLUM_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE = 4
} VellumAddressMode;

// Values of VkFilter.
typedef enum VellumFilter { VELLUM_FILTER_NEAREST = 0, VELLUM_FILTER_LINEAR = 1 } VellumFilter;

// The alpha of one mip level of an image, and how a sampler reads it.
//
// Texel (x, y) is at byte offset + y * rowStride + x * pixelStride of `texels`, with any alignment; row 0 is at v = 0.
// All texels must be within texelsSize bytes. Those of 8 bits are read where they are, by any thread and more than
// once: they must not change during a bake, and memory that is slow to read should be copied. Micro-triangles that a
// texel that is not finite contributes to are unknown.
typedef struct VellumTexture {
    size_t structSize;
    const void *texels;
    size_t texelsSize;
    uint32_t width;        // texels, 1 to 2^24
    uint32_t height;       // texels, 1 to 2^24
    uint32_t format;       // a VellumFormat of one channel; default VELLUM_FORMAT_R8_UNORM
    uint32_t filter;       // a VellumFilter; default VELLUM_FILTER_LINEAR
    uint32_t addressModeU; // a VellumAddressMode; default VELLUM_ADDRESS_MODE_REPEAT
    uint32_t addressModeV;
    size_t offset;      // bytes; default 0; 3 for the alpha of 8-bit RGBA
    size_t pixelStride; // bytes, at least those of a value; 0, the default: exactly those
    size_t rowStride;   // bytes, at least width * pixelStride; 0, the default: exactly that
    float scale;        // factor on alpha in the shader, such as glTF's baseColorFactor[3]; default 1
    float border;       // alpha outside of the texture with CLAMP_TO_BORDER, before `scale`; default 0
} VellumTexture;

VELLUM_API void VELLUM_CALL vellumInitTexture(VellumTexture *texture, size_t structSize);

// ------------------------------------------------------------------------------------------------------------ inputs

// Values of VkIndexType.
typedef enum VellumIndexType {
    VELLUM_INDEX_TYPE_UINT16 = 0,
    VELLUM_INDEX_TYPE_UINT32 = 1,
    VELLUM_INDEX_TYPE_NONE = 1000165000,
    VELLUM_INDEX_TYPE_UINT8 = 1000265000
} VellumIndexType;

// Values of VkOpacityMicromapFormatKHR.
typedef enum VellumMicromapFormat {
    VELLUM_MICROMAP_FORMAT_2_STATE = 1, // opaque or transparent
    VELLUM_MICROMAP_FORMAT_4_STATE = 2  // opaque, transparent, and two unknown states
} VellumMicromapFormat;

// Triangles that are alpha-tested with one texture and cutoff: a geometry, or part of one.
//
// u and v of vertex i are at byte i * uvStride of `uvs`. Triangle t has the vertices 3 t, 3 t + 1 and 3 t + 2, or,
// with indices, the vertices that indices 3 t, 3 t + 1 and 3 t + 2 select. Neither needs alignment. All texture
// coordinates are allowed: a triangle with coordinates that are not finite, or 2^24 texels and more from the origin,
// is unknown; one without area is treated as the segment or point that it is.
typedef struct VellumBakeInput {
    size_t structSize;
    // The mip levels that the sampler may read, largest first; at least one. A state holds for each of them, and thus
    // for trilinear filtering between them. A texture that several inputs describe by equal structures is prepared
    // once.
    const VellumTexture *textures;
    size_t textureCount;
    const void *uvs;
    size_t uvsSize;         // bytes
    size_t uvStride;        // bytes, at least those of u and v; 0, the default: exactly those
    const void *indices;    // null for VELLUM_INDEX_TYPE_NONE
    size_t indicesSize;     // bytes
    size_t triangleCount;   // may be 0; at most 2^28 for all inputs of a bake together
    uint32_t uvFormat;      // a VellumFormat of two channels; default VELLUM_FORMAT_R32G32_SFLOAT
    uint32_t indexType;     // a VellumIndexType; default VELLUM_INDEX_TYPE_NONE
    float uvTransform[6];   // (u, v) becomes (m[0] u + m[1] v + m[2], m[3] u + m[4] v + m[5]); default: identity
    const uint8_t *levels;  // subdivision level of each triangle, 0 to 12; null, the default: that of the options
    const uint8_t *formats; // VellumMicromapFormat of each triangle; null, the default: that of the options
    double cutoff;          // alpha is compared with it; not NaN; default 0.5
} VellumBakeInput;

VELLUM_API void VELLUM_CALL vellumInitBakeInput(VellumBakeInput *input, size_t structSize);

// ----------------------------------------------------------------------------------------------------------- options

// Four values of VkCompareOp; the others are not supported. A sample is opaque if "alpha op cutoff" is true.
typedef enum VellumCompareOp {
    VELLUM_COMPARE_OP_LESS = 1,
    VELLUM_COMPARE_OP_LESS_OR_EQUAL = 3,
    VELLUM_COMPARE_OP_GREATER = 4,
    VELLUM_COMPARE_OP_GREATER_OR_EQUAL = 6
} VellumCompareOp;

// The state of a micro-triangle in 2-state data if the alpha test has both outcomes in it.
typedef enum VellumTwoStateRule {
    VELLUM_TWO_STATE_NEAREST = 0,                // that of the larger area
    VELLUM_TWO_STATE_UNKNOWN_IS_OPAQUE = 1,      // rays hit everything that is opaque
    VELLUM_TWO_STATE_UNKNOWN_IS_TRANSPARENT = 2, // rays hit nothing that is transparent
} VellumTwoStateRule;

typedef enum VellumBakeFlagBits {
    // Either all triangles of an input have special indices or none has, as a geometry requires with
    // VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR. If any triangle needs data, those of
    // one state get data of level 0.
    VELLUM_BAKE_DISALLOW_MIXED_SPECIAL_INDICES_BIT = 1
} VellumBakeFlagBits;

#define VELLUM_LEVEL_AUTOMATIC (-1)
#define VELLUM_NO_BUDGET UINT64_MAX

// Callbacks are passed userData of the options. They must return normally (no longjmp, no exception), and may call the
// library.
//
// Describes an error in one sentence, in English and UTF-8; the string is valid during the call. Called at most once,
// on the thread that called vellumBake(), before that returns `result`.
typedef void(VELLUM_CALL *VellumMessageCallback)(void *userData, VellumResult result, const char *message);
// Reports progress: `done` of `total` triangles (with a budget, each counts twice in vellumBake()). Called a few hundred
// times at most, on any thread, but never on two at the same time. A result other than 0 cancels the bake.
typedef int(VELLUM_CALL *VellumProgressCallback)(void *userData, uint64_t done, uint64_t total);
// Returns other than 0 to cancel the bake. Called between triangles and inside large ones, on several threads at the
// same time; it should cost no more than reading an atomic variable.
typedef int(VELLUM_CALL *VellumCancelCallback)(void *userData);

// A VellumCancelCallback for languages whose own callbacks are slow: returns other than 0 once the int32_t at userData
// is not 0, which another thread may write at any time. Null is like 0.
VELLUM_API int VELLUM_CALL vellumIsFlagSet(void *userData);

typedef struct VellumBakeOptions {
    size_t structSize;
    uint32_t format;       // a VellumMicromapFormat; default VELLUM_MICROMAP_FORMAT_4_STATE
    uint32_t twoStateRule; // a VellumTwoStateRule; default VELLUM_TWO_STATE_NEAREST
    // Subdivision level of triangles whose input has no `levels`: 0 to 12, or VELLUM_LEVEL_AUTOMATIC, the default: the
    // level at which the edges of micro-triangles are about texelsPerEdge texels long, at most maxLevel.
    int32_t level;
    uint32_t maxLevel;    // 0 to 12; default 8
    double texelsPerEdge; // 0 or more, finite; default 4
    uint32_t compareOp;   // a VellumCompareOp; default VELLUM_COMPARE_OP_GREATER_OR_EQUAL
    uint32_t flags;       // VellumBakeFlagBits; default 0
    // Largest size of data plus 8 bytes for each micromap triangle. Levels are lowered where that makes the least known
    // area unknown per byte, down to special indices, which take no data; if bytes are left, automatic levels are
    // raised where that makes the most known, by at most 3 and up to maxLevel. Default VELLUM_NO_BUDGET.
    uint64_t budget;
    // A 4-state triangle of which less than this share (0 to 1) is known gets a special index for unknown instead of
    // data. Default 0.
    double minKnown;

    // Bounds of a GPU's rounding errors, each 0 or more. With all four at 0, states are those of exact arithmetic.
    double valueTolerance;         // of a filtered value; finite; default 2/255
    double subtexelTolerance;      // of a sample's position, in texels; at most 1024; default 1/16
    double barycentricTolerance;   // of a hit's position, in barycentrics; at most 1; default 1e-5
    double interpolationTolerance; // of interpolated texture coordinates, relative to the largest of the triangle; at
                                   // most 2^-10; default 2^-20

    // Largest size of data in bytes; a larger result fails with VELLUM_ERROR_TOO_LARGE. At most 2^32 - 1; default 2^30.
    uint64_t maxDataSize;
    uint32_t threads;              // including the calling one, at most 1024; 0, the default: one per processor
    uint32_t reserved;             // 0
    VellumMessageCallback message; // each callback may be null, the default
    VellumProgressCallback progress;
    VellumCancelCallback cancelled;
    void *userData;
} VellumBakeOptions;

VELLUM_API void VELLUM_CALL vellumInitBakeOptions(VellumBakeOptions *options, size_t structSize);

// ----------------------------------------------------------------------------------------------------------- results

// Values of VkOpacityMicromapSpecialIndexKHR: the index of a triangle that has one state and no data.
typedef enum VellumSpecialIndex {
    VELLUM_SPECIAL_INDEX_FULLY_TRANSPARENT = -1,
    VELLUM_SPECIAL_INDEX_FULLY_OPAQUE = -2,
    VELLUM_SPECIAL_INDEX_FULLY_UNKNOWN_TRANSPARENT = -3,
    VELLUM_SPECIAL_INDEX_FULLY_UNKNOWN_OPAQUE = -4
} VellumSpecialIndex;

// The states of 4-state data, 2 bits each; 2-state data has the first two, 1 bit each.
typedef enum VellumState {
    VELLUM_STATE_TRANSPARENT = 0,
    VELLUM_STATE_OPAQUE = 1,
    VELLUM_STATE_UNKNOWN_TRANSPARENT = 2, // more transparent than opaque, by area
    VELLUM_STATE_UNKNOWN_OPAQUE = 3
} VellumState;

// Same layout as VkMicromapTriangleKHR and VkMicromapTriangleEXT.
typedef struct VellumMicromapTriangle {
    uint32_t dataOffset; // bytes
    uint16_t subdivisionLevel;
    uint16_t format; // a VellumMicromapFormat
} VellumMicromapTriangle;

// Same layout as VkMicromapUsageKHR and VkMicromapUsageEXT.
typedef struct VellumMicromapUsage {
    uint32_t count;
    uint32_t subdivisionLevel;
    uint32_t format; // a VellumMicromapFormat
} VellumMicromapUsage;

typedef struct VellumMicromap VellumMicromap;

// Bakes one micromap for the triangles of all inputs. Triangles with equal states share data, also across inputs.
// The result does not depend on the number of threads.
//
//   inputs    inputCount structures; may be null if inputCount is 0
//   options   null for the defaults without callbacks
//   micromap  receives the result, to be destroyed by vellumDestroyMicromap(); null after an error
//
// Returns VELLUM_SUCCESS, VELLUM_CANCELLED, or any error except VELLUM_ERROR_FILE.
//
// Peak memory: the result, an eighth of it (256 KiB to 64 MiB), a few MiB per thread, 1 KiB for each 64 x 64 texels
// that triangles cover and that have an outline, and about 200 bytes per triangle (350 with a budget). Textures of
// other formats than R8_UNORM are converted: 4 bytes per texel (8 with GREATER or LESS_OR_EQUAL).
VELLUM_API VellumResult VELLUM_CALL vellumBake(const VellumBakeInput *inputs, size_t inputCount,
                                               const VellumBakeOptions *options, VellumMicromap **micromap);

// `micromap` may be null.
VELLUM_API void VELLUM_CALL vellumDestroyMicromap(VellumMicromap *micromap);

typedef struct VellumMicromapInfo {
    size_t structSize;
    // Input of a micromap build, ready to copy: data and triangles, at addresses that are multiples of 256 (EXT) or 128
    // (KHR), and the number of triangles by format and level.
    const uint8_t *data;
    size_t dataSize;
    const VellumMicromapTriangle *triangles;
    size_t triangleCount;
    const VellumMicromapUsage *usages;
    size_t usageCount;
    // For each triangle of all inputs, in order: an index into `triangles`, or a VellumSpecialIndex.
    const int32_t *indices;
    size_t indexCount;
    uint64_t stateCounts[4];   // micro-triangles by VellumState, including those of triangles with special indices
    uint64_t specialCounts[4]; // triangles with special indices, by VellumState
    uint64_t distinctCount;    // triangles that differ in coordinates, textures, level or format
} VellumMicromapInfo;

// Fills `info`, whose structSize must be set. Members that the library does not know become 0.
// VELLUM_ERROR_INVALID_ARGUMENT: a pointer is null, or structSize is smaller than in version 0.1.
VELLUM_API VellumResult VELLUM_CALL vellumGetMicromapInfo(const VellumMicromap *micromap, VellumMicromapInfo *info);

// The part of the result that a geometry made of one input needs, for
// VkAccelerationStructureTrianglesOpacityMicromapEXT or KHR.
typedef struct VellumGeometryInfo {
    size_t structSize;
    const int32_t *indices; // one for each triangle of the input, as in VellumMicromapInfo
    size_t indexCount;
    // Number of its triangles with data, by format and level. Only EXT takes them.
    const VellumMicromapUsage *usages;
    size_t usageCount;
} VellumGeometryInfo;

// Fills the structure like vellumGetMicromapInfo(). VELLUM_ERROR_INVALID_ARGUMENT also if the bake had no input of this
// number.
VELLUM_API VellumResult VELLUM_CALL vellumGetGeometryInfo(const VellumMicromap *micromap, size_t input,
                                                          VellumGeometryInfo *info);

// Writes indices as unsigned integers of 1, 2 or 4 bytes, special ones in two's complement, as Vulkan, D3D12, OptiX and
// glTF read them (docs/apis.md). 1 byte holds indices into 252 triangles, 2 bytes those into 65,532.
//
//   indices     indexCount indices, such as those of VellumGeometryInfo
//   indexSize   1, 2 or 4
//   output      receives indexCount * indexSize bytes, in the byte order of the machine; no alignment is needed
//
// VELLUM_ERROR_INVALID_ARGUMENT: a pointer is null, another size, or an index that is below -4 or does not fit. The
// output is undefined then.
VELLUM_API VellumResult VELLUM_CALL vellumWriteIndices(const int32_t *indices, size_t indexCount, uint32_t indexSize,
                                                       void *output);

// Looks up the state at a point of a triangle, as a ray does.
//
//   triangle  0 to indexCount - 1
//   u, v      barycentrics: the weights of vertices 1 and 2. Values outside of the triangle, and NaN, are clamped to
//             its edge
//   state     receives a VellumState
//
// VELLUM_ERROR_INVALID_ARGUMENT: a pointer is null, or there is no such triangle.
VELLUM_API VellumResult VELLUM_CALL vellumGetState(const VellumMicromap *micromap, size_t triangle, float u, float v,
                                                   uint32_t *state);

#ifdef __cplusplus
}
#endif

#endif
