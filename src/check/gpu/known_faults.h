// SPDX-License-Identifier: Apache-2.0
// Faults of drivers that have nothing to do with opacity micromaps: each occurs without them. What would meet one is
// avoided or not judged, and reports name it.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::check
{

enum class Fault {
    ReportChangesAttributes,
    SharedIntersectionStage,
    RayGenerationInLibrary,
    InstanceBehindInvisible,
};

struct KnownFault {
    Fault fault;
    VkDriverId driver;
    uint32_t first, end;       // versions that have it: from `first`, and before `end`
    std::string_view text;     // what the driver does wrong
    std::string_view response; // what is avoided or not judged
};

// Those of a driver.
std::vector<KnownFault> knownFaults(VkDriverId driver, uint32_t version);

} // namespace vellum::check
