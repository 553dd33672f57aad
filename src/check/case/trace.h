// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "check/case/case.h"
#include "check/oracle/cpu_trace.h"

namespace vellum::check
{

std::optional<std::string> missingFor(const Device &gpu, const TracePlan &plan);
std::vector<std::string> traceFaults(Device &gpu, const Structure &top, const oracle::Scene &scene,
                                     std::span<const oracle::Hits> hits, const TracePlan &plan,
                                     const std::function<void(VkCommandBuffer)> &beside);

} // namespace vellum::check
