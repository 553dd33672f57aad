// SPDX-License-Identifier: Apache-2.0
// Messages about hazards and lifetimes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "layer/validation/sync/sync_tracker.h"

namespace vellum::layer
{

struct DeviceValidation;

namespace sync
{

// Such as "vkCmdBuildMicromapsEXT: pInfos[2]".
std::string placeOf(const Access &access);
void report(DeviceValidation &device, const Hazard &hazard);
// Structures that a submitted command refers to.
void reportDestroyed(DeviceValidation &device, const char *command,
                     const std::vector<std::shared_ptr<ValidatedStructure>> &structures);

} // namespace sync
} // namespace vellum::layer
