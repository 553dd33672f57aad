// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/khr_to_ext.h"

#include <string>

#include "spirv/module/micromap_mode.h"
#include "spirv/module/numbers.h"

namespace vellum::spirv
{
namespace
{

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
        declares = declares || isMicromapMode(in);
        changes =
            changes || isMicromapMode(in) || isCapability(in, spv::CapabilityRayTracingOpacityMicromapExecutionModeKHR);
        if (opcodeOf(in) == spv::OpExtension) {
            const std::string text = textOf(in.subspan(1));
            hasExt = hasExt || text == kExtExtension;
            changes = changes || text == kKhrExtension;
        }
    });
    result.queriesForget = hasQueries && !declares;
    if (!changes)
        return result;
    result.words.assign(words.begin(), words.begin() + kHeaderWords);
    const size_t functions = visitDeclarations(words, [&](Words in) {
        if (isMicromapMode(in) || isCapability(in, spv::CapabilityRayTracingOpacityMicromapExecutionModeKHR))
            return;
        if (opcodeOf(in) == spv::OpExtension && textOf(in.subspan(1)) == kKhrExtension) {
            if (hasExt)
                return;
            hasExt = true;
            const std::vector<uint32_t> text = stringWords(kExtExtension);
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
