// SPDX-License-Identifier: Apache-2.0
// The driver's builds of one command: direct builds by one call, indirect ones by another.
#pragma once

#include <cstdint>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/structures/structure_input.h"

namespace vellum::layer
{

class DriverBuilds
{
public:
    // The pointers in `info` and `ranges` must stay valid until record().
    void add(const VkAccelerationStructureBuildGeometryInfoKHR &info, const input::BuildRanges &ranges);
    void record(const Driver &driver, VkCommandBuffer commandBuffer) const;

private:
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> direct_, indirect_;
    std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> ranges_; // of direct_
    std::vector<VkDeviceAddress> addresses_;                               // of indirect_, as the next two
    std::vector<uint32_t> strides_;
    std::vector<const uint32_t *> most_;
};

} // namespace vellum::layer
