// SPDX-License-Identifier: Apache-2.0
// Queries of the sizes of micromaps and acceleration structures.
#include <span>

#include "layer/input/checked.h"
#include "layer/rules/copies.h"
#include "layer/validation/commands.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{
namespace
{

using State = ValidatedQueryPool::State;
using Pool = std::shared_ptr<ValidatedQueryPool>;

// VK_QUERY_POOL_CREATE_RESET_BIT_KHR of VK_KHR_maintenance9: queries need no reset before their first use.
constexpr VkQueryPoolCreateFlags kResetAtCreation = 1;

// Rules of the queries and of what is queried, when a command is executed.
struct QueryIds {
    const char *unavailable;
    const char *constructed;
    const char *compactable;
    VkQueryType compactedSize;
};
constexpr QueryIds kExtIds{
    "VUID-vkCmdWriteMicromapsPropertiesEXT-None-12417", "VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-11662",
    "VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-07502", VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT};
constexpr QueryIds kKhrIds{"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02494",
                           "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-11684",
                           "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-accelerationStructures-03431",
                           VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR};

void setStates(ValidatedQueryPool &pool, uint32_t first, uint32_t count, State state)
{
    for (uint64_t q = first; q < uint64_t{first} + count && q < pool.states.size(); ++q)
        pool.states[q] = state;
}

// The queries of a command that writes them: all in the pool, which has their type.
void checkUnavailable(const RuleCheck &check, const Pool &pool, uint32_t first, uint32_t count, const char *vuid)
{
    check.whenExecuted(vuid, [pool, first, count]() -> std::string {
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
    if (structure->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR &&
        structure->type != VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR)
        return; // a rule of the input
    check.whenExecuted(rules::kTopLevelOnlyId, [structure]() -> std::string {
        const auto contents = structure->contents;
        const bool known = contents && contents->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
        return known && contents->type != VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR
                   ? "the structure was not built as a top-level one"
                   : "";
    });
}

void checkBegin(DeviceValidation &device, const char *name, VkQueryPool handle, const char *vuid)
{
    const Pool pool = device.objects.queryPools.get(handle);
    if (device.checks.core && pool &&
        (pool->type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT ||
         pool->type == VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT))
        device.at(Place(name)).report(vuid, "queryPool", "its queries are sizes of micromaps");
}

// Checks a query of properties of these structures, and changes the pool's queries when it is executed.
void checkQuery(const RuleCheck &command, input::PropertyQuery &query, const Pool &pool,
                std::span<const std::shared_ptr<ValidatedStructure>> structures)
{
    const QueryIds &ids = query.khr ? kKhrIds : kExtIds;
    const DeviceModel &device = command.model();
    const auto count = static_cast<uint32_t>(query.objects.size());
    rules::PoolFacts facts{.kind = pool                        ? rules::PoolFacts::Kind::Known
                                   : device.objects.anyUnknown ? rules::PoolFacts::Kind::Unknown
                                                               : rules::PoolFacts::Kind::None};
    if (pool) {
        facts.type = pool->type;
        facts.count = static_cast<uint32_t>(pool->states.size());
    }
    rules::checkQuery(command, query, facts, [&device](ObjectHandle object) { return device.factsOf(object); });
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.place().element(query.khr ? "pAccelerationStructures" : "pMicromaps", i);
        const RuleCheck check = command.at(place);
        checkConstructed(check, structures[i], ids.constructed);
        if (query.type == ids.compactedSize)
            checkCompactable(check, structures[i], ids.compactable);
        if (query.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR && structures[i])
            checkTopLevel(check, structures[i]);
    }
    if (!pool)
        return;
    if (device.checks.core && pool->type == query.type && uint64_t{query.first} + count <= facts.count)
        checkUnavailable(command, pool, query.first, count, ids.unavailable);
    command.afterExecution(
        [pool, first = query.first, count](bool) { setStates(*pool, first, count, State::Available); });
}

template <typename Handle>
using WritesProperties = void(VKAPI_PTR *)(VkCommandBuffer, uint32_t, const Handle *, VkQueryType, VkQueryPool,
                                           uint32_t);

// A command that writes properties of the structures in `array`.
template <typename Handle>
void writeProperties(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *name, const char *array,
                     uint32_t count, const Handle *handles, VkQueryType type, VkQueryPool handle, uint32_t first,
                     WritesProperties<Handle> next)
{
    const Place place(name);
    const Pool pool = device.objects.queryPools.get(handle);
    input::PropertyQuery query = input::parseQuery(count, handles, type, first);
    std::vector<std::shared_ptr<ValidatedStructure>> structures;
    for (const ObjectHandle object : query.objects)
        structures.push_back(device.objects.structureOf(object));
    checkQuery({device, place, commandBuffer, commandBuffer}, query, pool, structures);
    sync::recordQuery(device.sync, commandBuffer, name, array, structures);
    sync::recordUse(device.sync, commandBuffer, name, pool);
    const input::Checked checked(handles, query);
    next(commandBuffer, count, handles, type, handle, first);
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
    remember(device.objects, [&] {
        auto pool = std::make_shared<ValidatedQueryPool>();
        pool->handle = {VK_OBJECT_TYPE_QUERY_POOL, uint64_t(*result)};
        pool->number = ++device.numbers;
        pool->type = info->queryType;
        pool->states.assign(info->queryCount,
                            (info->flags & kResetAtCreation) != 0 ? State::Unavailable : State::Unknown);
        device.objects.queryPools.set(*result, std::move(pool));
    });
    return created;
}

void destroyQueryPool(DeviceValidation &device, VkDevice handle, VkQueryPool pool,
                      const VkAllocationCallbacks *allocator)
{
    if (const Pool known = device.objects.queryPools.take(pool)) {
        sync::checkUnused(device.sync, Place("vkDestroyQueryPool"), "VUID-vkDestroyQueryPool-queryPool-00793", *known);
        known->destroyed = true;
    }
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
        sync::recordUse(device.sync, commandBuffer, "vkCmdResetQueryPool", known);
    }
    device.next.CmdResetQueryPool(commandBuffer, pool, first, count);
}

void cmdCopyQueryPoolResults(DeviceValidation &device, VkCommandBuffer commandBuffer, VkQueryPool pool, uint32_t first,
                             uint32_t count, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize stride,
                             VkQueryResultFlags flags)
{
    const char *const name = "vkCmdCopyQueryPoolResults";
    sync::recordUse(device.sync, commandBuffer, name, device.objects.queryPools.get(pool));
    // At least one number of each query.
    const VkDeviceSize number = (flags & VK_QUERY_RESULT_64_BIT) != 0 ? 8 : 4;
    if (count > 0)
        sync::recordWrite(device.sync, commandBuffer, name, buffer, offset, (count - 1) * stride + number);
    device.next.CmdCopyQueryPoolResults(commandBuffer, pool, first, count, buffer, offset, stride, flags);
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
    writeProperties(device, commandBuffer, "vkCmdWriteMicromapsPropertiesEXT", "pMicromaps", count, micromaps, type,
                    pool, first, device.next.CmdWriteMicromapsPropertiesEXT);
}

void cmdWriteAccelerationStructuresProperties(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                              const VkAccelerationStructureKHR *structures, VkQueryType type,
                                              VkQueryPool pool, uint32_t first)
{
    writeProperties(device, commandBuffer, "vkCmdWriteAccelerationStructuresPropertiesKHR", "pAccelerationStructures",
                    count, structures, type, pool, first, device.next.CmdWriteAccelerationStructuresPropertiesKHR);
}

VkResult writeMicromapsProperties(DeviceValidation &device, VkDevice handle, uint32_t count,
                                  const VkMicromapEXT *micromaps, VkQueryType type, size_t bytes, void *data,
                                  size_t stride)
{
    const Place command("vkWriteMicromapsPropertiesEXT");
    checkCount(device, "vkWriteMicromapsPropertiesEXT", "micromapCount", count,
               "VUID-vkWriteMicromapsPropertiesEXT-micromapCount-arraylength");
    input::PropertyQuery query = input::parseQuery(count, micromaps, type, 0);
    query.bytes = bytes;
    query.stride = stride;
    query.memory = data;
    rules::checkHostQuery(device.at(command), query, [&device](ObjectHandle object) { return device.factsOf(object); });
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pMicromaps", i);
        const RuleCheck part(device, place, micromaps[i]);
        const auto micromap = device.objects.micromaps.get(micromaps[i]);
        checkConstructed(part, micromap, "VUID-vkWriteMicromapsPropertiesEXT-pMicromaps-11671");
        if (type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT)
            checkCompactable(part, micromap, "VUID-vkWriteMicromapsPropertiesEXT-pMicromaps-07502");
    }
    const input::Checked checked(micromaps, query);
    return device.next.WriteMicromapsPropertiesEXT(handle, count, micromaps, type, bytes, data, stride);
}

VkResult writeAccelerationStructuresProperties(DeviceValidation &device, VkDevice handle, uint32_t count,
                                               const VkAccelerationStructureKHR *structures, VkQueryType type,
                                               size_t bytes, void *data, size_t stride)
{
    const Place command("vkWriteAccelerationStructuresPropertiesKHR");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pAccelerationStructures", i);
        checkConstructed(RuleCheck(device, place, structures[i]), device.objects.structures.get(structures[i]),
                         "VUID-vkWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-11591");
    }
    return device.next.WriteAccelerationStructuresPropertiesKHR(handle, count, structures, type, bytes, data, stride);
}

} // namespace validation
} // namespace vellum::layer
