// SPDX-License-Identifier: Apache-2.0
// The quirk "structures": a driver whose structures need more when they are built than they hold. The sizes of builds
// are larger by half than lavapipe's, and odd; what lies between both sizes is the driver's to write, and gets a
// pattern; the size and the compacted size are lavapipe's, and a copy is of so many bytes. Of a handle the driver
// writes no more than a structure needs, however large it is, as lavapipe does from Mesa 26 on; so it says that it is
// that one.
//
// What a structure holds is known here by what was recorded last at its place, and of deserialized ones, once that was
// executed, by what lavapipe has written.
#include "layers/driver.h"

#include <cstdio>
#include <map>
#include <vector>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Structures;

using Key = std::pair<VkBuffer, VkDeviceSize>; // of a place: buffer, offset

struct Handle {
    VkDevice device = VK_NULL_HANDLE;
    Key place;
    VkDeviceSize size = 0;
    VkAccelerationStructureTypeKHR type{};
};
struct Content {
    VkDeviceSize bytes = 0;   // written by lavapipe
    VkDeviceSize claimed = 0; // reported by the driver
};
struct ExactSizeHandle { // a handle of lavapipe's, of just that many bytes
    Key place;
    VkDeviceSize bytes;
    VkAccelerationStructureTypeKHR type;
    auto operator<=>(const ExactSizeHandle &) const = default;
};

std::mutex mutex;
std::map<VkAccelerationStructureKHR, Handle> handles;
std::map<Key, Content> contents;
std::map<ExactSizeHandle, VkAccelerationStructureKHR> exactSizeHandles;

constexpr VkDeviceSize claimedBytes(VkDeviceSize bytes)
{
    return (bytes + bytes / 2) | 1;
}

VKAPI_ATTR void VKAPI_CALL getProperties2(VkPhysicalDevice handle, VkPhysicalDeviceProperties2 *properties)
{
    DRIVER_NEXT(vkGetPhysicalDeviceProperties2)(handle, properties);
    const auto say = [](char *text) { std::snprintf(text, VK_MAX_DRIVER_INFO_SIZE, "Mesa 26.0.0 (a mock driver)"); };
    if (auto *driver = inChainOut<VkPhysicalDeviceDriverProperties>(
            properties->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES))
        say(driver->driverInfo);
    if (auto *core = inChainOut<VkPhysicalDeviceVulkan12Properties>(
            properties->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES))
        say(core->driverInfo);
}

// The garbage is written by a transfer.
VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice handle, const VkBufferCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    VkBufferCreateInfo below = *info;
    if ((info->usage & VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR) != 0)
        below.usage |= VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    return DRIVER_NEXT(vkCreateBuffer)(handle, &below, allocator, buffer);
}

VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice handle, VkBuffer buffer, const VkAllocationCallbacks *allocator)
{
    std::vector<VkAccelerationStructureKHR> gone;
    {
        std::lock_guard lock(mutex);
        std::erase_if(contents, [buffer](const auto &entry) { return entry.first.first == buffer; });
        std::erase_if(exactSizeHandles, [&](const auto &entry) {
            if (entry.first.place.first != buffer)
                return false;
            gone.push_back(entry.second);
            return true;
        });
    }
    for (const VkAccelerationStructureKHR structure : gone)
        DRIVER_NEXT(vkDestroyAccelerationStructureKHR)(handle, structure, nullptr);
    DRIVER_NEXT(vkDestroyBuffer)(handle, buffer, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL createStructure(VkDevice handle, const VkAccelerationStructureCreateInfoKHR *info,
                                               const VkAllocationCallbacks *allocator,
                                               VkAccelerationStructureKHR *structure)
{
    const VkResult result = DRIVER_NEXT(vkCreateAccelerationStructureKHR)(handle, info, allocator, structure);
    std::lock_guard lock(mutex);
    if (result == VK_SUCCESS)
        handles[*structure] = {handle, {info->buffer, info->offset}, info->size, info->type};
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyStructure(VkDevice handle, VkAccelerationStructureKHR structure,
                                            const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        handles.erase(structure);
    }
    DRIVER_NEXT(vkDestroyAccelerationStructureKHR)(handle, structure, allocator);
}

Handle handleOf(VkAccelerationStructureKHR structure)
{
    std::lock_guard lock(mutex);
    return handles[structure];
}

// Content that lavapipe 25 writes at the beginning of a structure, which is host memory: its bounds, and the size of
// its serialized form, which consists of the specification's header, the handles of instances, and the structure.
Content writtenBy(VkAccelerationStructureKHR structure)
{
    const Handle own = handleOf(structure);
    auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = structure});
    const VkDevice handle = own.device;
    const auto *words =
        reinterpret_cast<const uint32_t *>(DRIVER_NEXT(vkGetAccelerationStructureDeviceAddressKHR)(handle, &query));
    const VkDeviceSize serialized = words[6], besides = 56 + VkDeviceSize{8} * words[7];
    if (serialized <= besides || serialized - besides > own.size || words[8] >= serialized || words[9] != 0)
        return {};
    return {serialized - besides, serialized - besides};
}

// Zeros: not known.
Content contentOf(VkAccelerationStructureKHR structure)
{
    {
        std::lock_guard lock(mutex);
        const auto found = contents.find(handles[structure].place);
        if (found != contents.end() && found->second.bytes > 0)
            return found->second;
    }
    return writtenBy(structure);
}

void setContent(VkAccelerationStructureKHR structure, const Content &content)
{
    std::lock_guard lock(mutex);
    contents[handles[structure].place] = content;
}

VkAccelerationStructureKHR ofExactSize(VkCommandBuffer handle, VkAccelerationStructureKHR structure, VkDeviceSize bytes)
{
    std::lock_guard lock(mutex);
    const Handle &own = handles[structure];
    if (bytes == 0 || bytes >= own.size)
        return structure;
    const auto [known, isNew] = exactSizeHandles.try_emplace({own.place, bytes, own.type}, VK_NULL_HANDLE);
    if (!isNew)
        return known->second;
    auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = own.place.first, .offset = own.place.second, .size = bytes, .type = own.type});
    DRIVER_NEXT(vkCreateAccelerationStructureKHR)(deviceOf(keyOf(handle)), &info, nullptr, &known->second);
    return known->second;
}

// A size between lavapipe's and the claimed one.
void writeGarbage(VkCommandBuffer handle, VkAccelerationStructureKHR structure, const Content &content)
{
    const Handle own = handleOf(structure);
    const VkDeviceSize begin = (own.place.second + content.bytes + 3) & ~VkDeviceSize{3};
    const VkDeviceSize end = (own.place.second + std::min(content.claimed, own.size)) & ~VkDeviceSize{3};
    if (begin < end)
        DRIVER_NEXT(vkCmdFillBuffer)(handle, own.place.first, begin, end - begin, 0xdeadbeef);
}

VKAPI_ATTR void VKAPI_CALL getBuildSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                         const VkAccelerationStructureBuildGeometryInfoKHR *info,
                                         const uint32_t *counts, VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    DRIVER_NEXT(vkGetAccelerationStructureBuildSizesKHR)(handle, type, info, counts, sizes);
    sizes->accelerationStructureSize = claimedBytes(sizes->accelerationStructureSize);
}

VkDeviceSize neededBytes(VkCommandBuffer handle, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                         const std::vector<uint32_t> &counts)
{
    auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    DRIVER_NEXT(vkGetAccelerationStructureBuildSizesKHR)
    (deviceOf(keyOf(handle)), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, counts.data(), &sizes);
    return sizes.accelerationStructureSize;
}

// A build as lavapipe gets it. `counts`: of each geometry.
VkAccelerationStructureBuildGeometryInfoKHR exactSizeBuild(VkCommandBuffer handle,
                                                           const VkAccelerationStructureBuildGeometryInfoKHR &info,
                                                           const std::vector<uint32_t> &counts)
{
    VkAccelerationStructureBuildGeometryInfoKHR below = info;
    const Handle target = handleOf(info.dstAccelerationStructure);
    const bool update = info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    const VkDeviceSize bytes = neededBytes(handle, info, counts);
    Content content{bytes, claimedBytes(bytes)};
    if (target.size < (update ? content.bytes : content.claimed))
        report(
            "vkCmdBuildAccelerationStructuresKHR: VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126: a handle of " +
            std::to_string(target.size) + " bytes for a build of " + std::to_string(content.claimed));
    if (update) {
        // As compact as the source of the update, also after deserialization.
        const Content source = contentOf(info.srcAccelerationStructure);
        content = source.bytes > 0 ? source : Content{bytes, bytes};
        below.srcAccelerationStructure = ofExactSize(handle, info.srcAccelerationStructure, content.bytes);
    }
    below.dstAccelerationStructure = ofExactSize(handle, info.dstAccelerationStructure, content.bytes);
    setContent(info.dstAccelerationStructure, content);
    if (!update)
        writeGarbage(handle, info.dstAccelerationStructure, content);
    return below;
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> below;
    for (uint32_t i = 0; i < count; ++i) {
        std::vector<uint32_t> counts;
        for (const auto &range : std::span(ranges[i], infos[i].geometryCount))
            counts.push_back(range.primitiveCount);
        below.push_back(exactSizeBuild(handle, infos[i], counts));
    }
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, below.data(), ranges);
}

VKAPI_ATTR void VKAPI_CALL cmdBuildIndirect(VkCommandBuffer handle, uint32_t count,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> below;
    for (uint32_t i = 0; i < count; ++i)
        below.push_back(exactSizeBuild(handle, infos[i], {most[i], most[i] + infos[i].geometryCount}));
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresIndirectKHR)(handle, count, below.data(), addresses, strides, most);
}

VKAPI_ATTR void VKAPI_CALL cmdCopy(VkCommandBuffer handle, const VkCopyAccelerationStructureInfoKHR *info)
{
    VkCopyAccelerationStructureInfoKHR below = *info;
    Content content = contentOf(info->src);
    content.claimed = content.bytes;
    // Only the device knows the size of a compacted copy, so a layer cannot know it during recording.
    const bool compacts = info->mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;
    const VkDeviceSize capacity = handleOf(info->dst).size;
    if (!compacts && capacity < content.bytes)
        report("VUID-VkCopyAccelerationStructureInfoKHR-mode-12418: a handle of " + std::to_string(capacity) +
               " bytes for " + std::to_string(content.bytes));
    below.src = ofExactSize(handle, info->src, content.bytes);
    below.dst = ofExactSize(handle, info->dst, content.bytes);
    if (content.bytes > 0)
        below.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR;
    DRIVER_NEXT(vkCmdCopyAccelerationStructureKHR)(handle, &below);
    setContent(info->dst, content);
    if (content.bytes > 0)
        writeGarbage(handle, info->dst, content);
}

VKAPI_ATTR void VKAPI_CALL cmdSerialize(VkCommandBuffer handle, const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    VkCopyAccelerationStructureToMemoryInfoKHR below = *info;
    below.src = ofExactSize(handle, info->src, contentOf(info->src).bytes);
    DRIVER_NEXT(vkCmdCopyAccelerationStructureToMemoryKHR)(handle, &below);
}

VKAPI_ATTR void VKAPI_CALL cmdDeserialize(VkCommandBuffer handle,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    setContent(info->dst, {});
    DRIVER_NEXT(vkCmdCopyMemoryToAccelerationStructureKHR)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL cmdWriteProperties(VkCommandBuffer handle, uint32_t count,
                                              const VkAccelerationStructureKHR *list, VkQueryType type,
                                              VkQueryPool pool, uint32_t first)
{
    std::vector<VkAccelerationStructureKHR> below(list, list + count);
    for (VkAccelerationStructureKHR &structure : below)
        structure = ofExactSize(handle, structure, contentOf(structure).bytes);
    DRIVER_NEXT(vkCmdWriteAccelerationStructuresPropertiesKHR)(handle, count, below.data(), type, pool, first);
}

} // namespace

driver::LevelRows driver::structureRows()
{
    static const Row device[]{
        {"vkCreateBuffer", DRIVER_FUNCTION(createBuffer)},
        {"vkDestroyBuffer", DRIVER_FUNCTION(destroyBuffer)},
        {"vkCreateAccelerationStructureKHR", DRIVER_FUNCTION(createStructure)},
        {"vkDestroyAccelerationStructureKHR", DRIVER_FUNCTION(destroyStructure)},
        {"vkGetAccelerationStructureBuildSizesKHR", DRIVER_FUNCTION(getBuildSizes)},
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuild)},
        {"vkCmdBuildAccelerationStructuresIndirectKHR", DRIVER_FUNCTION(cmdBuildIndirect)},
        {"vkCmdCopyAccelerationStructureKHR", DRIVER_FUNCTION(cmdCopy)},
        {"vkCmdCopyAccelerationStructureToMemoryKHR", DRIVER_FUNCTION(cmdSerialize)},
        {"vkCmdCopyMemoryToAccelerationStructureKHR", DRIVER_FUNCTION(cmdDeserialize)},
        {"vkCmdWriteAccelerationStructuresPropertiesKHR", DRIVER_FUNCTION(cmdWriteProperties)},
    };
    static const Row instance[]{{"vkGetPhysicalDeviceProperties2", DRIVER_FUNCTION(getProperties2)}};
    return {device, instance};
}
