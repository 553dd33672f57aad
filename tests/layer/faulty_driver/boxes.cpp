// SPDX-License-Identifier: Apache-2.0
// Boxes that are larger or smaller than those that were given: builds of bottom-level structures read changed copies.
#include "faulty_driver/faults.h"

#include <deque>

namespace faults
{
namespace
{

constexpr Level kLevel = Level::Boxes;

// By how much each side of a box moves outwards.
float growth(void *key)
{
    return has(key, "boxes-grown") ? 0.3f : has(key, "boxes-shrunk") ? -0.05f : 0;
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count, const BuildInfo *infos,
                                    const RangeInfo *const *ranges)
{
    const auto build = DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR);
    const float by = growth(keyOf(handle));
    std::vector<BuildInfo> changed(infos, infos + count);
    std::deque<std::vector<VkAccelerationStructureGeometryKHR>> geometries;
    for (uint32_t i = 0; (by < 0 || by > 0) && i < count; ++i) {
        if (infos[i].geometryCount == 0 || geometryOf(infos[i], 0).geometryType != VK_GEOMETRY_TYPE_AABBS_KHR)
            continue;
        auto &own = geometries.emplace_back();
        for (uint32_t g = 0; g < infos[i].geometryCount; ++g) {
            auto &boxes = own.emplace_back(geometryOf(infos[i], g)).geometry.aabbs;
            const RangeInfo range = ranges[i][g];
            const Memory memory =
                memoryFor(handle, range.primitiveOffset + VkDeviceSize{range.primitiveCount} * boxes.stride);
            beforeExecution(handle, [=, from = boxes.data.deviceAddress, stride = boxes.stride] {
                for (uint32_t p = 0; p < range.primitiveCount; ++p) {
                    const VkDeviceSize at = range.primitiveOffset + p * stride;
                    VkAabbPositionsKHR box;
                    std::memcpy(&box, hostPointer<const void>(from + at), sizeof box);
                    box = {box.minX - by, box.minY - by, box.minZ - by, box.maxX + by, box.maxY + by, box.maxZ + by};
                    std::memcpy(memory.bytes + at, &box, sizeof box);
                }
            });
            boxes.data.deviceAddress = memory.address;
        }
        changed[i].pGeometries = own.data();
        changed[i].ppGeometries = nullptr;
    }
    build(handle, count, changed.data(), ranges);
}

} // namespace

LevelRows boxRows()
{
    static const Row device[]{{"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuild)}};
    return {device, {}};
}

} // namespace faults
