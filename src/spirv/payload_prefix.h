// SPDX-License-Identifier: Apache-2.0
// Hidden ray flags in a prefix of the payload. Every payload variable of type T becomes one of struct {uint, T}, in all
// modules of a pipeline and its libraries, so that all shaders of a ray still declare the same payload
// (VUID-RuntimeSpirv-OpTraceRayKHR-11855).
#pragma once

#include <map>
#include <set>
#include <span>
#include <string>

#include "spirv/module/code.h"
#include "spirv/module/types.h"

namespace vellum::spirv
{

// Returns whether shaders of an execution model are called with a payload.
bool receivesPayload(uint32_t executionModel);

class PayloadPrefix
{
public:
    // `reached`: the functions of the stage.
    PayloadPrefix(Module &module, Types &types, const std::set<Id> &reached)
        : module_(module), types_(types), reached_(reached)
    {
    }

    // Widens all payloads of the module, and makes the application's code access its part. False with error() set on
    // failure.
    bool widen();
    [[nodiscard]] const std::string &error() const { return error_; }

    // Pointer to the prefix of a payload variable; 0 if `variable` is not a payload.
    Id pointer(Id variable, Code &out) const;
    // The payload type for entry points that declare none: a prefix, followed by `payload` (payload_types.h) if known.
    Id ownPayload(std::span<const uint32_t> payload);

    // The Private variable for the hidden flags of the ray that called the shader. The shader may pass its payload and
    // the prefix to another ray, so the entry point begins by storing the flags here, if this was called.
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
    Id function_ = 0;           // the function that is being rewritten
    std::map<Id, Id> payloads_; // variables and parameters, with the application's pointer type
    std::map<Id, Id> structs_;  // by the application's type
    std::map<Id, Id> pointers_; // by the application's pointer type
    Id own_ = 0;
    Id kept_ = 0;
    std::string error_;
};

} // namespace vellum::spirv
