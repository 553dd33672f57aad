// What the driver returns is not always what the application is to see: restores it.
#pragma once

#include <set>

#include "spirv/module/code.h"
#include "spirv/module/link.h"

namespace vellum::spirv
{

// What `function`, which takes and returns a uint, makes of a 32-bit integer of the given type.
Id restoreValue(Types &types, Id function, Id type, Id value, Code &out);

// An instruction whose result, a 32-bit integer, goes through `function`, which takes and returns a uint.
void restoreResult(Module &module, Types &types, Id function, Instruction in, Code &out);

// Reads of built-in variables: InstanceCustomIndex, which is a slot, and IncomingRayFlags, which carry hidden bits.
// Also the same of hit objects.
class BuiltIns
{
public:
    // `indexIsKnown`: code of ours knows the application's custom index before the application reads it, and keeps it
    // in knownIndex().
    BuiltIns(Module &module, Types &types, Linker &linker, bool indexIsKnown);
    // Writes what replaces an instruction to `out`. False if it stays as it is.
    bool replace(Instruction in, Code &out);
    // A Private variable; 0 where nothing reads it.
    [[nodiscard]] Id knownIndex() const { return knownIndex_; }

private:
    void restore(Instruction in, const char *function, Code &out);
    // The library function that restores what `pointer` points to; null where there is nothing to restore.
    const char *restoring(Id pointer) const;
    void copy(Instruction in, const char *function, Code &out);

    Module &module_;
    Types &types_;
    Linker &linker_;
    bool indexIsKnown_;
    Id knownIndex_ = 0;
    std::set<Id> customIndex_;
    std::set<Id> incomingFlags_;
};

} // namespace vellum::spirv
