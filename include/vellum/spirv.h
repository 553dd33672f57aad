// SPDX-License-Identifier: Apache-2.0
// libvellum: the execution mode OpacityMicromapIdKHR of SPIR-V modules (SPV_KHR_opacity_micromap). In C99. The rules of
// vellum/vellum.h for structures, errors, callbacks and threads apply.
//
// With VK_KHR_opacity_micromap alone, ray queries use micromaps only in entry points that have this mode with a true
// operand. Compilers that cannot express it need it added to the modules that they write:
//
//     VellumSpirv *module;
//     VellumResult result = vellumEditSpirv(words, wordCount, NULL, &module); // in all entry points with ray queries
//     VellumSpirvInfo info = {sizeof info};
//     vellumGetSpirvInfo(module, &info);                                      // info.words is the module to create
//     vellumDestroySpirv(module);
#ifndef VELLUM_SPIRV_H_
#define VELLUM_SPIRV_H_

#include "vellum/vellum.h"

#ifdef __cplusplus
extern "C" {
#endif

// How an entry point declares whether its ray queries use micromaps.
typedef enum VellumSpirvMode {
    VELLUM_SPIRV_MODE_ABSENT = 0,   // no execution mode: they do not
    VELLUM_SPIRV_MODE_FALSE = 1,    // a constant: they do not
    VELLUM_SPIRV_MODE_TRUE = 2,     // a constant: they do
    VELLUM_SPIRV_MODE_CONSTANT = 3, // a specialization constant
    VELLUM_SPIRV_MODE_COMPUTED = 4, // an expression of specialization constants
    VELLUM_SPIRV_MODE_INVALID = 5   // the operand is not a constant of type bool, or there are two different ones
} VellumSpirvMode;

typedef enum VellumSpirvEdit {
    VELLUM_SPIRV_EDIT_NONE = 0,               // only reads the module
    VELLUM_SPIRV_EDIT_ENABLE = 1,             // adds the mode, with the constant true
    VELLUM_SPIRV_EDIT_ENABLE_BY_CONSTANT = 2, // adds the mode, with a specialization constant
    VELLUM_SPIRV_EDIT_DISABLE = 3             // removes the mode
} VellumSpirvEdit;

typedef struct VellumSpirvOptions {
    size_t structSize;
    uint32_t edit; // a VellumSpirvEdit; default VELLUM_SPIRV_EDIT_ENABLE
    // For ENABLE_BY_CONSTANT: the SpecId of the constant, and its default value, 0 or 1. A constant of the module with
    // that SpecId is used; it must be of type bool and have that default.
    uint32_t constantId;
    uint32_t constantDefault;
    uint32_t reserved; // 0
    // Names of the entry points to edit. With a count of 0, the default: all, and those that get the mode only if they
    // have ray queries, themselves or in functions that they call.
    const char *const *entryPoints;
    size_t entryPointCount;
    VellumMessageCallback message; // may be null, the default
    void *userData;
} VellumSpirvOptions;

VELLUM_API void VELLUM_CALL vellumInitSpirvOptions(VellumSpirvOptions *options, size_t structSize);

typedef struct VellumSpirv VellumSpirv;

// Reads a module and edits a copy of it. The capability and the extension come and go with the mode; a mode that an
// entry point has is replaced. The result is valid if the module is.
//
//   words    wordCount words in the byte order of this machine; malformed ones are an error
//   options  null for the defaults
//   spirv    receives the result, to be destroyed by vellumDestroySpirv(); null after an error
//
// VELLUM_ERROR_INVALID_ARGUMENT: an argument is outside of the range given here, the module is malformed, it has no
// entry point of a given name, the mode is needed and the module is older than SPIR-V 1.4, or the constant differs.
VELLUM_API VellumResult VELLUM_CALL vellumEditSpirv(const uint32_t *words, size_t wordCount,
                                                    const VellumSpirvOptions *options, VellumSpirv **spirv);

// `spirv` may be null.
VELLUM_API void VELLUM_CALL vellumDestroySpirv(VellumSpirv *spirv);

// Memory that the functions below return belongs to the VellumSpirv.
typedef struct VellumSpirvInfo {
    size_t structSize;
    const uint32_t *words; // the module after the edit
    size_t wordCount;
    size_t entryPointCount;
    uint32_t changed;  // 1 if the words differ from those given
    uint32_t reserved; // 0
} VellumSpirvInfo;

// Fills `info`, whose structSize must be set. Members that the library does not know become 0.
// VELLUM_ERROR_INVALID_ARGUMENT: a pointer is null, or structSize is smaller than in version 0.1.
VELLUM_API VellumResult VELLUM_CALL vellumGetSpirvInfo(const VellumSpirv *spirv, VellumSpirvInfo *info);

// An entry point after the edit.
typedef struct VellumSpirvEntryPointInfo {
    size_t structSize;
    const char *name;
    uint32_t executionModel; // SPIR-V's
    uint32_t rayQueries;     // 1 if it has ray queries, itself or in functions that it calls
    uint32_t tracesRays; // 1 if it traces rays of a ray tracing pipeline, which needs the micromap bit for micromaps
    uint32_t mode;       // a VellumSpirvMode
    uint32_t constantId; // SpecId, for VELLUM_SPIRV_MODE_CONSTANT; otherwise 0
    uint32_t constantDefault; // default value, for VELLUM_SPIRV_MODE_CONSTANT; otherwise 0
} VellumSpirvEntryPointInfo;

//   number  0 to entryPointCount - 1, otherwise VELLUM_ERROR_INVALID_ARGUMENT
VELLUM_API VellumResult VELLUM_CALL vellumGetSpirvEntryPointInfo(const VellumSpirv *spirv, size_t number,
                                                                 VellumSpirvEntryPointInfo *info);

#ifdef __cplusplus
}
#endif

#endif
