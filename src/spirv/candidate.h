// SPDX-License-Identifier: Apache-2.0
// Functions that decide a ray query's candidate before the application sees it, one for each access path to a query.
#pragma once

#include <cstdint>

#include "spirv/candidate_index.h"
#include "spirv/consumption.h"
#include "spirv/module/code.h"
#include "spirv/module/link.h"
#include "spirv/side_variables.h"

namespace vellum::spirv
{

// Ray flags that are constant in all queries of a module.
struct RayFlagMode {
    // The bits hidden from the driver (Opaque, CullNoOpaque, ForceOpacityMicromap2State) that all queries have; nothing
    // if they differ or are computed. The flags are then in a side variable of each query (side_variables.h).
    std::optional<uint32_t> hidden;
    // All bits that concern opacity, if they are the same for all queries.
    std::optional<uint32_t> all;
};

// How an instruction reaches its ray query: a variable or parameter, and indices into it. Ray queries can only be used
// through such pointers (logical addressing), but only the variable itself may be an argument of a function. The
// generated functions therefore take the variable and the indices.
struct QueryAccess {
    std::vector<uint32_t> shape; // equal shapes share their functions
    std::vector<Id> arguments;   // of the call
    std::vector<Id> parameterTypes;
    Id base = 0;                   // module-scope variable, or 0: the first argument
    SideVariables::Variable flags; // side variable for flags; that of an argument is the next argument
    SideVariables::Variable index; // side variable for the candidate's custom index, likewise; id 0: none
    std::vector<Id> indices;       // ids that are valid everywhere, or 0: the next argument
    Id pointerType = 0;            // type of the pointer to the query
};

class CandidateFunctions
{
public:
    CandidateFunctions(Module &module, Types &types, Linker &linker, Consumption &consumption,
                       SideVariables &queryFlags, const CandidateIndices &indices, RayFlagMode mode)
        : module_(module), types_(types), linker_(linker), consumption_(consumption), queryFlags_(queryFlags),
          indices_(indices), mode_(mode)
    {
    }

    // Nothing if the pointer is not a chain of indices into a variable or parameter.
    std::optional<QueryAccess> access(Id query) const;

    // bool vellumCandidate(query): true if the candidate was decided (ignored or committed), false if the
    // application must see it. If only some queries consume micromaps, bool vellumIfConsumed(query): the same for those
    // that do, false for others.
    Id candidate(const QueryAccess &access, const Consumes &consumes);
    // bool vellumProceed(query): OpRayQueryProceedKHR up to a candidate that the application must see.
    Id proceed(const QueryAccess &access, const Consumes &consumes);

    // Pointers to a query and to its side variables for flags and the candidate's index; 0: none.
    struct Reached {
        Id query = 0, flags = 0, index = 0;
    };
    // The application's ray flags, or at least those that concern opacity.
    Id opacityFlags(Code &code, Reached reached);

    // Adds the functions to the module.
    void finish();

private:
    Id decide(const QueryAccess &access);

    // Begins a function. Returns its block.
    Id begin(const std::vector<Id> &parameterTypes, Id function, const char *name, std::vector<Id> &parameters);
    // The query and its side variables in a function with the access's parameters.
    Reached reach(const QueryAccess &access, const std::vector<Id> &parameters);

    Module &module_;
    Types &types_;
    Linker &linker_;
    Consumption &consumption_;
    SideVariables &queryFlags_;
    const CandidateIndices &indices_;
    RayFlagMode mode_;
    std::map<std::vector<uint32_t>, Id> candidates_;
    std::map<std::vector<uint32_t>, Id> conditional_; // by Consumes and shape
    std::map<std::vector<uint32_t>, Id> proceeds_;    // likewise
    Code code_{module_};
};

} // namespace vellum::spirv
