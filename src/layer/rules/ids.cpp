// SPDX-License-Identifier: Apache-2.0
#include "layer/rules/ids.h"

#include <algorithm>
#include <array>

namespace vellum::layer::rules::ids
{
namespace
{

constexpr std::string_view kDirect = "vkCmdBuildAccelerationStructuresKHR";
constexpr std::string_view kIndirect = "vkCmdBuildAccelerationStructuresIndirectKHR";

// The end of the id of a rule of a command, such as "pInfos-03667"; empty for one of another command.
constexpr std::string_view ruleOf(std::string_view command, std::string_view id)
{
    constexpr size_t kBefore = 5; // VUID and a hyphen
    if (id.size() < kBefore || !id.substr(kBefore).starts_with(command))
        return {};
    const std::string_view rest = id.substr(kBefore + command.size());
    return rest.starts_with('-') ? rest.substr(1) : std::string_view();
}

// The rules that both commands have, and that are checked.
constexpr auto kIndirectIds = std::to_array<const char *>({
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-dstAccelerationStructure-03698",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-dstAccelerationStructure-03702",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-dstAccelerationStructure-03703",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-dstAccelerationStructure-03800",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-geometry-03673",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11624",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11625",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11626",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11627",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11629",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11632",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-micromap-11701",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-mode-04628",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03667",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03699",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03700",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03707",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03715",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03716",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03717",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03758",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03759",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03804",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03806",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03808",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03811",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03813",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-04630",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-10607",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-10904",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-10905",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-12260",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-12261",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-12281",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-scratchData-03704",
    "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-srcAccelerationStructure-04629",
});

} // namespace

const char *idAt(std::string_view place, const char *id)
{
    const std::string_view rule = place.starts_with(kIndirect) ? ruleOf(kDirect, id) : std::string_view();
    const auto found = std::ranges::find_if(
        kIndirectIds, [rule](std::string_view indirect) { return ruleOf(kIndirect, indirect) == rule; });
    return found == kIndirectIds.end() ? id : *found;
}

} // namespace vellum::layer::rules::ids
