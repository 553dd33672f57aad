// SPDX-License-Identifier: Apache-2.0
// The commands of micromaps by whichever API a device has. Said in the structures of VK_EXT_opacity_micromap; with
// VK_KHR_opacity_micromap they are put in its own.
#pragma once

#include "gpu/device.h"

#include <cstdint>
#include <span>

namespace vellum::gpu
{

// Among a Micromap's VkBuildMicromapFlagsEXT: KHR's VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR.
inline constexpr VkBuildMicromapFlagsEXT kLossy = 0x400;

// Usages for ranges of memory that other buffers may have as well.
inline constexpr VkAddressCommandFlagsKHR kUnknownUsage =
    VK_ADDRESS_COMMAND_UNKNOWN_STORAGE_BUFFER_USAGE_BIT_KHR |
    VK_ADDRESS_COMMAND_UNKNOWN_TRANSFORM_FEEDBACK_BUFFER_USAGE_BIT_KHR;

// A micromap by the API of its device; the other handle is null.
struct MicromapHandle {
    VkMicromapEXT ext = VK_NULL_HANDLE;
    VkAccelerationStructureKHR khr = VK_NULL_HANDLE;

    // The type for VK_EXT_debug_utils and private data.
    [[nodiscard]] VkObjectType objectType() const
    {
        return khr != VK_NULL_HANDLE ? VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR : VK_OBJECT_TYPE_MICROMAP_EXT;
    }
    [[nodiscard]] uint64_t object() const
    {
        return khr != VK_NULL_HANDLE ? reinterpret_cast<uint64_t>(khr) : reinterpret_cast<uint64_t>(ext);
    }
};

// The usage of buffers that hold micromaps and the input of their builds, with device addresses.
VkBufferUsageFlags micromapStorageUsage(const Device &gpu);
VkBufferUsageFlags micromapInputUsage(const Device &gpu);
// VUID-vkCmdBuildMicromapsEXT-pInfos-07515, VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552
VkDeviceSize micromapInputAlignment(const Device &gpu);

// At an offset in a buffer that begins at that address; `type` is used with VK_KHR_opacity_micromap only.
MicromapHandle
createMicromap(const Device &gpu, VkBuffer buffer, VkDeviceAddress address, VkDeviceSize offset, VkDeviceSize size,
               VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
void destroyMicromap(const Device &gpu, MicromapHandle micromap);

// Usage counts in memory that pointers to them lead through backwards, with others between, which must not be read.
template <class Usage>
std::vector<Usage> scattered(const std::vector<Usage> &usages, std::vector<const Usage *> &pointers)
{
    std::vector<Usage> memory;
    for (size_t i = usages.size(); i-- > 0;) {
        memory.push_back(usages[i]);
        memory.push_back(usages[i]);
        ++memory.back().count;
    }
    pointers.clear();
    for (size_t i = usages.size(); i-- > 0;)
        pointers.push_back(&memory[2 * i]);
    return memory;
}

// A build as VK_KHR_opacity_micromap puts it; where usage counts come by pointers, so does the geometry. Points into
// itself.
struct StructureBuild {
    StructureBuild(const VkMicromapBuildInfoEXT &ext, VkAccelerationStructureKHR target);
    StructureBuild(const StructureBuild &) = delete;
    StructureBuild &operator=(const StructureBuild &) = delete;
    std::vector<VkMicromapUsageKHR> usages;
    std::vector<const VkMicromapUsageKHR *> usagePointers;
    VkAccelerationStructureGeometryMicromapDataKHR data{};
    VkAccelerationStructureGeometryKHR geometry{};
    const VkAccelerationStructureGeometryKHR *geometryPointer = &geometry;
    VkAccelerationStructureBuildGeometryInfoKHR info{};
};

struct MicromapBuild {
    VkMicromapBuildInfoEXT info{};
    MicromapHandle target; // instead of info.dstMicromap
};

// onHost: of VK_EXT_opacity_micromap, for VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_OR_DEVICE_KHR.
VkMicromapBuildSizesInfoEXT micromapSizes(const Device &gpu, const VkMicromapBuildInfoEXT &info, bool onHost = false);
// A size that VK_EXT_opacity_micromap would report as `bytes`: with VK_KHR_opacity_micromap the layer reports the
// next one that is 64 modulo 256, by which it knows a GENERIC structure that was made for a micromap.
VkDeviceSize reportedSize(const Device &gpu, VkDeviceSize bytes);
// Builds of acceleration structures other than micromaps.
struct OtherBuilds {
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> infos;
    std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> ranges;
};
// All by one command. others: built by the same one, between the micromaps; VK_KHR_opacity_micromap only
void recordMicromapBuilds(const Device &gpu, VkCommandBuffer commands, std::span<const MicromapBuild> builds,
                          const OtherBuilds &others = {});

void recordMicromapCopy(const Device &gpu, VkCommandBuffer commands, MicromapHandle from, MicromapHandle to,
                        VkCopyMicromapModeEXT mode);
void recordMicromapToMemory(const Device &gpu, VkCommandBuffer commands, MicromapHandle from, VkDeviceAddress to,
                            VkCopyMicromapModeEXT mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT);
void recordMemoryToMicromap(const Device &gpu, VkCommandBuffer commands, VkDeviceAddress from, MicromapHandle to,
                            VkCopyMicromapModeEXT mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT);

// The type of queries that stands for one of the two of VK_EXT_opacity_micromap; others are left as they are.
VkQueryType micromapQueryType(const Device &gpu, VkQueryType type);
// `type` as a pool was created with.
void recordMicromapProperties(const Device &gpu, VkCommandBuffer commands, std::span<const MicromapHandle> micromaps,
                              VkQueryType type, VkQueryPool pool, uint32_t first);
// A property of one micromap, which the device is asked for at once. `type`: as of VK_EXT_opacity_micromap.
VkDeviceSize queryMicromap(Device &gpu, MicromapHandle micromap, VkQueryType type);
// Host commands of VK_EXT_opacity_micromap, at once or as deferred operations, which are joined.
class HostCommands
{
public:
    HostCommands(Device &gpu, bool deferred) : gpu_(gpu), deferred_(deferred) {}
    void build(std::span<const VkMicromapBuildInfoEXT> infos) const; // by one command
    void copy(VkMicromapEXT from, VkMicromapEXT to, VkCopyMicromapModeEXT mode) const;
    void toMemory(VkMicromapEXT from, void *to) const;
    void toMicromap(const void *from, VkMicromapEXT to) const;
    // The sizes of micromaps, which are written `stride` bytes apart.
    [[nodiscard]] std::vector<VkDeviceSize> sizes(std::span<const VkMicromapEXT> micromaps, VkQueryType type,
                                                  size_t stride) const;

private:
    template <class Command>
    void run(const Command &command) const;

    Device &gpu_;
    bool deferred_;
};

bool micromapIsCompatible(const Device &gpu, const uint8_t *version);

} // namespace vellum::gpu
