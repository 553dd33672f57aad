// SPDX-License-Identifier: Apache-2.0
// Queries of the sizes of micromaps and acceleration structures.
#include <algorithm>
#include <initializer_list>

#include "layer/validation/commands.h"
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer
{
namespace
{

using State = ValidatedQueryPool::State;
using Pool = std::shared_ptr<ValidatedQueryPool>;

// VK_KHR_ray_tracing_maintenance1
constexpr VkQueryType kBottomLevelPointers =
    VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR;

struct QueryIds {
    const char *type;
    const char *poolType;
    const char *range;
    const char *unavailable;
    const char *bound;
    const char *constructed;
    const char *compactable;
    VkQueryType compactedSize;
};
constexpr QueryIds kExtIds{
    "VUID-vkCmdWriteMicromapsPropertiesEXT-queryType-07503",  "VUID-vkCmdWriteMicromapsPropertiesEXT-queryPool-07525",
    "VUID-vkCmdWriteMicromapsPropertiesEXT-query-07528",      "VUID-vkCmdWriteMicromapsPropertiesEXT-None-12417",
    "VUID-vkCmdWriteMicromapsPropertiesEXT-buffer-07527",     "VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-11662",
    "VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-07502", VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT};
constexpr QueryIds kKhrIds{"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryType-06742",
                           "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02493",
                           "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-query-04880",
                           "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02494",
                           "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-buffer-03736",
                           "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-11684",
                           "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-accelerationStructures-03431",
                           VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR};

void setStates(ValidatedQueryPool &pool, uint32_t first, uint32_t count, State state)
{
    for (uint64_t q = first; q < uint64_t{first} + count && q < pool.states.size(); ++q)
        pool.states[q] = state;
}

// The queries of a command that writes them.
void checkQueries(const RuleCheck &check, const Pool &pool, VkQueryType type, uint32_t first, uint32_t count,
                  const QueryIds &ids)
{
    if (pool->type != type)
        return check.fault("queryPool", ids.poolType,
                           "it was created with type " + std::to_string(pool->type) + ", not " + std::to_string(type));
    const size_t queries = pool->states.size();
    if (uint64_t{first} + count > queries)
        return check.fault("firstQuery", ids.range,
                           std::to_string(first) + " and " + std::to_string(count) + " queries; the pool has " +
                               std::to_string(queries));
    check.whenExecuted(ids.unavailable, [pool, first, count]() -> std::string {
        for (uint32_t q = first; q < first + count; ++q) {
            if (pool->states[q] != State::Unavailable)
                return "query " + std::to_string(q) +
                       (pool->states[q] == State::Unknown ? " was never reset" : " is available: it was not reset");
        }
        return {};
    });
}

void checkTopLevel(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &structure)
{
    constexpr const char *kRule = "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-12425";
    if (structure->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR &&
        structure->type != VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR)
        return check.fault(kRule, "the structure was not created as a top-level one");
    check.whenExecuted(kRule, [structure]() -> std::string {
        const auto contents = structure->contents;
        const bool known = contents && contents->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
        return known && contents->type != VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR
                   ? "the structure was not built as a top-level one"
                   : "";
    });
}

void checkStructures(const RuleCheck &command, const char *array,
                     const std::vector<std::shared_ptr<ValidatedStructure>> &structures, VkQueryType type,
                     const QueryIds &ids)
{
    for (uint32_t i = 0; i < structures.size(); ++i) {
        const Place place = command.place().element(array, i);
        const RuleCheck check = command.at(place);
        checkBound(check, structures[i].get(), "buffer", ids.bound);
        checkConstructed(check, structures[i], ids.constructed);
        if (type == ids.compactedSize)
            checkCompactable(check, structures[i], ids.compactable);
        if (type == kBottomLevelPointers && structures[i])
            checkTopLevel(check, structures[i]);
    }
}

void checkBegin(DeviceValidation &device, const char *name, VkQueryPool handle, const char *vuid)
{
    const Pool pool = device.objects.queryPools.get(handle);
    const Place command(name);
    if (device.checks.core && pool)
        RuleCheck(device, command)
            .require(pool->type != VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT &&
                         pool->type != VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT,
                     "queryPool", vuid, "its queries are sizes of micromaps");
}

// `types`: those that the command takes.
void writeProperties(const RuleCheck &command, const char *array,
                     const std::vector<std::shared_ptr<ValidatedStructure>> &structures, VkQueryType type,
                     std::initializer_list<VkQueryType> types, VkQueryPool handle, uint32_t first, const QueryIds &ids)
{
    const DeviceModel &device = command.device();
    const Pool pool = device.objects.queryPools.get(handle);
    const auto count = static_cast<uint32_t>(structures.size());
    if (device.checks.core) {
        if (std::ranges::find(types, type) == types.end())
            command.fault("queryType", ids.type, std::to_string(type) + " is not a type that this command writes");
        else if (pool)
            checkQueries(command, pool, type, first, count, ids);
        checkStructures(command, array, structures, type, ids);
    }
    if (pool)
        command.whenExecuted([pool, first, count] { setStates(*pool, first, count, State::Available); });
}

template <typename Handle, typename Map>
std::vector<std::shared_ptr<ValidatedStructure>> structuresOf(const Map &map, uint32_t count, const Handle *handles)
{
    std::vector<std::shared_ptr<ValidatedStructure>> structures;
    for (uint32_t i = 0; i < count; ++i)
        structures.push_back(map.get(handles[i]));
    return structures;
}

} // namespace

namespace validation
{

VkResult createQueryPool(DeviceValidation &device, VkDevice handle, const VkQueryPoolCreateInfo *info,
                         const VkAllocationCallbacks *allocator, VkQueryPool *result)
{
    const VkResult created = device.next.CreateQueryPool(handle, info, allocator, result);
    if (created != VK_SUCCESS)
        return created;
    remember([&] {
        auto pool = std::make_shared<ValidatedQueryPool>();
        pool->type = info->queryType;
        pool->states.assign(info->queryCount, State::Unknown);
        device.objects.queryPools.set(*result, std::move(pool));
    });
    return created;
}

void destroyQueryPool(DeviceValidation &device, VkDevice handle, VkQueryPool pool,
                      const VkAllocationCallbacks *allocator)
{
    device.objects.queryPools.take(pool);
    device.next.DestroyQueryPool(handle, pool, allocator);
}

void resetQueryPool(DeviceValidation &device, VkDevice handle, VkQueryPool pool, uint32_t first, uint32_t count)
{
    if (const Pool known = device.objects.queryPools.get(pool))
        setStates(*known, first, count, State::Unavailable);
    device.next.ResetQueryPool(handle, pool, first, count);
}

void cmdResetQueryPool(DeviceValidation &device, VkCommandBuffer commandBuffer, VkQueryPool pool, uint32_t first,
                       uint32_t count)
{
    if (const Pool known = device.objects.queryPools.get(pool)) {
        device.logs.add(commandBuffer, [known, first, count](const Submission &) {
            setStates(*known, first, count, State::Unavailable);
        });
    }
    device.next.CmdResetQueryPool(commandBuffer, pool, first, count);
}

void cmdBeginQuery(DeviceValidation &device, VkCommandBuffer commandBuffer, VkQueryPool pool, uint32_t query,
                   VkQueryControlFlags flags)
{
    checkBegin(device, "vkCmdBeginQuery", pool, "VUID-vkCmdBeginQuery-queryType-08972");
    device.next.CmdBeginQuery(commandBuffer, pool, query, flags);
}

void cmdBeginQueryIndexed(DeviceValidation &device, VkCommandBuffer commandBuffer, VkQueryPool pool, uint32_t query,
                          VkQueryControlFlags flags, uint32_t index)
{
    checkBegin(device, "vkCmdBeginQueryIndexedEXT", pool, "VUID-vkCmdBeginQueryIndexedEXT-queryType-08972");
    device.next.CmdBeginQueryIndexedEXT(commandBuffer, pool, query, flags, index);
}

void cmdWriteMicromapsProperties(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                 const VkMicromapEXT *micromaps, VkQueryType type, VkQueryPool pool, uint32_t first)
{
    const char *const name = "vkCmdWriteMicromapsPropertiesEXT";
    checkCount(device, name, "micromapCount", count, "VUID-vkCmdWriteMicromapsPropertiesEXT-micromapCount-arraylength");
    const Place place(name);
    const auto known = structuresOf(device.objects.micromaps, count, micromaps);
    writeProperties(RuleCheck(device, place, commandBuffer, commandBuffer), "pMicromaps", known, type,
                    {VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT}, pool,
                    first, kExtIds);
    sync::recordQuery(device.sync, commandBuffer, name, "pMicromaps", known);
    device.next.CmdWriteMicromapsPropertiesEXT(commandBuffer, count, micromaps, type, pool, first);
}

void cmdWriteAccelerationStructuresProperties(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                              const VkAccelerationStructureKHR *structures, VkQueryType type,
                                              VkQueryPool pool, uint32_t first)
{
    const char *const name = "vkCmdWriteAccelerationStructuresPropertiesKHR";
    checkCount(device, name, "accelerationStructureCount", count,
               "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-accelerationStructureCount-arraylength");
    const Place place(name);
    const auto known = structuresOf(device.objects.structures, count, structures);
    writeProperties(RuleCheck(device, place, commandBuffer, commandBuffer), "pAccelerationStructures", known, type,
                    {VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
                     VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR,
                     VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR, kBottomLevelPointers},
                    pool, first, kKhrIds);
    sync::recordQuery(device.sync, commandBuffer, name, "pAccelerationStructures", known);
    device.next.CmdWriteAccelerationStructuresPropertiesKHR(commandBuffer, count, structures, type, pool, first);
}

} // namespace validation
} // namespace vellum::layer
