// SPDX-License-Identifier: Apache-2.0
// Which device is checked.
#pragma once

#include "cli/check/protocol.h"

namespace vellum::cli
{

// Loads the drivers. Throws Error where there is no such device.
DeviceSummary describeDevice(const WorkerOptions &options);

} // namespace vellum::cli
