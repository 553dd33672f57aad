#include <algorithm>
#include <string>
#include <vector>

#include "layer/translation/device_translation.h"
#include "layer/translation/placed_micromaps.h"
#include "layer/translation/translation.h"

namespace vellum::layer
{
namespace
{

constexpr VkQueryResultFlags kTaken = VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT;

// The driver's type of query about a micromap; VK_QUERY_TYPE_MAX_ENUM where it has none.
VkQueryType micromapType(VkQueryType type)
{
    switch (type) {
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR: return VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT;
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR:
        return VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT;
    default: return VK_QUERY_TYPE_MAX_ENUM;
    }
}

// A structure of that size is to be known as one for a micromap.
bool marks(VkQueryType type)
{
    return type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
}

void writeMicromap(DeviceTranslation &device, VkCommandBuffer commandBuffer, const AccelerationStructure &structure,
                   VkQueryType type, const QueryPool &pool, uint32_t query)
{
    const DeviceTable &next = device.driver.next;
    const PlacedMicromap micromap = lastMicromap(device, structure);
    const VkDeviceSize value = pool.valueInBuffer(query);
    if (const VkQueryType own = micromapType(type); own != VK_QUERY_TYPE_MAX_ENUM && micromap.handle) {
        next.CmdWriteMicromapsPropertiesEXT(commandBuffer, 1, &micromap.handle, own, pool.micromaps, query);
        next.CmdCopyQueryPoolResults(commandBuffer, pool.micromaps, query, 1, pool.memory.buffer(), value, 8, kTaken);
    } else if (type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR) {
        // EXT has no such query. A clone has as many bytes as its source:
        // VUID-VkCopyAccelerationStructureInfoKHR-mode-12418.
        const uint64_t bytes = markedMicromapSize(micromap.bytes);
        next.CmdUpdateBuffer(commandBuffer, pool.memory.buffer(), value, sizeof bytes, &bytes);
    }
}

} // namespace

void cmdWriteTranslatedProperties(DeviceTranslation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                  const VkAccelerationStructureKHR *structures, VkQueryType type, VkQueryPool queryPool,
                                  uint32_t first)
{
    constexpr const char *kCommand = "vkCmdWriteAccelerationStructuresPropertiesKHR";
    const auto pool = device.queries.pools.get(queryPool);
    if (!mayWriteProperties(device.queries, pool.get(), type))
        return;
    if (count == 0 || !queriesInRange(device.queries, *pool, first, count, kCommand))
        return;
    const Judge judge(device.driver.report(), kCommand);
    std::vector<std::shared_ptr<AccelerationStructure>> micromaps; // null: another structure
    for (uint32_t i = 0; i < count; ++i) {
        if (!mayWriteProperty(device.queries, judge, structures[i], i, type))
            return;
        const auto structure = device.objects.accelerationStructures.get(structures[i]);
        const std::optional<bool> isMicromap = knownMicromap(*structure);
        if (!isMicromap)
            device.driver.report().warning(
                "VELLUM-unknown-content",
                std::string(kCommand) + ": pAccelerationStructures[" + std::to_string(i) +
                    "] is of type GENERIC, and nothing was recorded into it so far: it is taken for no micromap");
        micromaps.push_back(isMicromap.value_or(false) ? structure : nullptr);
    }
    if (marks(type) && InjectedWork::refusedIn(device.commands, commandBuffer, kCommand))
        return;
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    for (uint32_t begin = 0; begin < count;) {
        uint32_t end = begin;
        while (end < count && !micromaps[end])
            ++end;
        if (end > begin) {
            device.driver.next.CmdWriteAccelerationStructuresPropertiesKHR(
                commandBuffer, end - begin, structures + begin, type, queryPool, first + begin);
            device.driver.next.CmdCopyQueryPoolResults(commandBuffer, queryPool, first + begin, end - begin,
                                                       pool->memory.buffer(), pool->valueInBuffer(first + begin), 8,
                                                       kTaken);
        }
        if (end < count)
            writeMicromap(device, commandBuffer, *micromaps[end], type, *pool, first + end);
        begin = end + 1;
    }
    if (marks(type) && std::ranges::any_of(micromaps, [](const auto &micromap) { return micromap != nullptr; })) {
        work.barrier();
        for (uint32_t i = 0; i < count; ++i) {
            if (micromaps[i])
                work.dispatch(InjectedShader::MarkedSize, MarkedSizePush{pool->valueAddress(first + i)}, 1, 1);
        }
    }
    makeAvailable(work, device.queries, commandBuffer, *pool, first, count);
}

VkResult writeTranslatedProperties(DeviceTranslation &device, VkDevice handle, uint32_t count,
                                   const VkAccelerationStructureKHR *structures, VkQueryType type, size_t bytes,
                                   void *data, size_t stride)
{
    for (uint32_t i = 0; i < count; ++i) {
        const auto structure = device.objects.accelerationStructures.get(structures[i]);
        if (structure && !knownMicromap(*structure).value_or(true))
            continue;
        device.driver.report().notAvailable("vkWriteAccelerationStructuresPropertiesKHR of a micromap");
        return VK_ERROR_FEATURE_NOT_PRESENT;
    }
    return device.driver.next.WriteAccelerationStructuresPropertiesKHR(handle, count, structures, type, bytes, data,
                                                                       stride);
}

} // namespace vellum::layer
