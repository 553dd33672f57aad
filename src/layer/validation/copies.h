// SPDX-License-Identifier: Apache-2.0
// Copies of micromaps and acceleration structures, to each other and to memory.
#pragma once

#include <memory>

#include "layer/input/copies.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{

// Checks the rules of a copy, and of what its source holds when it is executed (`constructed`: their id).
input::Copy checkCopy(const RuleCheck &check, input::Copy copy, const char *constructed);
input::SerializedCopy checkCopy(const RuleCheck &check, input::SerializedCopy copy, const char *constructed);
inline constexpr const char *kSavedMicromapId = "VUID-VkCopyMicromapToMemoryInfoEXT-src-07540";

// The effect of a clone or a compaction.
void copied(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
            const std::shared_ptr<ValidatedStructure> &target);
// The effect of a deserialization: the target holds something that the host does not know. `header`: null if it is not
// known.
void deserialized(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &target,
                  std::shared_ptr<SerializedHeader> header);

} // namespace vellum::layer
