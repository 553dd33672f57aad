// The ray flags of OpTraceRayKHR and its kin, on their way to the driver (core/ray_flags.h).
#pragma once

#include <functional>
#include <string>

#include "spirv/module/code.h"
#include "spirv/module/link.h"

namespace vellum::spirv
{

// The flags as the driver gets them. Constants stay constants.
Id hideRayFlags(Module &module, Types &types, Linker &linker, Id flags, Code &out);

// The same where rays do not consume micromaps: only ForceOpacityMicromap2State is hidden, which the driver does not
// know. It does nothing there, and comes back to the application if the driver carries flag bits.
Id hideUnknownFlag(Module &module, Types &types, Linker &linker, Id flags, Code &out);

// The flags without some. Constants stay constants; what is computed becomes a uint.
Id removeFlags(Types &types, Id flags, Id type, std::uint32_t removed, Code &out);

class TraceRays
{
public:
    enum class Hides {
        Everything, // in a pipeline that uses micromaps
        UnknownFlag // in one that does not
    };
    TraceRays(Module &module, Types &types, Linker &linker, Hides hides, const std::function<bool()> &carriesFlagBits)
        : module_(module), types_(types), linker_(linker), hides_(hides), carriesFlagBits_(carriesFlagBits)
    {
    }
    // Writes what replaces an instruction to `out`. False if it stays as it is.
    bool replace(Instruction in, Code &out);
    // Not empty once an instruction was met that cannot be replaced.
    [[nodiscard]] const std::string &error() const { return error_; }

private:
    Module &module_;
    Types &types_;
    Linker &linker_;
    Hides hides_;
    const std::function<bool()> &carriesFlagBits_;
    std::string error_;
};

} // namespace vellum::spirv
