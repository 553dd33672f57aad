#include "spirv/translation/translate.h"

#include <string>

#include "spirv/module/module.h"
#include "spirv/module/opcodes.h"

namespace vellum::spirv
{
namespace
{

constexpr std::size_t kHeaderWords = 5;
constexpr const char *kKhr = "SPV_KHR_opacity_micromap";
constexpr const char *kExt = "SPV_EXT_opacity_micromap";

// The literal string that an OpExtension holds.
std::string textOf(Words instruction)
{
    std::string text;
    for (const std::uint32_t word : instruction.subspan(1)) {
        for (unsigned shift = 0; shift < 32; shift += 8) {
            const char c = static_cast<char>(word >> shift & 0xff);
            if (c == 0)
                return text;
            text += c;
        }
    }
    return text;
}

bool isMode(Words in)
{
    const std::uint32_t opcode = in[0] & 0xffff;
    return (opcode == spv::OpExecutionMode || opcode == spv::OpExecutionModeId) && in.size() > 2 &&
           in[2] == kExecutionModeOpacityMicromapId;
}

bool isCapability(Words in, std::uint32_t capability)
{
    return (in[0] & 0xffff) == spv::OpCapability && in.size() > 1 && in[1] == capability;
}

// Calls `visit` for each instruction before the functions; returns where they begin.
template <typename Visit>
std::size_t visitDeclarations(Words words, Visit visit)
{
    std::size_t at = kHeaderWords;
    while (at < words.size()) {
        const std::size_t count = words[at] >> 16;
        if ((words[at] & 0xffff) == spv::OpFunction || count == 0 || count > words.size() - at)
            break;
        visit(words.subspan(at, count));
        at += count;
    }
    return at;
}

} // namespace

TranslateResult translateToExt(std::span<const std::uint32_t> words)
{
    TranslateResult result;
    if (words.size() < kHeaderWords || words[0] != spv::MagicNumber)
        return result;
    bool changes = false;
    bool hasExt = false;
    bool hasQueries = false;
    bool declares = false;
    visitDeclarations(words, [&](Words in) {
        hasQueries = hasQueries || isCapability(in, spv::CapabilityRayQueryKHR);
        declares = declares || isMode(in);
        changes = changes || isMode(in) || isCapability(in, kCapabilityOpacityMicromapExecutionMode);
        if ((in[0] & 0xffff) == spv::OpExtension) {
            const std::string text = textOf(in);
            hasExt = hasExt || text == kExt;
            changes = changes || text == kKhr;
        }
    });
    result.queriesForget = hasQueries && !declares;
    if (!changes)
        return result;
    result.words.assign(words.begin(), words.begin() + kHeaderWords);
    const std::size_t functions = visitDeclarations(words, [&](Words in) {
        if (isMode(in) || isCapability(in, kCapabilityOpacityMicromapExecutionMode))
            return;
        if ((in[0] & 0xffff) == spv::OpExtension && textOf(in) == kKhr) {
            if (hasExt)
                return;
            hasExt = true;
            const std::vector<std::uint32_t> text = stringWords(kExt);
            result.words.push_back(static_cast<std::uint32_t>(text.size() + 1) << 16 | spv::OpExtension);
            result.words.insert(result.words.end(), text.begin(), text.end());
            return;
        }
        result.words.insert(result.words.end(), in.begin(), in.end());
    });
    result.words.insert(result.words.end(), words.begin() + static_cast<std::ptrdiff_t>(functions), words.end());
    return result;
}

} // namespace vellum::spirv
