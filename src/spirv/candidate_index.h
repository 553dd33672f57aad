// The custom index of a ray query's candidate, where it is known already: who decides a candidate has read its instance
// record, and keeps the application's index that lies there for the application. Else each instruction that gets the
// index reads the record again.
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

    // Puts a variable beside each ray query of which the application gets the index of a candidate and of which all
    // candidates are decided by our code: it is a variable of its own that no function is passed and that is used in
    // functions only that always consume micromaps. False with error() set on failure.
    bool declare();
    [[nodiscard]] const std::string &error() const { return beside_.error(); }

    [[nodiscard]] SideVariables::Variable beside(Id variable) const { return beside_.beside(variable); }
    // The variable that has what the instruction, an OpRayQueryGetIntersectionInstanceCustomIndexKHR, gets; 0: none
    // has.
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
