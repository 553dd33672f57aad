// SPDX-License-Identifier: Apache-2.0
// Wraps the entry point of an any-hit or intersection shader in a function that decides the hit or calls the
// application's function (Prologue). If ray flags travel in payloads, closest-hit and miss shaders that read them are
// also wrapped.
#pragma once

#include <string>

#include "spirv/module/code.h"
#include "spirv/module/link.h"
#include "spirv/payload_prefix.h"
#include "spirv/rewrite.h"

namespace vellum::spirv
{

// Returns whether an instruction is the OpEntryPoint of a stage.
bool isEntryPoint(const Module &module, Instruction in, const PipelineStage &stage);

class EntryWrapper
{
public:
    // `knownIndex`: the variable for the application's custom index, which the lookup of a triangle hit returns; 0 if
    // nothing reads it.
    EntryWrapper(Module &module, Types &types, Linker &linker, PayloadPrefix &prefix, Id knownIndex)
        : module_(module), types_(types), linker_(linker), prefix_(prefix), knownIndex_(knownIndex)
    {
    }

    // Removes all entry points but `stage`'s, and wraps that if needed. Call last, because the added code must not be
    // rewritten. False with error() set on failure.
    bool wrap(const PipelineStage &stage);
    [[nodiscard]] const std::string &error() const { return error_; }

private:
    bool selectEntryPoint(const PipelineStage &stage);
    void decideTriangle();
    void decideBox();
    void decideEither();
    void cullBox();
    // Calls vellumResolve, which decides a hit on a triangle.
    Id resolveTriangle(Id barycentrics, Id flags);
    void ignoreIf(Id condition);
    // Calls the application's function if the condition is true, and returns.
    void callIf(Id condition);

    Id readBuiltIn(uint32_t builtIn);
    Id applicationFlags();
    // Pointer to the prefix of the incoming payload.
    Id incomingPrefix();
    void keepFlags();
    // The barycentrics of the hit: the first two scalars of its attributes.
    Id readBarycentrics();
    struct Scalar {
        Id type = 0;
        std::vector<uint32_t> path; // its indices
    };
    bool findScalars(Id type, std::vector<uint32_t> &path, std::vector<Scalar> &found, size_t &budget) const;
    [[nodiscard]] uint32_t arrayLength(Instruction array) const;
    Id makeInput(uint32_t storageClass, Id type);
    [[nodiscard]] bool inInterface(Id variable) const;

    Module &module_;
    Types &types_;
    Linker &linker_;
    PayloadPrefix &prefix_;
    Id knownIndex_;
    HiddenFlags hidden_;
    bool receivesPayload_ = false;
    std::vector<uint32_t> entry_; // operands of OpEntryPoint
    size_t interface_ = 0;        // first operand of the interface
    Id application_ = 0;          // the application's function
    Id declaredPayload_ = 0;      // incoming payload that the application declares
    Id incomingPrefix_ = 0;       // 0 until it is needed
    Code code_{module_};
    std::string error_;
};

} // namespace vellum::spirv
