// SPDX-License-Identifier: Apache-2.0
// Which device is checked.
#pragma once

#include "check/groups/group.h"
#include "cli/check/protocol.h"

namespace vellum::cli
{

// Loads the drivers. Throws Error where there is no such device.
DeviceSummary describeDevice(const check::SessionOptions &options);

} // namespace vellum::cli
