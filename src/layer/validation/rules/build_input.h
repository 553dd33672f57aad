// SPDX-License-Identifier: Apache-2.0
// Builds of micromaps and acceleration structures, as rules see them: the structures of both extensions as one value.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/validation/model/device_model.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct MicromapBuildInput {
    bool khr = false;                           // by VK_KHR_opacity_micromap
    std::shared_ptr<ValidatedStructure> target; // null: unknown
    VkFlags flags = 0;                          // VkBuildMicromapFlagsEXT or VkBuildAccelerationStructureFlagsKHR
    std::vector<VkMicromapUsageEXT> usages;
    uint32_t usageArrays = 1; // of the two arrays of usage counts, how many are given; 1 if there are no counts
    VkDeviceOrHostAddressConstKHR data{};
    VkDeviceOrHostAddressConstKHR triangles{};
    VkDeviceSize triangleStride = 0;
    VkDeviceOrHostAddressKHR scratch{};

    [[nodiscard]] uint64_t triangleCount() const;
};
MicromapBuildInput micromapBuildOf(const DeviceModel &device, const VkMicromapBuildInfoEXT &info);
// nullopt if the only geometry has no data of a micromap.
std::optional<MicromapBuildInput> micromapBuildOf(const DeviceModel &device,
                                                  const VkAccelerationStructureBuildGeometryInfoKHR &info);

// The micromap that a geometry of triangles attaches by the structure of either extension.
struct AttachmentInput {
    bool khr = false; // by that of VK_KHR_opacity_micromap
    VkIndexType indexType = VK_INDEX_TYPE_NONE_KHR;
    VkDeviceOrHostAddressConstKHR indexBuffer{};
    VkDeviceSize indexStride = 0;
    uint32_t baseTriangle = 0;
    ObjectHandle handle;                          // 0 for a null handle
    std::shared_ptr<ValidatedStructure> micromap; // null for a null handle, and if it is unknown
    std::vector<VkMicromapUsageEXT> usages;       // VK_EXT_opacity_micromap has them
    uint32_t usageArrays = 1;                     // as in MicromapBuildInput
};
std::optional<AttachmentInput> attachmentOf(const DeviceModel &device,
                                            const VkAccelerationStructureGeometryKHR &geometry);

// Bytes of an index; 0 without indices and for unknown types.
constexpr uint32_t indexBytes(VkIndexType type)
{
    return type == VK_INDEX_TYPE_UINT8_EXT ? 1
           : type == VK_INDEX_TYPE_UINT16  ? 2
           : type == VK_INDEX_TYPE_UINT32  ? 4
                                           : 0;
}
// Bytes from one instance, or pointer to one, to the next.
inline VkDeviceSize instanceStride(const VkAccelerationStructureGeometryInstancesDataKHR &instances)
{
    return instances.arrayOfPointers ? sizeof(VkDeviceAddress) : sizeof(VkAccelerationStructureInstanceKHR);
}

inline bool buildsMicromap(const VkAccelerationStructureBuildGeometryInfoKHR &info)
{
    return info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
}
// Geometry `g` of a build, from the array or the array of pointers; null if neither is given.
const VkAccelerationStructureGeometryKHR *geometryOf(const VkAccelerationStructureBuildGeometryInfoKHR &info,
                                                     uint32_t g);

} // namespace vellum::layer
