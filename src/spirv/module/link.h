// SPDX-License-Identifier: Apache-2.0
// Links functions of the layer's GLSL library (src/shaders/pipelines/lookup.comp) into an application's module.
#pragma once

#include "spirv/module/module.h"
#include "spirv/module/types.h"

#include <cstdint>
#include <map>
#include <set>
#include <string_view>

namespace vellum::spirv
{

class Linker
{
public:
    // constants: values for the library's specialization constants, by SpecId. They become ordinary constants, since
    // the ids of the application's own belong to the application.
    Linker(Module &module, Types &types, Words library, std::map<uint32_t, uint32_t> constants);

    // The module's id of a library function, named as in GLSL. Its definition is imported on first use, with all that
    // it needs. 0 on failure, see error().
    Id function(std::string_view name);

    // Call when everything is imported: adds the imported functions, their names and decorations, and what the
    // module must declare to use physical addresses. False on failure.
    bool finish();

    const std::string &error() const { return error_; }

private:
    Id import(Id id);
    Id importInstructionSet(Instruction in);
    Id importGlobal(Instruction in, Id id);
    std::span<const Instruction> bodyOf(Id function) const;
    std::vector<Instruction> newResults(std::span<const Instruction> body);
    Id importFunction(Id id);
    std::map<Id, Id> localConstants(std::span<const Instruction> body) const;
    bool isInlined(std::span<const Instruction> body) const;
    bool inlineCall(Instruction call, std::vector<Instruction> &out);
    bool importBody(std::span<const Instruction> body, std::vector<Instruction> &out);
    void importDecorations();
    bool declareAddressing();
    Id fail(const std::string &what);

    Module &module_;
    Types &types_;
    std::string error_; // before library_, whose parsing may set it
    std::optional<Module> library_;
    std::map<uint32_t, uint32_t> constants_;
    std::map<Id, uint32_t> specIds_;
    std::map<Id, size_t> functions_; // where they begin in the library
    std::set<Id> decorated_;
    std::map<Id, Id> imported_;
    std::map<Id, Id> loaded_; // loads of local variables that are constants: the library's value
    std::set<Id> merged_;     // library ids that became ids the module had: their names and decorations stay behind
    std::vector<Instruction> code_;
};

} // namespace vellum::spirv
