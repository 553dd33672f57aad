// Puts code of ours before the entry point of an any-hit or intersection shader: a function that decides what is ours
// to decide, and else calls the application's. Where ray flags travel in payloads, before those of closest-hit and miss
// shaders that read them, too.
#pragma once

#include <string>

#include "spirv/module/code.h"
#include "spirv/module/link.h"
#include "spirv/payload_prefix.h"
#include "spirv/rewrite.h"

namespace vellum::spirv
{

// Whether an instruction is the OpEntryPoint of a stage.
bool isEntryPoint(const Module &module, Instruction in, const PipelineStage &stage);

class EntryWrapper
{
public:
    // `knownIndex`: where the application finds its custom index once a hit of triangles is looked up; 0: it does not
    // look.
    EntryWrapper(Module &module, Types &types, Linker &linker, PayloadPrefix &prefix, Id knownIndex)
        : module_(module), types_(types), linker_(linker), prefix_(prefix), knownIndex_(knownIndex)
    {
    }

    // Leaves `stage`'s entry point as the only one, and wraps it if the stage decides anything. Called last: what is
    // added here must not be rewritten. False with error() set on failure.
    bool wrap(const PipelineStage &stage);
    [[nodiscard]] const std::string &error() const { return error_; }

private:
    bool selectEntryPoint(const PipelineStage &stage);
    void decideTriangle();
    void decideBox();
    void cullBox();
    void ignoreIf(Id condition);
    // The application's function runs if the condition is true, and ours returns.
    void callIf(Id condition);

    Id readBuiltIn(uint32_t builtIn);
    Id applicationFlags();
    // Where the prefix of the payload that the shader was called with is.
    Id incomingPrefix();
    void keepFlags();
    // The barycentrics of the hit: the first two scalars of its attributes.
    Id readBarycentrics();
    struct Scalar {
        Id type = 0;
        std::vector<uint32_t> path; // indices that lead to it
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
    size_t interface_ = 0;        // where in them the interface begins
    Id application_ = 0;          // the application's function
    Id declaredPayload_ = 0;      // what the application is called with
    Id incomingPrefix_ = 0;       // once it was needed
    Code code_{module_};
    std::string error_;
};

} // namespace vellum::spirv
