// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/khr_to_ext.h"

#include <string>

#include "spirv/module/module.h"
#include "spirv/module/opcodes.h"

namespace vellum::spirv
{
namespace
{

constexpr const char *kKhr = "SPV_KHR_opacity_micromap";
constexpr const char *kExt = "SPV_EXT_opacity_micromap";

bool isMode(Words in)
{
    const uint32_t opcode = opcodeOf(in);
    return (opcode == spv::OpExecutionMode || opcode == spv::OpExecutionModeId) && in.size() > 2 &&
           in[2] == kExecutionModeOpacityMicromapId;
}

bool isCapability(Words in, uint32_t capability)
{
    return opcodeOf(in) == spv::OpCapability && in.size() > 1 && in[1] == capability;
}

// Calls `visit` for each instruction before the functions; returns where they begin.
template <typename Visit>
size_t visitDeclarations(Words words, Visit visit)
{
    return visitInstructions(words, [&](Words in) {
        const bool declares = opcodeOf(in) != spv::OpFunction;
        if (declares)
            visit(in);
        return declares;
    });
}

} // namespace

TranslateResult translateToExt(std::span<const uint32_t> words)
{
    TranslateResult result;
    if (!isSpirv(words))
        return result;
    bool changes = false;
    bool hasExt = false;
    bool hasQueries = false;
    bool declares = false;
    visitDeclarations(words, [&](Words in) {
        hasQueries = hasQueries || isCapability(in, spv::CapabilityRayQueryKHR);
        declares = declares || isMode(in);
        changes = changes || isMode(in) || isCapability(in, kCapabilityOpacityMicromapExecutionMode);
        if (opcodeOf(in) == spv::OpExtension) {
            const std::string text = textOf(in.subspan(1));
            hasExt = hasExt || text == kExt;
            changes = changes || text == kKhr;
        }
    });
    result.queriesForget = hasQueries && !declares;
    if (!changes)
        return result;
    result.words.assign(words.begin(), words.begin() + kHeaderWords);
    const size_t functions = visitDeclarations(words, [&](Words in) {
        if (isMode(in) || isCapability(in, kCapabilityOpacityMicromapExecutionMode))
            return;
        if (opcodeOf(in) == spv::OpExtension && textOf(in.subspan(1)) == kKhr) {
            if (hasExt)
                return;
            hasExt = true;
            const std::vector<uint32_t> text = stringWords(kExt);
            result.words.push_back(static_cast<uint32_t>(text.size() + 1) << 16 | spv::OpExtension);
            result.words.insert(result.words.end(), text.begin(), text.end());
            return;
        }
        result.words.insert(result.words.end(), in.begin(), in.end());
    });
    result.words.insert(result.words.end(), words.begin() + static_cast<ptrdiff_t>(functions), words.end());
    return result;
}

} // namespace vellum::spirv
