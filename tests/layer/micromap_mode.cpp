#include "micromap_mode.h"

#include <array>

namespace vt
{
namespace
{

// Of the unified SPIR-V specification and SPV_KHR_opacity_micromap.
constexpr std::uint32_t kHeaderWords = 5;
constexpr std::uint32_t kBoundWord = 3;
constexpr std::uint32_t kOpExtension = 10;
constexpr std::uint32_t kOpEntryPoint = 15;
constexpr std::uint32_t kOpCapability = 17;
constexpr std::uint32_t kOpTypeBool = 20;
constexpr std::uint32_t kOpConstantTrue = 41;
constexpr std::uint32_t kOpFunction = 54;
constexpr std::uint32_t kOpExecutionModeId = 331;
constexpr std::uint32_t kCapabilityRayQuery = 4472;
constexpr std::uint32_t kCapabilityMicromapMode = 6032; // RayTracingOpacityMicromapExecutionModeKHR
constexpr std::uint32_t kModeMicromapId = 6031;         // OpacityMicromapIdKHR
// "SPV_KHR_opacity_micromap" with its terminator.
constexpr std::array<std::uint32_t, 7> kExtension{0x5f565053, 0x5f52484b, 0x6361706f, 0x5f797469,
                                                  0x7263696d, 0x70616d6f, 0};

std::uint32_t first(std::uint32_t opcode, std::size_t operands)
{
    return static_cast<std::uint32_t>(operands + 1) << 16 | opcode;
}

} // namespace

std::vector<std::uint32_t> withMicromapMode(std::span<const std::uint32_t> words)
{
    std::vector<std::uint32_t> entryPoints;
    std::uint32_t boolean = 0;
    bool queries = false, declared = false;
    for (std::size_t at = kHeaderWords; at < words.size() && (words[at] >> 16) != 0; at += words[at] >> 16) {
        switch (words[at] & 0xffff) {
        case kOpCapability: queries |= words[at + 1] == kCapabilityRayQuery; break;
        case kOpEntryPoint: entryPoints.push_back(words[at + 2]); break;
        case kOpExecutionModeId: declared |= words[at + 2] == kModeMicromapId; break;
        case kOpTypeBool: boolean = words[at + 1]; break;
        default: break;
        }
    }
    std::vector<std::uint32_t> out(words.begin(), words.end());
    if (!queries || declared)
        return out;

    out.resize(kHeaderWords);
    const std::uint32_t constant = out[kBoundWord]++;
    const bool ownBoolean = boolean == 0;
    if (ownBoolean)
        boolean = out[kBoundWord]++;
    const auto put = [&out](std::uint32_t opcode, std::span<const std::uint32_t> operands) {
        out.push_back(first(opcode, operands.size()));
        out.insert(out.end(), operands.begin(), operands.end());
    };
    std::size_t entryPointsLeft = entryPoints.size();
    bool extended = false, constantMade = false;
    put(kOpCapability, std::array{kCapabilityMicromapMode});
    for (std::size_t at = kHeaderWords; at < words.size(); at += words[at] >> 16) {
        const std::uint32_t opcode = words[at] & 0xffff;
        if (opcode != kOpCapability && !extended) {
            put(kOpExtension, kExtension);
            extended = true;
        }
        if (opcode == kOpFunction && !constantMade) {
            if (ownBoolean)
                put(kOpTypeBool, std::array{boolean});
            put(kOpConstantTrue, std::array{boolean, constant});
            constantMade = true;
        }
        out.insert(out.end(), words.begin() + static_cast<std::ptrdiff_t>(at),
                   words.begin() + static_cast<std::ptrdiff_t>(at + (words[at] >> 16)));
        // Execution modes follow the entry points.
        if (opcode == kOpEntryPoint && --entryPointsLeft == 0) {
            for (const std::uint32_t entryPoint : entryPoints)
                put(kOpExecutionModeId, std::array{entryPoint, kModeMicromapId, constant});
        }
    }
    return out;
}

} // namespace vt
