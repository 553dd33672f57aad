// SPDX-License-Identifier: Apache-2.0
// Faults in copies, serialized data, and queries of sizes.
#include "faulty_driver/faults.h"

#include <map>
#include <set>

namespace faults
{
namespace
{

constexpr Level kLevel = Level::Copies;

std::mutex mutex;
std::map<uint64_t, uint64_t> clones;    // and what they are clones of
std::map<uint64_t, uint64_t> triangles; // of micromaps
std::map<uint64_t, uint32_t> lost;      // by compaction, or copies
std::set<uint64_t> lossy;
std::map<uint64_t, uint64_t> places;      // where the memory of a micromap begins
std::map<uint64_t, uint64_t> handleSizes; // of micromaps of VK_EXT_opacity_micromap
uint64_t hostBarriers = 0;                // recorded so far
std::set<uint64_t> filledPlaces;          // with a micromap, which may be gone
std::map<std::pair<void *, VkQueryType>, uint64_t> lastQueried;

void fill(uint64_t micromap) // under the lock
{
    clones.erase(micromap);
    lost.erase(micromap);
    lossy.erase(micromap);
    if (const auto place = places.find(micromap); place != places.end())
        filledPlaces.insert(place->second);
}

void noteCopy(void *key, uint64_t source, uint64_t target, bool compact)
{
    std::lock_guard lock(mutex);
    const auto count = triangles.find(source);
    if (count == triangles.end()) // no micromap
        return;
    const bool isLossy = lossy.contains(source);
    fill(target);
    triangles[target] = count->second;
    if (isLossy)
        lossy.insert(target);
    if (isLossy && has(key, "lossy-copy-loses-more"))
        lost[target] = 0;
    if (!compact && has(key, "clone-is-shallow"))
        clones[target] = source;
    if (compact && has(key, "compaction-loses-last-triangle") && count->second > 0)
        lost[target] = static_cast<uint32_t>(count->second) - 1;
}

void notePlace(uint64_t micromap, uint64_t place)
{
    std::lock_guard lock(mutex);
    places[micromap] = place;
}

// True if deserialization leaves the micromap's memory unchanged.
bool keepsOld(void *key, uint64_t target)
{
    std::lock_guard lock(mutex);
    const auto place = places.find(target);
    const bool filled = place != places.end() && filledPlaces.contains(place->second);
    fill(target);
    return filled && has(key, "deserialization-keeps-old");
}

// The structures that are queried instead.
template <class Handle>
std::vector<Handle> queriedInstead(void *key, std::span<const Handle> all, VkQueryType type, bool compactedSize)
{
    std::vector<Handle> instead(all.begin(), all.end());
    if (compactedSize && has(key, "compacted-size-of-another"))
        std::rotate(instead.begin(), instead.begin() + 1, instead.end());
    if (!has(key, "query-of-previous"))
        return instead;
    std::lock_guard lock(mutex);
    for (Handle &handle : instead) {
        uint64_t &last = lastQueried[{key, type}];
        const uint64_t current = numberOf(handle);
        if (last != 0)
            handle = handleOf<Handle>(last);
        last = current;
    }
    return instead;
}

uint32_t firstOf(VkCommandBuffer handle, uint32_t first)
{
    return has(keyOf(handle), "query-first-ignored") ? 0 : first;
}

VkDeviceSize packedStride(VkQueryResultFlags flags)
{
    return ((flags & VK_QUERY_RESULT_64_BIT) != 0 ? 8u : 4u) *
           ((flags & VK_QUERY_RESULT_WITH_AVAILABILITY_BIT) != 0 ? 2u : 1u);
}

VKAPI_ATTR VkResult VKAPI_CALL getResults(VkDevice handle, VkQueryPool pool, uint32_t first, uint32_t count,
                                          size_t size, void *data, VkDeviceSize stride, VkQueryResultFlags flags)
{
    if (has(keyOf(handle), "results-stride-ignored"))
        stride = packedStride(flags);
    const VkResult result = DRIVER_NEXT(vkGetQueryPoolResults)(handle, pool, first, count, size, data, stride, flags);
    if (!has(keyOf(handle), "results-without-availability") || (flags & VK_QUERY_RESULT_WITH_AVAILABILITY_BIT) == 0)
        return result;
    for (uint32_t i = 0; i < count; ++i) {
        const uint64_t available = 1;
        const size_t word = packedStride(flags) / 2;
        std::memcpy(static_cast<uint8_t *>(data) + i * stride + word, &available, word);
    }
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL copyResults(VkCommandBuffer handle, VkQueryPool pool, uint32_t first, uint32_t count,
                                       VkBuffer buffer, VkDeviceSize offset, VkDeviceSize stride,
                                       VkQueryResultFlags flags)
{
    if (has(keyOf(handle), "copied-results-stride-ignored"))
        stride = packedStride(flags);
    DRIVER_NEXT(vkCmdCopyQueryPoolResults)(handle, pool, first, count, buffer, offset, stride, flags);
}

VKAPI_ATTR void VKAPI_CALL resetQueries(VkCommandBuffer handle, VkQueryPool pool, uint32_t first, uint32_t count)
{
    if (!has(keyOf(handle), "reset-does-nothing"))
        DRIVER_NEXT(vkCmdResetQueryPool)(handle, pool, first, count);
}

VKAPI_ATTR void VKAPI_CALL resetQueriesOnHost(VkDevice handle, VkQueryPool pool, uint32_t first, uint32_t count)
{
    if (!has(keyOf(handle), "host-reset-does-nothing"))
        DRIVER_NEXT(vkResetQueryPool)(handle, pool, first, count);
}

VKAPI_ATTR void VKAPI_CALL writeMicromapProperties(VkCommandBuffer handle, uint32_t count, const VkMicromapEXT *all,
                                                   VkQueryType type, VkQueryPool pool, uint32_t first)
{
    const auto instead = queriedInstead<VkMicromapEXT>(keyOf(handle), {all, count}, type,
                                                       type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT);
    DRIVER_NEXT(vkCmdWriteMicromapsPropertiesEXT)
    (handle, count, instead.data(), type, pool, firstOf(handle, first));
}

VKAPI_ATTR void VKAPI_CALL writeStructureProperties(VkCommandBuffer handle, uint32_t count,
                                                    const VkAccelerationStructureKHR *all, VkQueryType type,
                                                    VkQueryPool pool, uint32_t first)
{
    const auto instead = queriedInstead<VkAccelerationStructureKHR>(
        keyOf(handle), {all, count}, type, type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR);
    DRIVER_NEXT(vkCmdWriteAccelerationStructuresPropertiesKHR)
    (handle, count, instead.data(), type, pool, firstOf(handle, first));
}

// The bytes behind the clone's that a copy as large as its source writes.
void writeAsMuchAsSource(VkCommandBuffer handle, const VkCopyMicromapInfoEXT &info)
{
    if (!has(keyOf(handle), "clones-as-large-as-sources") || info.mode != VK_COPY_MICROMAP_MODE_CLONE_EXT)
        return;
    std::lock_guard lock(mutex);
    const uint64_t from = handleSizes[numberOf(info.src)], to = handleSizes[numberOf(info.dst)];
    if (from > to)
        afterExecution(handle, [at = places[numberOf(info.dst)] + to] { *hostPointer<uint8_t>(at) = 0; });
}

VKAPI_ATTR void VKAPI_CALL copyMicromap(VkCommandBuffer handle, const VkCopyMicromapInfoEXT *info)
{
    writeAsMuchAsSource(handle, *info);
    noteCopy(keyOf(handle), numberOf(info->src), numberOf(info->dst), info->mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    DRIVER_NEXT(vkCmdCopyMicromapEXT)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL copyStructure(VkCommandBuffer handle, const VkCopyAccelerationStructureInfoKHR *info)
{
    noteCopy(keyOf(handle), numberOf(info->src), numberOf(info->dst),
             info->mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    DRIVER_NEXT(vkCmdCopyAccelerationStructureKHR)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL restoreMicromap(VkCommandBuffer handle, const VkCopyMemoryToMicromapInfoEXT *info)
{
    if (!keepsOld(keyOf(handle), numberOf(info->dst)))
        DRIVER_NEXT(vkCmdCopyMemoryToMicromapEXT)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL restoreStructure(VkCommandBuffer handle,
                                            const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    if (!keepsOld(keyOf(handle), numberOf(info->dst)))
        DRIVER_NEXT(vkCmdCopyMemoryToAccelerationStructureKHR)(handle, info);
}

// The header of serialized data: two UUIDs, its own size, and the size of what is restored from it.
void changeHeader(VkCommandBuffer handle, VkDeviceAddress data)
{
    if (has(keyOf(handle), "serialized-header-size"))
        afterExecution(handle, [data] {
            uint64_t *sizes = hostPointer<uint64_t>(data + 2 * VK_UUID_SIZE);
            sizes[1] = sizes[0];
        });
}

// What the host sees of serialized data until a barrier makes it visible.
void hideFromHost(VkCommandBuffer handle, VkDeviceAddress data)
{
    if (!has(keyOf(handle), "host-reads-after-barriers"))
        return;
    std::lock_guard lock(mutex);
    afterExecution(handle, [data, before = hostBarriers] {
        std::lock_guard own(mutex);
        if (hostBarriers == before)
            std::memset(hostPointer<uint8_t>(data), 0, size_t{2} * VK_UUID_SIZE);
    });
}

VKAPI_ATTR void VKAPI_CALL pipelineBarrier(VkCommandBuffer handle, VkPipelineStageFlags from, VkPipelineStageFlags to,
                                           VkDependencyFlags flags, uint32_t memories, const VkMemoryBarrier *memory,
                                           uint32_t buffers, const VkBufferMemoryBarrier *buffer, uint32_t images,
                                           const VkImageMemoryBarrier *image)
{
    if ((to & VK_PIPELINE_STAGE_HOST_BIT) != 0) {
        std::lock_guard lock(mutex);
        ++hostBarriers;
    }
    DRIVER_NEXT(vkCmdPipelineBarrier)
    (handle, from, to, flags, memories, memory, buffers, buffer, images, image);
}

VKAPI_ATTR void VKAPI_CALL saveMicromap(VkCommandBuffer handle, const VkCopyMicromapToMemoryInfoEXT *info)
{
    DRIVER_NEXT(vkCmdCopyMicromapToMemoryEXT)(handle, info);
    changeHeader(handle, info->dst.deviceAddress);
    hideFromHost(handle, info->dst.deviceAddress);
}

VKAPI_ATTR void VKAPI_CALL saveStructure(VkCommandBuffer handle, const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    DRIVER_NEXT(vkCmdCopyAccelerationStructureToMemoryKHR)(handle, info);
    changeHeader(handle, info->dst.deviceAddress);
    hideFromHost(handle, info->dst.deviceAddress);
}

VKAPI_ATTR VkResult VKAPI_CALL createMicromap(VkDevice handle, const VkMicromapCreateInfoEXT *info,
                                              const VkAllocationCallbacks *allocator, VkMicromapEXT *micromap)
{
    const VkResult result = DRIVER_NEXT(vkCreateMicromapEXT)(handle, info, allocator, micromap);
    const auto query = vkInit<VkBufferDeviceAddressInfo>({.buffer = info->buffer});
    if (result != VK_SUCCESS)
        return result;
    notePlace(numberOf(*micromap), DRIVER_NEXT(vkGetBufferDeviceAddress)(handle, &query) + info->offset);
    std::lock_guard lock(mutex);
    handleSizes[numberOf(*micromap)] = info->size;
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createStructure2(VkDevice handle, const VkAccelerationStructureCreateInfo2KHR *info,
                                                const VkAllocationCallbacks *allocator,
                                                VkAccelerationStructureKHR *structure)
{
    const VkResult result = DRIVER_NEXT(vkCreateAccelerationStructure2KHR)(handle, info, allocator, structure);
    if (result == VK_SUCCESS && info->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
        notePlace(numberOf(*structure), info->addressRange.address);
    return result;
}

VKAPI_ATTR void VKAPI_CALL copyMemory(VkCommandBuffer handle, const VkCopyDeviceMemoryInfoKHR *info)
{
    DRIVER_NEXT(vkCmdCopyMemoryKHR)(handle, info);
    if (!has(keyOf(handle), "memory-copy-clears-rest"))
        return;
    for (uint32_t i = 0; i < info->regionCount; ++i) {
        const VkDeviceMemoryCopyKHR region = info->pRegions[i];
        afterExecution(handle, [region] {
            std::memset(hostPointer<uint8_t>(region.dstRange.address + region.srcRange.size), 0,
                        region.dstRange.size - region.srcRange.size);
        });
    }
}

VKAPI_ATTR void VKAPI_CALL copyImageToMemory(VkCommandBuffer handle, const VkCopyDeviceMemoryImageInfoKHR *info)
{
    VkCopyDeviceMemoryImageInfoKHR changed = *info;
    std::vector<VkDeviceMemoryImageCopyKHR> regions(info->pRegions, info->pRegions + info->regionCount);
    for (VkDeviceMemoryImageCopyKHR &region : regions) {
        if (has(keyOf(handle), "image-copy-row-length"))
            region.addressRowLength = 0;
    }
    changed.pRegions = regions.data();
    DRIVER_NEXT(vkCmdCopyImageToMemoryKHR)(handle, &changed);
}

} // namespace

uint64_t originalOf(uint64_t micromap)
{
    std::lock_guard lock(mutex);
    const auto found = clones.find(micromap);
    return found == clones.end() ? micromap : found->second;
}

uint32_t lostTriangleOf(uint64_t micromap)
{
    std::lock_guard lock(mutex);
    const auto found = lost.find(micromap);
    return found == lost.end() ? UINT32_MAX : found->second;
}

void noteBuilt(uint64_t micromap, uint64_t count, bool isLossy)
{
    std::lock_guard lock(mutex);
    fill(micromap);
    triangles[micromap] = count;
    if (isLossy)
        lossy.insert(micromap);
}

uint64_t trianglesOf(uint64_t micromap)
{
    std::lock_guard lock(mutex);
    const auto found = triangles.find(micromap);
    return found == triangles.end() ? 0 : found->second;
}

bool isLossy(uint64_t micromap)
{
    std::lock_guard lock(mutex);
    return lossy.contains(micromap);
}

void forgetCopies(uint64_t micromap)
{
    std::lock_guard lock(mutex);
    std::erase_if(clones, [micromap](const auto &c) { return c.first == micromap || c.second == micromap; });
    std::erase_if(lastQueried, [micromap](const auto &q) { return q.second == micromap; });
    triangles.erase(micromap);
    lost.erase(micromap);
    lossy.erase(micromap);
    places.erase(micromap);
}

LevelRows copyRows()
{
    static const Row device[]{
        {"vkCmdWriteMicromapsPropertiesEXT", DRIVER_FUNCTION(writeMicromapProperties)},
        {"vkCmdWriteAccelerationStructuresPropertiesKHR", DRIVER_FUNCTION(writeStructureProperties)},
        {"vkGetQueryPoolResults", DRIVER_FUNCTION(getResults)},
        {"vkCmdCopyQueryPoolResults", DRIVER_FUNCTION(copyResults)},
        {"vkCmdResetQueryPool", DRIVER_FUNCTION(resetQueries)},
        {"vkResetQueryPool", DRIVER_FUNCTION(resetQueriesOnHost)},
        {"vkCmdPipelineBarrier", DRIVER_FUNCTION(pipelineBarrier)},
        {"vkCmdCopyMicromapEXT", DRIVER_FUNCTION(copyMicromap)},
        {"vkCmdCopyAccelerationStructureKHR", DRIVER_FUNCTION(copyStructure)},
        {"vkCmdCopyMemoryToMicromapEXT", DRIVER_FUNCTION(restoreMicromap)},
        {"vkCmdCopyMemoryToAccelerationStructureKHR", DRIVER_FUNCTION(restoreStructure)},
        {"vkCmdCopyMicromapToMemoryEXT", DRIVER_FUNCTION(saveMicromap)},
        {"vkCmdCopyAccelerationStructureToMemoryKHR", DRIVER_FUNCTION(saveStructure)},
        {"vkCmdCopyMemoryKHR", DRIVER_FUNCTION(copyMemory)},
        {"vkCmdCopyImageToMemoryKHR", DRIVER_FUNCTION(copyImageToMemory)},
        {"vkCreateMicromapEXT", DRIVER_FUNCTION(createMicromap)},
        {"vkCreateAccelerationStructure2KHR", DRIVER_FUNCTION(createStructure2)},
    };
    return {device, {}};
}

} // namespace faults
