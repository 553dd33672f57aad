// For drivers that do not give unused ray flag bits back: beside each ray query a variable that holds the ray flags
// that the query was initialized with.
#pragma once

#include <map>
#include <optional>
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

// Nothing if the pointer is no chain of indices into a variable or parameter.
std::optional<AccessPath> accessPath(const Module &module, Id pointer);

class QueryFlags
{
public:
    QueryFlags(Module &module, Types &types) : module_(module), types_(types) {}

    // Puts a variable beside each variable, and a parameter beside each parameter, that is a ray query or contains
    // some: of the same shape, with a uint in the place of each query. Calls pass both. False with error() set on
    // failure.
    bool declare();
    [[nodiscard]] const std::string &error() const { return error_; }
    [[nodiscard]] bool inUse() const { return inUse_; }

    // What lies beside a variable or parameter.
    struct Beside {
        Id id = 0;
        Id type = 0; // of the pointer
    };
    [[nodiscard]] Beside beside(Id variable) const;
    // Pointer to what lies beside the query, or the array or structure of queries, that `query` points to; 0 if that is
    // reached in no way that we know.
    Id pointer(Id query, Code &out);
    // Pointer to the flags at the end of a path.
    Id element(Beside beside, const std::vector<Id> &indices, Id type, Code &out);

private:
    Id shapeOf(Id type, int depth);
    std::optional<Beside> make(Id pointerType);
    void declareInFunctions();
    Instruction widenedFunction(Instruction function);
    Instruction widenedCall(Instruction call, Code &out);

    Module &module_;
    Types &types_;
    std::map<Id, Id> shapes_; // of types that contain queries; 0: of those that do not
    std::map<Id, Beside> beside_;
    bool inUse_ = false;
    std::string error_;
};

} // namespace vellum::spirv
