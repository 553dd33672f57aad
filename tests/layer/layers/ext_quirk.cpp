// SPDX-License-Identifier: Apache-2.0
// Drivers with micromaps, which a second copy of Vellum's layer below this one gives lavapipe:
// - "ext": VK_EXT_opacity_micromap, and not VK_KHR_opacity_micromap, VK_ARM_pipeline_opacity_micromap or
//   VK_KHR_device_address_commands. It reports every use of these, and of micromaps that are not its own. In serialized
//   micromaps, what follows the two UUIDs is its own.
// - "khr": VK_KHR_opacity_micromap and VK_KHR_device_address_commands, and not the others.
// - "emulating": a driver without micromaps that does not run applications' shaders as they are: the copy emulates
//   micromaps on each device, even if they are not enabled.
// The spy checks what else may reach such devices (knowsMicromaps).
#include "layers/driver.h"

#include <array>
#include <atomic>
#include <cstring>
#include <set>
#include <utility>
#include <vector>

namespace driver
{
namespace
{

constexpr Level kLevel = Level::Ext;

constexpr const char *kPipelines = "VK_ARM_pipeline_opacity_micromap";
// VkPhysicalDevicePipelineOpacityMicromapFeaturesARM, which older headers lack
constexpr auto kPipelineFeatures = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_OPACITY_MICROMAP_FEATURES_ARM;

bool hides(void *key, const char *extension)
{
    if (std::strcmp(extension, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) == 0)
        return !has(key, "ext");
    if (std::strcmp(extension, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME) == 0 ||
        std::strcmp(extension, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME) == 0)
        return !has(key, "khr");
    return std::strcmp(extension, kPipelines) == 0;
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice handle, const char *layer, uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    return listExtensions(kLevel, handle, layer, count, properties, [handle](std::vector<VkExtensionProperties> &all) {
        std::erase_if(all, [handle](const VkExtensionProperties &e) { return hides(keyOf(handle), e.extensionName); });
    });
}

// Takes structures of an output chain out of it while the driver answers, which does not know them.
class Hidden
{
public:
    Hidden(void *key, VkBaseOutStructure *head)
    {
        for (VkBaseOutStructure *s = head; s->pNext != nullptr;) {
            if (unknown(key, s->pNext->sType)) {
                taken_.push_back({s, s->pNext});
                s->pNext = s->pNext->pNext;
            } else {
                s = s->pNext;
            }
        }
    }
    ~Hidden()
    {
        for (auto link = taken_.rbegin(); link != taken_.rend(); ++link)
            link->before->pNext = link->structure;
    }
    Hidden(const Hidden &) = delete;
    Hidden &operator=(const Hidden &) = delete;

private:
    struct Link {
        VkBaseOutStructure *before, *structure;
    };
    static bool unknown(void *key, VkStructureType type)
    {
        if (type == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT ||
            type == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT)
            return !has(key, "ext");
        if (type == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR ||
            type == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_KHR ||
            type == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR)
            return !has(key, "khr");
        return type == kPipelineFeatures;
    }
    std::vector<Link> taken_;
};

VKAPI_ATTR void VKAPI_CALL getFeatures(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2 *features)
{
    const Hidden hidden(keyOf(handle), reinterpret_cast<VkBaseOutStructure *>(features));
    DRIVER_NEXT(vkGetPhysicalDeviceFeatures2)(handle, features);
}

VKAPI_ATTR void VKAPI_CALL getProperties(VkPhysicalDevice handle, VkPhysicalDeviceProperties2 *properties)
{
    const Hidden hidden(keyOf(handle), reinterpret_cast<VkBaseOutStructure *>(properties));
    DRIVER_NEXT(vkGetPhysicalDeviceProperties2)(handle, properties);
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    VkDeviceCreateInfo below = *info;
    std::vector<const char *> extensions(info->ppEnabledExtensionNames,
                                         info->ppEnabledExtensionNames + info->enabledExtensionCount);
    auto features = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>({.micromap = VK_TRUE});
    const bool has = std::any_of(extensions.begin(), extensions.end(), [](const char *name) {
        return std::strcmp(name, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) == 0;
    });
    if (driver::has(keyOf(handle), "emulating") && !has) {
        extensions.push_back(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
        below.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
        below.ppEnabledExtensionNames = extensions.data();
        features.pNext = const_cast<void *>(info->pNext);
        below.pNext = &features;
    }
    // The driver supports micromaps on several physical devices as well; the copy that simulates it does not.
    auto *group =
        inChainOut<VkDeviceGroupDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_DEVICE_GROUP_DEVICE_CREATE_INFO);
    const uint32_t count = group != nullptr ? std::exchange(group->physicalDeviceCount, 1) : 0;
    const VkResult result = DRIVER_NEXT(vkCreateDevice)(handle, &below, allocator, device);
    if (group != nullptr)
        group->physicalDeviceCount = count;
    return result;
}

// --- micromaps ---

std::mutex mutex;
std::set<VkMicromapEXT> micromaps;
std::atomic<uint64_t> builds = 0, misaligned = 0;

void expectMicromap(const char *where, VkMicromapEXT micromap)
{
    bool own = micromap == VK_NULL_HANDLE;
    {
        std::lock_guard lock(mutex);
        own = own || micromaps.contains(micromap);
    }
    if (!own)
        report(std::string(where) + ": a micromap that is not the driver's");
}

VKAPI_ATTR VkResult VKAPI_CALL createMicromap(VkDevice handle, const VkMicromapCreateInfoEXT *info,
                                              const VkAllocationCallbacks *allocator, VkMicromapEXT *micromap)
{
    if (info->type != VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT)
        report("vkCreateMicromapEXT: a type that the driver does not know");
    const VkResult result = DRIVER_NEXT(vkCreateMicromapEXT)(handle, info, allocator, micromap);
    std::lock_guard lock(mutex);
    if (result == VK_SUCCESS)
        micromaps.insert(*micromap);
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyMicromap(VkDevice handle, VkMicromapEXT micromap,
                                           const VkAllocationCallbacks *allocator)
{
    expectMicromap("vkDestroyMicromapEXT", micromap);
    {
        std::lock_guard lock(mutex);
        micromaps.erase(micromap);
    }
    DRIVER_NEXT(vkDestroyMicromapEXT)(handle, micromap, allocator);
}

VKAPI_ATTR void VKAPI_CALL cmdBuildMicromaps(VkCommandBuffer handle, uint32_t count,
                                             const VkMicromapBuildInfoEXT *infos)
{
    for (const VkMicromapBuildInfoEXT &info : std::span(infos, count)) {
        expectMicromap("vkCmdBuildMicromapsEXT", info.dstMicromap);
        constexpr VkBuildMicromapFlagsEXT known = VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT |
                                                  VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT |
                                                  VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
        if ((info.flags & ~known) != 0)
            report("vkCmdBuildMicromapsEXT: flags that the driver does not know");
        if ((info.data.deviceAddress | info.triangleArray.deviceAddress) % 256 != 0)
            ++misaligned;
    }
    builds += count;
    DRIVER_NEXT(vkCmdBuildMicromapsEXT)(handle, count, infos);
}

VKAPI_ATTR void VKAPI_CALL cmdCopyMicromap(VkCommandBuffer handle, const VkCopyMicromapInfoEXT *info)
{
    expectMicromap("vkCmdCopyMicromapEXT", info->src);
    expectMicromap("vkCmdCopyMicromapEXT", info->dst);
    DRIVER_NEXT(vkCmdCopyMicromapEXT)(handle, info);
}

// --- serialized micromaps ---

AddressedBuffers buffers;

VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice handle, const VkBufferCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    if (has(keyOf(handle), "ext") && (info->usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0)
        return buffers.create(kLevel, handle, *info, allocator, buffer);
    return DRIVER_NEXT(vkCreateBuffer)(handle, info, allocator, buffer);
}

VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice handle, VkBuffer buffer, const VkAllocationCallbacks *allocator)
{
    buffers.forget(buffer);
    DRIVER_NEXT(vkDestroyBuffer)(handle, buffer, allocator);
}

VKAPI_ATTR VkDeviceAddress VKAPI_CALL addressOf(VkDevice handle, const VkBufferDeviceAddressInfo *info)
{
    const VkDeviceAddress address = DRIVER_NEXT(vkGetBufferDeviceAddress)(handle, info);
    buffers.setAddress(handle, info->buffer, address);
    return address;
}

// The extension defines two UUIDs. This driver's next bytes, which the copy below does not read on the device, would be
// sizes in other data: they would state that the data ends where its states begin.
VKAPI_ATTR void VKAPI_CALL cmdSerialize(VkCommandBuffer handle, const VkCopyMicromapToMemoryInfoEXT *info)
{
    expectMicromap("vkCmdCopyMicromapToMemoryEXT", info->src);
    DRIVER_NEXT(vkCmdCopyMicromapToMemoryEXT)(handle, info);
    static constexpr std::array<uint64_t, 4> own{64, 64, 0, 64};
    const AddressedBuffers::Found found = buffers.find(handle, info->dst.deviceAddress + 2 * VK_UUID_SIZE, sizeof own);
    if (found.buffer == VK_NULL_HANDLE)
        return report("vkCmdCopyMicromapToMemoryEXT: an address in no buffer");
    DRIVER_NEXT(vkCmdUpdateBuffer)(handle, found.buffer, found.offset, sizeof own, own.data());
}

VKAPI_ATTR void VKAPI_CALL cmdDeserialize(VkCommandBuffer handle, const VkCopyMemoryToMicromapInfoEXT *info)
{
    expectMicromap("vkCmdCopyMemoryToMicromapEXT", info->dst);
    DRIVER_NEXT(vkCmdCopyMemoryToMicromapEXT)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL cmdWriteProperties(VkCommandBuffer handle, uint32_t count, const VkMicromapEXT *all,
                                              VkQueryType type, VkQueryPool pool, uint32_t first)
{
    for (const VkMicromapEXT micromap : std::span(all, count))
        expectMicromap("vkCmdWriteMicromapsPropertiesEXT", micromap);
    DRIVER_NEXT(vkCmdWriteMicromapsPropertiesEXT)(handle, count, all, type, pool, first);
}

// The micromaps given to the last query of sizes and the last build of an acceleration structure.
std::vector<VkMicromapUsageEXT> measuredUsages, builtUsages;

void takeUsages(const VkAccelerationStructureBuildGeometryInfoKHR &info, std::vector<VkMicromapUsageEXT> &usages,
                const char *command)
{
    std::lock_guard lock(mutex);
    usages.clear();
    for (uint32_t i = 0; i < info.geometryCount; ++i) {
        const auto &geometry = info.pGeometries != nullptr ? info.pGeometries[i] : *info.ppGeometries[i];
        const auto *triangles = geometry.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR
                                    ? inChain<VkAccelerationStructureTrianglesOpacityMicromapEXT>(
                                          geometry.geometry.triangles.pNext,
                                          VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT)
                                    : nullptr;
        if (triangles == nullptr)
            continue;
        if (triangles->indexType == VK_INDEX_TYPE_NONE_KHR && triangles->indexBuffer.deviceAddress != 0)
            report(std::string(command) + ": an index buffer of indices of no type");
        for (uint32_t u = 0; u < triangles->usageCountsCount; ++u)
            usages.push_back(triangles->pUsageCounts != nullptr ? triangles->pUsageCounts[u]
                                                                : *triangles->ppUsageCounts[u]);
    }
}

VKAPI_ATTR void VKAPI_CALL getSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *info, const uint32_t *primitives,
                                    VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    takeUsages(*info, measuredUsages, "vkGetAccelerationStructureBuildSizesKHR");
    DRIVER_NEXT(vkGetAccelerationStructureBuildSizesKHR)(handle, type, info, primitives, sizes);
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    for (const auto &info : std::span(infos, count)) {
        takeUsages(info, builtUsages, "vkCmdBuildAccelerationStructuresKHR");
        for (uint32_t i = 0; i < info.geometryCount; ++i) {
            const auto &geometry = info.pGeometries != nullptr ? info.pGeometries[i] : *info.ppGeometries[i];
            if (geometry.geometryType != VK_GEOMETRY_TYPE_TRIANGLES_KHR)
                continue;
            if (const auto *triangles = inChain<VkAccelerationStructureTrianglesOpacityMicromapEXT>(
                    geometry.geometry.triangles.pNext,
                    VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT))
                expectMicromap("vkCmdBuildAccelerationStructuresKHR", triangles->micromap);
        }
    }
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, infos, ranges);
}

} // namespace

LevelRows extRows()
{
    static const Row device[]{
        {"vkCreateMicromapEXT", DRIVER_FUNCTION(createMicromap)},
        {"vkDestroyMicromapEXT", DRIVER_FUNCTION(destroyMicromap)},
        {"vkCmdBuildMicromapsEXT", DRIVER_FUNCTION(cmdBuildMicromaps)},
        {"vkCmdCopyMicromapEXT", DRIVER_FUNCTION(cmdCopyMicromap)},
        {"vkCreateBuffer", DRIVER_FUNCTION(createBuffer)},
        {"vkDestroyBuffer", DRIVER_FUNCTION(destroyBuffer)},
        {"vkGetBufferDeviceAddress", DRIVER_FUNCTION(addressOf)},
        {"vkCmdCopyMicromapToMemoryEXT", DRIVER_FUNCTION(cmdSerialize)},
        {"vkCmdCopyMemoryToMicromapEXT", DRIVER_FUNCTION(cmdDeserialize)},
        {"vkCmdWriteMicromapsPropertiesEXT", DRIVER_FUNCTION(cmdWriteProperties)},
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuild)},
        {"vkGetAccelerationStructureBuildSizesKHR", DRIVER_FUNCTION(getSizes)},
    };
    static const Row instance[]{
        {"vkCreateDevice", DRIVER_FUNCTION(createDevice)},
        {"vkEnumerateDeviceExtensionProperties", DRIVER_FUNCTION(enumerateExtensions)},
        {"vkGetPhysicalDeviceFeatures2", DRIVER_FUNCTION(getFeatures)},
        {"vkGetPhysicalDeviceProperties2", DRIVER_FUNCTION(getProperties)},
    };
    return {device, instance};
}

} // namespace driver

// Tests look this up in the library: the number of micromap builds that drivers of the quirk "ext" received.
extern "C" __attribute__((visibility("default"))) uint64_t vellumExtBuilds();
extern "C" uint64_t vellumExtBuilds()
{
    return driver::builds;
}
// Of these, those that break VUID-vkCmdBuildMicromapsEXT-pInfos-07515.
extern "C" __attribute__((visibility("default"))) uint64_t vellumExtMisaligned();
extern "C" uint64_t vellumExtMisaligned()
{
    return driver::misaligned;
}
// The usage counts of the last query of the sizes of an acceleration structure, or of the last build.
extern "C" __attribute__((visibility("default"))) void vellumExtUsages(bool built,
                                                                       std::vector<VkMicromapUsageEXT> *usages);
extern "C" void vellumExtUsages(bool built, std::vector<VkMicromapUsageEXT> *usages)
{
    std::lock_guard lock(driver::mutex);
    *usages = built ? driver::builtUsages : driver::measuredUsages;
}
