// For drivers that do not give unused ray flag bits back: the flags that are hidden from the driver travel with the
// ray, before the application's payload. Every payload variable of type T becomes one of struct {uint, T}, in all
// modules of all pipelines that work together, and so the specification's rule is kept that all shaders of a ray
// declare the same payload (VUID-RuntimeSpirv-OpTraceRayKHR-11855).
#pragma once

#include <map>
#include <set>
#include <span>
#include <string>

#include "spirv/module/code.h"
#include "spirv/module/types.h"

namespace vellum::spirv
{

// Whether shaders of an execution model are called with a payload.
bool receivesPayload(uint32_t executionModel);

class PayloadPrefix
{
public:
    // `reached`: the functions of the stage.
    PayloadPrefix(Module &module, Types &types, const std::set<Id> &reached)
        : module_(module), types_(types), reached_(reached)
    {
    }

    // Widens all payloads of the module, and has the application's code reach its part. False with error() set on
    // failure.
    bool widen();
    [[nodiscard]] const std::string &error() const { return error_; }

    // Pointer to the prefix of a payload variable; 0 if `variable` is none.
    Id pointer(Id variable, Code &out) const;
    // A payload for entry points that declare none: a prefix, and after it `payload` (payload_types.h), where that is
    // known. A type.
    Id ownPayload(std::span<const uint32_t> payload);

    // A Private variable for the hidden flags of the ray that a shader was called for. A payload may be handed on to
    // the next ray, and its prefix with it, so the first thing an entry point does is to fill this, if it was asked
    // for.
    Id keptFlags();
    [[nodiscard]] Id keptFlagsIfRequested() const { return kept_; }

    static bool isPayload(uint32_t storageClass);

private:
    Id widened(Id pointerType, std::vector<Instruction> &globals);
    void widenVariables();
    void widenFunctions();
    Instruction widenedFunction(Instruction function);
    Instruction throughPayload(Instruction in, Code &out);
    void fail(const char *error);

    Module &module_;
    Types &types_;
    const std::set<Id> &reached_;
    Id function_ = 0;           // that is being rewritten
    std::map<Id, Id> payloads_; // variables and parameters: the type of pointer that they had
    std::map<Id, Id> structs_;  // by the application's type
    std::map<Id, Id> pointers_; // by the application's pointer type
    Id own_ = 0;
    Id kept_ = 0;
    std::string error_;
};

} // namespace vellum::spirv
