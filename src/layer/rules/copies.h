// SPDX-License-Identifier: Apache-2.0
// The rules of copies of micromaps and acceleration structures, and of queries of their properties. Each check sets
// whether the command is accepted.
#pragma once

#include "layer/input/checked.h"
#include "layer/input/copies.h"
#include "layer/rules/rule.h"

namespace vellum::layer::rules
{

struct CopyFacts {
    ObjectFacts source, target;
    bool sameMemory = false; // both begin at the same byte
};
void checkCopy(const InputCheck &check, input::Copy &copy, const CopyFacts &facts);
void checkCopy(const InputCheck &check, input::SerializedCopy &copy, const ObjectFacts &object);

inline CopyFacts factsOf(const input::Copy &copy, const Facts &facts)
{
    return {facts(copy.source), facts(copy.target)};
}
inline ObjectFacts factsOf(const input::SerializedCopy &copy, const Facts &facts)
{
    return facts(copy.object);
}
// The copy that a command states: validation's, or parsed and checked.
template <typename Info>
auto takeCopy(const RuleDevice &device, const char *command, const Info &info, input::Executor executor,
              const Facts &facts)
{
    using Copy = decltype(input::parse(info, executor));
    return input::Checked<Copy>::take(&info, [&] {
        Copy parsed = input::parse(info, executor);
        const Place place(command);
        const Place member = place.member("pInfo");
        checkCopy(InputCheck(device, member, parsed.subject()), parsed, factsOf(parsed, facts));
        return parsed;
    });
}

struct PoolFacts {
    enum class Kind : uint8_t { Known, Unknown, None };
    Kind kind = Kind::Known;
    VkQueryType type = VK_QUERY_TYPE_MAX_ENUM; // of pools that the layer does not keep: not one of its types
    uint32_t count = 0;
};
// On the device.
void checkQuery(const InputCheck &check, input::PropertyQuery &query, const PoolFacts &pool, const Facts &facts);
// vkWriteMicromapsPropertiesEXT
void checkHostQuery(const InputCheck &check, input::PropertyQuery &query, const Facts &facts);
// The rule of bottom-level pointers, which only top-level structures have: what a structure holds is known later.
inline constexpr const char *kTopLevelOnlyId =
    "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-12425";

// Rules of the address of serialized data, which validation checks again when a copy is executed.
inline constexpr const char *kExtSavedDataId = "VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07536";
inline constexpr const char *kExtRestoredDataId = "VUID-vkCmdCopyMemoryToMicromapEXT-pInfo-07543";
inline constexpr const char *kKhrSavedDataId = "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739";
inline constexpr const char *kKhrRestoredDataId = "VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742";

bool isMicromapQuery(VkQueryType type);
bool isStructureQuery(VkQueryType type);

} // namespace vellum::layer::rules
