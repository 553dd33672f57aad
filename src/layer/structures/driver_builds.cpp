// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/driver_builds.h"

namespace vellum::layer
{

void DriverBuilds::add(const VkAccelerationStructureBuildGeometryInfoKHR &info, const input::BuildRanges &ranges)
{
    if (ranges.direct) {
        direct_.push_back(info);
        ranges_.push_back(ranges.direct);
    } else {
        indirect_.push_back(info);
        addresses_.push_back(ranges.indirect);
        strides_.push_back(ranges.stride);
        most_.push_back(ranges.most);
    }
}

void DriverBuilds::record(const Driver &driver, VkCommandBuffer commandBuffer) const
{
    if (!direct_.empty())
        driver.next.CmdBuildAccelerationStructuresKHR(commandBuffer, static_cast<uint32_t>(direct_.size()),
                                                      direct_.data(), ranges_.data());
    if (!indirect_.empty())
        driver.next.CmdBuildAccelerationStructuresIndirectKHR(commandBuffer, static_cast<uint32_t>(indirect_.size()),
                                                              indirect_.data(), addresses_.data(), strides_.data(),
                                                              most_.data());
}

} // namespace vellum::layer
