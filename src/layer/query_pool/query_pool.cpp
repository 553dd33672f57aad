// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "core/records.h"
#include "layer/base/commands.h"
#include "layer/base/undo.h"
#include "layer/input/checked.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/micromaps/micromap_input.h"
#include "layer/query_pool/device_query_pools.h"
#include "layer/rules/copies.h"
#include "layer/structures/exact_size_handle.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr const char *kWriteProperties = "vkCmdWriteAccelerationStructuresPropertiesKHR";

// The format of results in memory: vkGetQueryPoolResults.
struct Format {
    explicit Format(VkQueryResultFlags flags)
        : wide((flags & VK_QUERY_RESULT_64_BIT) != 0),
          // A status takes the place of availability; these queries cannot fail.
          both((flags & (VK_QUERY_RESULT_WITH_AVAILABILITY_BIT | VK_QUERY_RESULT_WITH_STATUS_BIT_KHR)) != 0)
    {
    }
    [[nodiscard]] size_t bytes() const { return (wide ? 8u : 4u) * (both ? 2u : 1u); }
    bool wide;
    bool both;
};

void writeWord(const Format &format, uint8_t *&at, uint64_t value)
{
    const auto narrow = static_cast<uint32_t>(value); // an overflow wraps
    std::memcpy(at, format.wide ? static_cast<const void *>(&value) : &narrow, format.wide ? 8 : 4);
    at += format.wide ? 8 : 4;
}

// Writes one query's result; false if it is not available and so not written.
bool writeResult(VkQueryResultFlags flags, uint8_t *at, uint64_t value, bool available)
{
    const Format format(flags);
    const bool partial = (flags & VK_QUERY_RESULT_PARTIAL_BIT) != 0;
    if (available)
        writeWord(format, at, value);
    else if (partial)
        writeWord(format, at, 0);
    else
        at += format.wide ? 8 : 4;
    if (format.both)
        writeWord(format, at, available ? 1 : 0);
    return available || partial;
}

// Waits until the device has written a query. As in drivers, that may never happen.
VkResult wait(const DeviceQueryPools &device, VkQueryPool handle, const QueryPool &pool, uint32_t query)
{
    for (uint32_t turn = 0; !pool.available(query); ++turn) {
        if (turn < 100) {
            std::this_thread::yield();
            continue;
        }
        std::this_thread::sleep_for(std::chrono::microseconds(200));
        // The result of the driver's pool is not used, but the call fails if the device is lost.
        uint64_t unused = 0;
        const VkResult result = device.driver.next.GetQueryPoolResults(
            device.driver.handle, handle, query, 1, sizeof unused, &unused, sizeof unused, VK_QUERY_RESULT_64_BIT);
        if (result < 0)
            return result;
    }
    return VK_SUCCESS;
}

// The copies of query results from the pool's memory to `offset` in a buffer. Transfers only: the command
// may be recorded for a queue that has no compute shaders (its Supported Queue Types). A value that is not available is
// zero, which PARTIAL allows, and is undefined without it.
std::vector<VkBufferCopy> copiesOf(const QueryPool &pool, uint32_t first, uint32_t count, VkDeviceSize offset,
                                   VkDeviceSize stride, const Format &format)
{
    const VkDeviceSize number = format.wide ? 8 : 4;
    if (stride == number && format.wide && !format.both)
        return {{pool.valueInBuffer(first), offset, count * number}};
    std::vector<VkBufferCopy> regions;
    for (uint32_t i = 0; i < count; ++i, offset += stride) {
        regions.push_back({pool.valueInBuffer(first + i), offset, number});
        if (!format.both)
            continue;
        regions.push_back({pool.availabilityInBuffer(first + i), offset + number, 4});
        if (format.wide)
            regions.push_back({pool.zeroInBuffer(), offset + number + 4, 4});
    }
    return regions;
}

// Creates the pool for the driver's micromaps, if they have a query of that type.
VkResult createMicromapPool(const DeviceQueryPools &device, const VkQueryPoolCreateInfo &info, VkQueryPool &result)
{
    VkQueryPoolCreateInfo micromaps = info;
    micromaps.pNext = nullptr;
    switch (info.queryType) {
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR:
        micromaps.queryType = VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT;
        break;
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR:
        micromaps.queryType = VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT;
        break;
    default: return VK_SUCCESS;
    }
    return device.driver.next.CreateQueryPool(device.driver.handle, &micromaps, nullptr, &result);
}

// Returns whether a command's queries are all in the pool.
bool checkQueries(const DeviceQueryPools &device, const QueryPool &pool, uint32_t first, uint64_t count,
                  const char *command)
{
    if (first + count <= pool.count)
        return true;
    device.driver.report().error("VELLUM-query-range", std::string(command) + ": queries " + std::to_string(first) +
                                                           " to " + std::to_string(first + count) + " of a pool of " +
                                                           std::to_string(pool.count));
    return false;
}

// Comes after the values, so that a reader that sees the query available also sees its value.
void makeAvailable(InjectedWork &work, const DeviceQueryPools &device, VkCommandBuffer commandBuffer,
                   const QueryPool &pool, uint32_t first, uint32_t count)
{
    work.barrier(true);
    device.driver.next.CmdFillBuffer(commandBuffer, pool.memory.buffer(), pool.availabilityInBuffer(first),
                                     count * 4ull, 1);
    work.barrier(true);
}

// Finds the structures of a command and the properties to be queried. False: a structure does not exist any more.
bool findProperties(const DeviceQueryPools &device, const input::PropertyQuery &query, const QueryPool &pool,
                    std::span<const VkAccelerationStructureKHR> handles,
                    std::vector<std::shared_ptr<AccelerationStructure>> &structures,
                    std::vector<Backend::Property> &properties)
{
    for (const VkAccelerationStructureKHR handle : handles) {
        const auto i = static_cast<uint32_t>(structures.size());
        const auto &structure = structures.emplace_back(device.objects.accelerationStructures.get(handle));
        if (!structure)
            return false;
        // The device may find out meanwhile what a structure holds, so this is looked up once.
        const std::optional<bool> micromap = holdsMicromap(device.driver, *structure);
        if (!micromap && device.driver.translated() && !query.byValidation)
            device.driver.report().warning("VELLUM-unknown-content",
                                           std::string(kWriteProperties) + ": pAccelerationStructures[" +
                                               std::to_string(i) +
                                               "] is of type GENERIC, and nothing was recorded into it so far: it is "
                                               "treated as not a micromap");
        const uint32_t q = query.first + i;
        properties.push_back({pool.type, *structure, micromap.value_or(false), pool.memory.buffer(),
                              pool.valueInBuffer(q), pool.valueAddress(q), pool.micromaps, q});
    }
    return true;
}

// The query of a command, checked.
template <typename Handle>
input::PropertyQuery queryOf(const DeviceQueryPools &device, const char *command, uint32_t count, const Handle *handles,
                             VkQueryType type, const QueryPool *pool, uint32_t first, const rules::Facts &facts)
{
    return input::Checked<input::PropertyQuery>::take(handles, [&] {
        input::PropertyQuery parsed = input::parseQuery(count, handles, type, first);
        rules::PoolFacts poolFacts;
        if (pool)
            poolFacts = {.type = pool->type, .count = pool->count};
        const Place place(command);
        rules::checkQuery(InputCheck(device.objects.rules, place), parsed, poolFacts, facts);
        return parsed;
    });
}

} // namespace

uint64_t QueryPool::value(uint32_t query) const
{
    uint64_t result;
    std::memcpy(&result, memory.words() + query * size_t{2}, sizeof result);
    return result;
}

bool QueryPool::available(uint32_t query) const
{
    return __atomic_load_n(memory.words() + availabilityOffset(query) / 4, __ATOMIC_ACQUIRE) != 0;
}

VkResult createQueryPool(DeviceQueryPools &device, VkDevice handle, const VkQueryPoolCreateInfo *info,
                         const VkAllocationCallbacks *allocator, VkQueryPool *result)
{
    const bool micromaps = rules::isMicromapQuery(info->queryType) && device.driver.emulated();
    if (!micromaps && !rules::isStructureQuery(info->queryType))
        return device.driver.next.CreateQueryPool(handle, info, allocator, result);
    auto pool = std::make_shared<QueryPool>();
    pool->type = info->queryType;
    pool->count = info->queryCount;
    pool->memory = PooledMemory(device.memory, info->queryCount * 12ull + 4);
    if (!pool->memory.address())
        return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    std::memset(pool->memory.words(), 0, pool->memory.bytes());
    VkQueryPoolCreateInfo driverInfo = *info;
    if (micromaps)
        driverInfo.queryType = VK_QUERY_TYPE_OCCLUSION;
    VkResult driver = device.driver.next.CreateQueryPool(handle, &driverInfo, allocator, result);
    if (driver != VK_SUCCESS)
        return driver;
    Undo undo([&] {
        if (pool->micromaps)
            device.driver.next.DestroyQueryPool(handle, pool->micromaps, nullptr);
        device.driver.next.DestroyQueryPool(handle, *result, allocator);
        *result = VK_NULL_HANDLE;
    });
    if (device.driver.translated() && device.driver.enabled.khr)
        driver = createMicromapPool(device, *info, pool->micromaps);
    if (driver != VK_SUCCESS)
        return driver;
    device.pools.set(*result, pool);
    undo.keep();
    return driver;
}

void destroyQueryPool(DeviceQueryPools &device, VkDevice handle, VkQueryPool pool,
                      const VkAllocationCallbacks *allocator)
{
    if (const auto known = device.pools.take(pool); known && known->micromaps)
        device.driver.next.DestroyQueryPool(handle, known->micromaps, nullptr);
    device.driver.next.DestroyQueryPool(handle, pool, allocator);
}

void resetQueryPool(DeviceQueryPools &device, VkDevice handle, VkQueryPool queryPool, uint32_t first, uint32_t count)
{
    const auto pool = device.pools.get(queryPool);
    if (pool && !checkQueries(device, *pool, first, count, "vkResetQueryPool"))
        return;
    if (pool) {
        uint32_t *words = pool->memory.words();
        std::memset(words + pool->availabilityOffset(first) / 4, 0, count * size_t{4});
        std::memset(words + first * size_t{2}, 0, count * size_t{8});
        if (pool->micromaps)
            device.driver.next.ResetQueryPool(handle, pool->micromaps, first, count);
    }
    device.driver.next.ResetQueryPool(handle, queryPool, first, count);
}

void cmdResetQueryPool(DeviceQueryPools &device, VkCommandBuffer commandBuffer, VkQueryPool queryPool, uint32_t first,
                       uint32_t count)
{
    const auto pool = device.pools.get(queryPool);
    if (pool && !checkQueries(device, *pool, first, count, "vkCmdResetQueryPool"))
        return;
    if (pool && count > 0) {
        InjectedWork work(device.commands, commandBuffer);
        work.barrier();
        device.driver.next.CmdFillBuffer(commandBuffer, pool->memory.buffer(), pool->availabilityInBuffer(first),
                                         count * 4ull, 0);
        device.driver.next.CmdFillBuffer(commandBuffer, pool->memory.buffer(), pool->valueInBuffer(first), count * 8ull,
                                         0);
        work.barrier(true);
        if (pool->micromaps)
            device.driver.next.CmdResetQueryPool(commandBuffer, pool->micromaps, first, count);
    }
    device.driver.next.CmdResetQueryPool(commandBuffer, queryPool, first, count);
}

VkResult getQueryPoolResults(DeviceQueryPools &device, VkDevice handle, VkQueryPool queryPool, uint32_t first,
                             uint32_t count, size_t size, void *data, VkDeviceSize stride, VkQueryResultFlags flags)
{
    const auto pool = device.pools.get(queryPool);
    if (!pool)
        return device.driver.next.GetQueryPoolResults(handle, queryPool, first, count, size, data, stride, flags);
    if (!checkQueries(device, *pool, first, count, "vkGetQueryPoolResults"))
        return VK_ERROR_UNKNOWN;
    bool complete = true;
    for (uint32_t i = 0; i < count && i * stride + Format(flags).bytes() <= size; ++i) {
        const uint32_t query = first + i;
        if ((flags & VK_QUERY_RESULT_WAIT_BIT) != 0) {
            if (const VkResult result = wait(device, queryPool, *pool, query); result != VK_SUCCESS)
                return result;
        }
        const bool available = pool->available(query); // before the value is read
        complete &= writeResult(flags, static_cast<uint8_t *>(data) + i * stride, pool->value(query), available);
    }
    return complete ? VK_SUCCESS : VK_NOT_READY;
}

void cmdCopyQueryPoolResults(DeviceQueryPools &device, VkCommandBuffer commandBuffer, VkQueryPool queryPool,
                             uint32_t first, uint32_t count, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize stride,
                             VkQueryResultFlags flags)
{
    const auto pool = device.pools.get(queryPool);
    if (!pool)
        return device.driver.next.CmdCopyQueryPoolResults(commandBuffer, queryPool, first, count, buffer, offset,
                                                          stride, flags);
    if (count == 0 || !checkQueries(device, *pool, first, count, "vkCmdCopyQueryPoolResults"))
        return;
    InjectedWork work(device.commands, commandBuffer);
    // The barrier waits for all earlier work on this queue, which is the command's first synchronization scope: the
    // application must wait for results of another queue with a semaphore, even with VK_QUERY_RESULT_WAIT_BIT.
    work.barrier();
    const std::vector<VkBufferCopy> regions = copiesOf(*pool, first, count, offset, stride, Format(flags));
    device.driver.next.CmdCopyBuffer(commandBuffer, pool->memory.buffer(), buffer,
                                     static_cast<uint32_t>(regions.size()), regions.data());
    work.barrier(true);
}

void cmdWriteMicromapsProperties(DeviceQueryPools &device, VkCommandBuffer commandBuffer, uint32_t count,
                                 const VkMicromapEXT *micromaps, VkQueryType type, VkQueryPool queryPool,
                                 uint32_t first)
{
    constexpr const char *kCommand = "vkCmdWriteMicromapsPropertiesEXT";
    const auto pool = device.pools.get(queryPool);
    const auto query = queryOf(device, kCommand, count, micromaps, type, pool.get(), first, micromapFacts);
    if (!query.accepted || !pool || count == 0 || InjectedWork::rejectedIn(device.commands, commandBuffer, kCommand))
        return;
    const bool compacted = type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT;
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    std::vector<CompactedSize> sizes;
    for (uint32_t i = 0; i < count; ++i) {
        const Micromap &micromap = *micromapOf(micromaps[i]);
        const VkDeviceAddress value = pool->valueAddress(first + i);
        recordMicromapProperty(work, device.driver, micromap, compacted ? kQueryMicromapSize : kQueryMicromapSerialized,
                               value);
        sizes.push_back({micromap, value});
    }
    if (compacted)
        recordCompactedSizes(device.structures.micromaps, commandBuffer, work, sizes);
    makeAvailable(work, device, commandBuffer, *pool, first, count);
}

void cmdWriteAccelerationStructuresProperties(DeviceQueryPools &device, VkCommandBuffer commandBuffer, uint32_t count,
                                              const VkAccelerationStructureKHR *structures, VkQueryType type,
                                              VkQueryPool queryPool, uint32_t first)
{
    const auto pool = device.pools.get(queryPool);
    const auto query =
        queryOf(device, kWriteProperties, count, structures, type, pool.get(), first,
                [&objects = device.objects](ObjectHandle handle) { return structureFacts(objects, handle); });
    if (!query.accepted || !pool || count == 0)
        return;
    std::vector<std::shared_ptr<AccelerationStructure>> known;
    std::vector<Backend::Property> properties;
    if (!findProperties(device, query, *pool, {structures, count}, known, properties))
        return;
    // Where micromaps are the driver's, shaders correct answers about micromaps only.
    if ((device.driver.emulated() || std::ranges::any_of(properties, &Backend::Property::micromap)) &&
        InjectedWork::rejectedIn(device.commands, commandBuffer, kWriteProperties))
        return;
    // The driver's answers are copied to the pool's memory, and corrected there.
    Backend &backend = *device.structures.backend;
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    for (uint32_t begin = 0; begin < count;) {
        uint32_t end = begin;
        std::vector<VkAccelerationStructureKHR> handles;
        for (; end < count && !properties[end].micromap; ++end)
            handles.push_back(backend.driverHandle(*known[end]));
        if (end > begin) {
            device.driver.next.CmdWriteAccelerationStructuresPropertiesKHR(commandBuffer, end - begin, handles.data(),
                                                                           type, queryPool, first + begin);
            device.driver.next.CmdCopyQueryPoolResults(commandBuffer, queryPool, first + begin, end - begin,
                                                       pool->memory.buffer(), pool->valueInBuffer(first + begin), 8,
                                                       VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT);
        }
        if (end < count)
            backend.recordMicromapAnswer(commandBuffer, properties[end]);
        begin = end + 1;
    }
    work.barrier();
    backend.recordCorrections(commandBuffer, work, properties);
    makeAvailable(work, device, commandBuffer, *pool, first, count);
}

VkResult writeAccelerationStructuresProperties(DeviceQueryPools &device, VkDevice handle, uint32_t count,
                                               const VkAccelerationStructureKHR *structures, VkQueryType type,
                                               size_t bytes, void *data, size_t stride)
{
    // The host does not know what a structure with emulated micromaps holds.
    bool possible = device.driver.translated();
    for (uint32_t i = 0; possible && i < count; ++i) {
        const auto structure = device.objects.accelerationStructures.get(structures[i]);
        possible = structure && !holdsMicromap(device.driver, *structure).value_or(true);
    }
    if (possible)
        return device.driver.next.WriteAccelerationStructuresPropertiesKHR(handle, count, structures, type, bytes, data,
                                                                           stride);
    device.driver.report().notAvailable(device.driver.translated()
                                            ? "vkWriteAccelerationStructuresPropertiesKHR of a micromap"
                                            : "vkWriteAccelerationStructuresPropertiesKHR");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

} // namespace vellum::layer
