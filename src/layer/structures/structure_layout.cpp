#include "layer/structures/structure_layout.h"

#include <algorithm>

#include "core/records.h"

namespace vellum::layer
{

using namespace shared;

VkAccelerationStructureBuildSizesInfoKHR driverSizes(const Driver &driver, DriverBuildInfo &build,
                                                     const uint32_t *primitives,
                                                     VkAccelerationStructureBuildTypeKHR type)
{
    VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    driver.next.GetAccelerationStructureBuildSizesKHR(driver.handle, type, &build.info(), primitives, &sizes);
    return sizes;
}

VkDeviceSize bottomLevelTailBytes(const DriverBuildInfo &build, const uint32_t *primitives)
{
    if (!build.hasMicromaps())
        return 0;
    VkDeviceSize bytes = build.geometryCount() * VkDeviceSize{kGeometryRecordWords + kMicromapNameWords} * 4;
    for (uint32_t i = 0; i < build.geometryCount(); ++i) {
        if (build.micromap(i))
            bytes += alignUp((primitives ? primitives[i] : 0) * VkDeviceSize{kTriangleRecordWords} * 4, 16);
    }
    return alignUp(bytes, kPartAlignment);
}

TopLevelBuild::TopLevelBuild(VkBuildAccelerationStructureFlagsKHR flags, VkDeviceAddress instances)
    : geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR},
      info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR}
{
    geometry.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
    geometry.geometry.instances = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR};
    geometry.geometry.instances.data.deviceAddress = instances;
    info.type = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
    info.flags = topLevelFlags(flags);
    info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
    info.geometryCount = 1;
    info.pGeometries = &geometry;
}

VkAccelerationStructureBuildSizesInfoKHR topLevelDriverSizes(const Driver &driver,
                                                             VkBuildAccelerationStructureFlagsKHR flags, uint32_t count)
{
    VkAccelerationStructureBuildSizesInfoKHR most{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    for (const VkBuildAccelerationStructureFlagsKHR f :
         {topLevelFlags(flags), VkBuildAccelerationStructureFlagsKHR{0}}) {
        const TopLevelBuild build(f, 0);
        VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
        driver.next.GetAccelerationStructureBuildSizesKHR(
            driver.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build.info, &count, &sizes);
        most.accelerationStructureSize = std::max(most.accelerationStructureSize, sizes.accelerationStructureSize);
        most.buildScratchSize = std::max(most.buildScratchSize, sizes.buildScratchSize);
    }
    return most;
}

VkDeviceSize topLevelTailOffset(const Driver &driver, VkBuildAccelerationStructureFlagsKHR flags, uint32_t count)
{
    return alignUp(topLevelDriverSizes(driver, flags, count).accelerationStructureSize, kPartAlignment);
}

VkDeviceSize topLevelBytes(const Driver &driver, VkBuildAccelerationStructureFlagsKHR flags, uint32_t count)
{
    return topLevelTailOffset(driver, flags, count) + VkDeviceSize{count} * sizeof(VkAccelerationStructureInstanceKHR);
}

uint32_t topLevelCapacity(const Driver &driver, VkDeviceSize size)
{
    uint32_t fits = 0;
    // VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03801 and the slots bound it too.
    auto tooMany = static_cast<uint32_t>(std::min<VkDeviceSize>(size / sizeof(VkAccelerationStructureInstanceKHR) + 1,
                                                                VkDeviceSize{kDirectoryPages} << kSlotsPerPageLog2));
    while (tooMany - fits > 1) {
        const uint32_t middle = fits + (tooMany - fits) / 2;
        (topLevelBytes(driver, 0, middle) <= size ? fits : tooMany) = middle;
    }
    return fits;
}

} // namespace vellum::layer
