// SPDX-License-Identifier: Apache-2.0
// The custom index of a ray query's candidate. The function that decides a candidate reads its instance record, and
// stores the application's index from it in a side variable. Without one, each instruction that gets the index reads
// the record.
#pragma once

#include <set>
#include <string>

#include "spirv/consumption.h"
#include "spirv/module/code.h"
#include "spirv/module/types.h"
#include "spirv/side_variables.h"

namespace vellum::spirv
{

class CandidateIndices
{
public:
    CandidateIndices(Module &module, Types &types, const Consumption &consumption)
        : module_(module), types_(types), consumption_(consumption), beside_(module, types, Beside::RayQueries)
    {
    }

    // Adds a variable for each ray query whose candidates' index the application gets and whose candidates are all
    // decided by generated functions: it is a variable that is not passed to functions and is used only in functions
    // that always consume micromaps. Returns false with error() set on failure.
    bool declare();
    [[nodiscard]] const std::string &error() const { return beside_.error(); }

    [[nodiscard]] SideVariables::Variable beside(Id variable) const { return beside_.beside(variable); }
    // The variable with the result of an OpRayQueryGetIntersectionInstanceCustomIndexKHR; 0: none.
    [[nodiscard]] Id of(Instruction in) const;

private:
    std::set<Id> find() const;
    [[nodiscard]] bool getsCandidate(Instruction in) const;

    Module &module_;
    Types &types_;
    const Consumption &consumption_;
    SideVariables beside_;
};

} // namespace vellum::spirv
