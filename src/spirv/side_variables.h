// SPDX-License-Identifier: Apache-2.0
// Side variables: a uint for each ray query or hit object of the application, with data that the rewritten module needs
// about the object.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>

#include "spirv/module/code.h"
#include "spirv/module/types.h"

namespace vellum::spirv
{

// How an instruction reaches an object: a variable or parameter, and indices into it.
struct AccessPath {
    Instruction base; // OpVariable or OpFunctionParameter
    std::vector<Id> indices;
};

// Nothing if the pointer is not a chain of indices into a variable or parameter.
std::optional<AccessPath> accessPath(const Module &module, Id pointer);

enum class Beside { RayQueries, HitObjects };

class SideVariables
{
public:
    SideVariables(Module &module, Types &types, Beside objects) : module_(module), types_(types), objects_(objects) {}

    // Adds a variable for each variable, and a parameter for each parameter, that is such an object or contains some:
    // of the same shape, with a uint in place of each object. Calls pass both. Returns false with error() set on
    // failure.
    bool declare();
    // Declares for some variables only, which are not passed to functions.
    bool declare(const std::set<Id> &variables);
    [[nodiscard]] const std::string &error() const { return error_; }
    [[nodiscard]] bool inUse() const { return inUse_; }

    struct Variable {
        Id id = 0;   // 0: none
        Id type = 0; // of the pointer
    };
    // The side variable of a variable or parameter.
    [[nodiscard]] Variable beside(Id variable) const;
    // Pointer to the side variable of the object, or of the array or structure of objects, that `object` points to; 0
    // if that is not reached through a variable or parameter.
    Id pointer(Id object, Code &out);
    // Returns whether a type is such an object, or contains some.
    [[nodiscard]] bool holds(Id type) { return shapeOf(type, 0) != 0; }
    // Pointer to the uint at the end of a path.
    Id element(Variable beside, const std::vector<Id> &indices, Id type, Code &out);

private:
    [[nodiscard]] bool isObject(uint32_t type) const;
    Id shapeOf(Id type, int depth);
    Id shapeOfPointee(Instruction pointerType);
    std::optional<Variable> make(Instruction variable, const std::set<Id> *only);
    bool declareBeside(const std::set<Id> *only);
    Instruction widenedFunction(Instruction function);
    Instruction widenedCall(Instruction call, Code &out);

    Module &module_;
    Types &types_;
    Beside objects_;
    std::map<Id, Id> shapes_; // of types that contain such objects; 0: of those that do not
    std::map<Id, Variable> beside_;
    bool inUse_ = false;
    std::string error_;
};

} // namespace vellum::spirv
