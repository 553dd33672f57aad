// SPDX-License-Identifier: Apache-2.0
// The inputs of a micromap build, by either API.
#pragma once

#include "faulty_driver/faults.h"

#include <array>

namespace faults
{

inline constexpr uint32_t kHighestLevel = 12;

struct MicromapInput {
    explicit MicromapInput(const VkMicromapBuildInfoEXT &info);
    explicit MicromapInput(const BuildInfo &info); // of a micromap

    uint64_t target = 0;
    std::vector<VkMicromapUsageEXT> usages;
    bool usagePointers = false; // they were given by ppUsageCounts
    VkDeviceAddress data = 0, triangles = 0;
    VkDeviceSize stride = 0;
    bool lossy = false;
};

// The build with that input instead of its own.
void putInto(VkMicromapBuildInfoEXT &info, const MicromapInput &input);
void putInto(BuildInfo &info, const MicromapInput &input, VkAccelerationStructureGeometryKHR &geometry,
             VkAccelerationStructureGeometryMicromapDataKHR &data, std::vector<VkMicromapUsageKHR> &usages);

uint64_t triangleCount(const MicromapInput &input);

// A triangle of a micromap, with a state 0..3 for each micro-triangle; 0 or 1 in the 2-state format.
struct MicromapTriangle {
    uint32_t level = 0;
    uint16_t format = 0;
    bool lossy = false;
    std::vector<uint8_t> states;
    void *key = nullptr;         // of the device that builds it
    VkDeviceAddress address = 0; // of its data
};
using MicromapTriangles = std::vector<MicromapTriangle>;

// Makes the build read copies of triangles and data that are made when the command buffer is executed: `header` changes
// how a triangle's data is read, `states` what was read, with the triangles before it. Data beyond the triangle's own
// is zero. Either may be null.
void rewriteWhenExecuted(VkCommandBuffer commands, MicromapInput &input, void (*header)(VkMicromapTriangleEXT &),
                         void (*states)(MicromapTriangle &, const MicromapTriangles &before));

} // namespace faults
