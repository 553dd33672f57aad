// SPDX-License-Identifier: Apache-2.0
// Faults in how commands are executed: hit tables, queues, and indirect builds.
#include "faulty_driver/faults.h"

#include <array>
#include <map>
#include <memory>
#include <set>

namespace faults
{
namespace
{

constexpr Level kLevel = Level::Commands;

// --- "null-record-skips-any-hit": groups without any-hit shader take the place of those with one ---

constexpr uint32_t kHandleSize = 32; // shaderGroupHandleSize
using GroupHandle = std::array<uint8_t, kHandleSize>;
using Twins = std::map<GroupHandle, GroupHandle>; // without any-hit shader

std::mutex mutex;
std::map<VkPipeline, std::shared_ptr<const Twins>> twinsOf;
std::map<VkCommandBuffer, std::shared_ptr<const Twins>> bound;

std::vector<GroupHandle> handlesOf(VkDevice handle, VkPipeline pipeline, uint32_t count)
{
    std::vector<GroupHandle> handles(count);
    if (count == 0)
        return handles;
    DRIVER_NEXT(vkGetRayTracingShaderGroupHandlesKHR)
    (handle, pipeline, 0, count, handles.size() * kHandleSize, handles.data());
    return handles;
}

// Creates one pipeline with further groups.
VkResult createWithTwins(VkDevice handle, VkPipelineCache cache, VkRayTracingPipelineCreateInfoKHR info,
                         const VkAllocationCallbacks *allocator, VkPipeline *pipeline)
{
    std::vector<VkRayTracingShaderGroupCreateInfoKHR> groups(info.pGroups, info.pGroups + info.groupCount);
    std::vector<uint32_t> originals;
    // Groups of a library are counted by those who link it.
    for (uint32_t g = 0; g < info.groupCount && info.pLibraryInterface == nullptr; ++g) {
        if (groups[g].anyHitShader == VK_SHADER_UNUSED_KHR)
            continue;
        auto &twin = groups.emplace_back(groups[g]);
        twin.anyHitShader = VK_SHADER_UNUSED_KHR;
        originals.push_back(g);
    }
    info.groupCount = static_cast<uint32_t>(groups.size());
    info.pGroups = groups.data();
    const VkResult result =
        DRIVER_NEXT(vkCreateRayTracingPipelinesKHR)(handle, VK_NULL_HANDLE, cache, 1, &info, allocator, pipeline);
    if (result == VK_SUCCESS) {
        const auto all = handlesOf(handle, *pipeline, originals.empty() ? 0 : info.groupCount);
        auto twins = std::make_shared<Twins>();
        for (size_t i = 0; i < originals.size(); ++i)
            twins->emplace(all[originals[i]], all[all.size() - originals.size() + i]);
        std::lock_guard lock(mutex);
        twinsOf[*pipeline] = std::move(twins); // also in place of a destroyed pipeline's
    }
    return result;
}

// --- "library-stages-unused" ---

VkResult createWithoutLibraryStages(VkDevice handle, VkPipelineCache cache,
                                    std::span<const VkRayTracingPipelineCreateInfoKHR> infos,
                                    const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    std::vector<VkRayTracingPipelineCreateInfoKHR> own(infos.begin(), infos.end());
    std::vector<std::vector<VkRayTracingShaderGroupCreateInfoKHR>> groups;
    for (VkRayTracingPipelineCreateInfoKHR &info : own) {
        auto &changed = groups.emplace_back(info.pGroups, info.pGroups + info.groupCount);
        for (VkRayTracingShaderGroupCreateInfoKHR &group : changed)
            for (uint32_t *const stage : {&group.closestHitShader, &group.anyHitShader})
                if (*stage >= info.stageCount)
                    *stage = VK_SHADER_UNUSED_KHR;
        info.pGroups = changed.data();
    }
    return DRIVER_NEXT(vkCreateRayTracingPipelinesKHR)(handle, VK_NULL_HANDLE, cache, static_cast<uint32_t>(own.size()),
                                                       own.data(), allocator, pipelines);
}

VKAPI_ATTR VkResult VKAPI_CALL createPipelines(VkDevice handle, VkDeferredOperationKHR operation, VkPipelineCache cache,
                                               uint32_t count, const VkRayTracingPipelineCreateInfoKHR *infos,
                                               const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    if (operation == VK_NULL_HANDLE && has(keyOf(handle), "library-stages-unused"))
        return createWithoutLibraryStages(handle, cache, std::span(infos, count), allocator, pipelines);
    if (operation != VK_NULL_HANDLE || !has(keyOf(handle), "null-record-skips-any-hit"))
        return DRIVER_NEXT(vkCreateRayTracingPipelinesKHR)(handle, operation, cache, count, infos, allocator,
                                                           pipelines);
    std::fill_n(pipelines, count, VkPipeline{VK_NULL_HANDLE});
    VkResult result = VK_SUCCESS;
    for (uint32_t i = 0; i < count; ++i) {
        const VkResult one = createWithTwins(handle, cache, infos[i], allocator, &pipelines[i]);
        result = one != VK_SUCCESS ? one : result;
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL bindPipeline(VkCommandBuffer handle, VkPipelineBindPoint point, VkPipeline pipeline)
{
    if (point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR) {
        std::lock_guard lock(mutex);
        const auto twins = twinsOf.find(pipeline);
        bound[handle] = twins == twinsOf.end() ? nullptr : twins->second;
    }
    DRIVER_NEXT(vkCmdBindPipeline)(handle, point, pipeline);
}

// A copy of a table whose groups lose their any-hit shaders if one of its records is null.
VkStridedDeviceAddressRegionKHR withoutAnyHit(VkCommandBuffer handle, VkStridedDeviceAddressRegionKHR table,
                                              std::shared_ptr<const Twins> twins)
{
    if (twins == nullptr || twins->empty() || table.deviceAddress == 0 || table.stride < kHandleSize)
        return table;
    const Memory memory = memoryFor(handle, table.size);
    beforeExecution(handle, [table, memory, twins = std::move(twins)] {
        std::memcpy(memory.bytes, hostPointer<const void>(table.deviceAddress), table.size);
        bool anyNull = false;
        std::vector<std::pair<uint8_t *, const GroupHandle *>> changes;
        for (VkDeviceSize at = 0; at + kHandleSize <= table.size; at += table.stride) {
            GroupHandle group;
            std::memcpy(group.data(), memory.bytes + at, kHandleSize);
            anyNull = anyNull || group == GroupHandle{};
            if (const auto twin = twins->find(group); twin != twins->end())
                changes.emplace_back(memory.bytes + at, &twin->second);
        }
        for (const auto &[record, group] : changes) {
            if (anyNull)
                std::memcpy(record, group->data(), kHandleSize);
        }
    });
    table.deviceAddress = memory.address;
    return table;
}

// --- "hit-stride-of-misses", "record-data-lost", "first-hit-table-stays" ---

std::map<VkCommandBuffer, VkStridedDeviceAddressRegionKHR> firstTable; // of each command buffer

VkStridedDeviceAddressRegionKHR changedTable(VkCommandBuffer handle, const VkStridedDeviceAddressRegionKHR &miss,
                                             VkStridedDeviceAddressRegionKHR table)
{
    if (has(keyOf(handle), "hit-stride-of-misses"))
        table.stride = miss.stride;
    if (has(keyOf(handle), "first-hit-table-stays")) {
        std::lock_guard lock(mutex);
        table = firstTable.try_emplace(handle, table).first->second;
    }
    if (has(keyOf(handle), "record-data-lost") && table.deviceAddress != 0 && table.stride >= kHandleSize) {
        const Memory memory = memoryFor(handle, table.size);
        beforeExecution(handle, [table, memory] {
            for (VkDeviceSize at = 0; at + kHandleSize <= table.size; at += table.stride)
                std::memcpy(memory.bytes + at, hostPointer<const uint8_t>(table.deviceAddress) + at, kHandleSize);
        });
        table.deviceAddress = memory.address;
    }
    return table;
}

VKAPI_ATTR void VKAPI_CALL traceRays(VkCommandBuffer handle, const VkStridedDeviceAddressRegionKHR *raygen,
                                     const VkStridedDeviceAddressRegionKHR *miss,
                                     const VkStridedDeviceAddressRegionKHR *hit,
                                     const VkStridedDeviceAddressRegionKHR *callable, uint32_t width, uint32_t height,
                                     uint32_t depth)
{
    std::shared_ptr<const Twins> twins;
    {
        std::lock_guard lock(mutex);
        twins = bound[handle];
    }
    const VkStridedDeviceAddressRegionKHR table =
        changedTable(handle, *miss, withoutAnyHit(handle, *hit, std::move(twins)));
    DRIVER_NEXT(vkCmdTraceRaysKHR)(handle, raygen, miss, &table, callable, width, height, depth);
}

// --- "second-queue-loses-micromaps" ---

std::map<void *, VkQueue> firstQueue; // by dispatch key
std::set<VkCommandBuffer> buildsMicromaps;

bool isLost(VkQueue handle, VkCommandBuffer commands)
{
    std::lock_guard lock(mutex);
    return firstQueue[keyOf(handle)] != handle && buildsMicromaps.contains(commands);
}

VKAPI_ATTR void VKAPI_CALL getQueue(VkDevice handle, uint32_t family, uint32_t index, VkQueue *queue)
{
    DRIVER_NEXT(vkGetDeviceQueue)(handle, family, index, queue);
    std::lock_guard lock(mutex);
    if (index == 0)
        firstQueue.try_emplace(keyOf(handle), *queue);
}

VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice handle, const VkAllocationCallbacks *allocator)
{
    if (handle != VK_NULL_HANDLE) {
        std::lock_guard lock(mutex);
        firstQueue.erase(keyOf(handle));
    }
    DRIVER_NEXT(vkDestroyDevice)(handle, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue handle, uint32_t count, const VkSubmitInfo *infos, VkFence fence)
{
    const auto next = DRIVER_NEXT(vkQueueSubmit);
    if (!has(keyOf(handle), "second-queue-loses-micromaps"))
        return next(handle, count, infos, fence);
    std::vector<VkSubmitInfo> all(infos, infos + count);
    std::vector<std::vector<VkCommandBuffer>> kept(count);
    for (uint32_t i = 0; i < count; ++i) {
        for (const VkCommandBuffer commands : std::span(infos[i].pCommandBuffers, infos[i].commandBufferCount)) {
            if (!isLost(handle, commands))
                kept[i].push_back(commands);
        }
        all[i].commandBufferCount = static_cast<uint32_t>(kept[i].size());
        all[i].pCommandBuffers = kept[i].data();
    }
    return next(handle, count, all.data(), fence);
}

VKAPI_ATTR VkResult VKAPI_CALL submit2(VkQueue handle, uint32_t count, const VkSubmitInfo2 *infos, VkFence fence)
{
    const auto next = DRIVER_NEXT(vkQueueSubmit2);
    if (!has(keyOf(handle), "second-queue-loses-micromaps"))
        return next(handle, count, infos, fence);
    std::vector<VkSubmitInfo2> all(infos, infos + count);
    std::vector<std::vector<VkCommandBufferSubmitInfo>> kept(count);
    for (uint32_t i = 0; i < count; ++i) {
        for (const auto &commands : std::span(infos[i].pCommandBufferInfos, infos[i].commandBufferInfoCount)) {
            if (!isLost(handle, commands.commandBuffer))
                kept[i].push_back(commands);
        }
        all[i].commandBufferInfoCount = static_cast<uint32_t>(kept[i].size());
        all[i].pCommandBufferInfos = kept[i].data();
    }
    return next(handle, count, all.data(), fence);
}

VKAPI_ATTR VkResult VKAPI_CALL begin(VkCommandBuffer handle, const VkCommandBufferBeginInfo *info)
{
    {
        std::lock_guard lock(mutex);
        buildsMicromaps.erase(handle);
        bound.erase(handle);
        firstTable.erase(handle);
    }
    return DRIVER_NEXT(vkBeginCommandBuffer)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL cmdBuildMicromaps(VkCommandBuffer handle, uint32_t count,
                                             const VkMicromapBuildInfoEXT *infos)
{
    {
        std::lock_guard lock(mutex);
        buildsMicromaps.insert(handle);
    }
    DRIVER_NEXT(vkCmdBuildMicromapsEXT)(handle, count, infos);
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count, const BuildInfo *infos,
                                    const RangeInfo *const *ranges)
{
    for (const BuildInfo &info : std::span(infos, count)) {
        std::lock_guard lock(mutex);
        if (info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
            buildsMicromaps.insert(handle);
    }
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, infos, ranges);
}

// --- "indirect-build-with-host-counts" ---

VKAPI_ATTR void VKAPI_CALL cmdBuildIndirect(VkCommandBuffer handle, uint32_t count, const BuildInfo *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    const auto next = DRIVER_NEXT(vkCmdBuildAccelerationStructuresIndirectKHR);
    if (!has(keyOf(handle), "indirect-build-with-host-counts"))
        return next(handle, count, infos, addresses, strides, most);
    // Copies of the ranges, with the counts of the host.
    std::vector<VkDeviceAddress> copies;
    for (uint32_t i = 0; i < count; ++i) {
        const Memory memory = memoryFor(handle, uint64_t{infos[i].geometryCount} * strides[i] + sizeof(RangeInfo));
        const std::vector<uint32_t> counts(most[i], most[i] + infos[i].geometryCount);
        // Copied now, because the mock driver's quirk "capable" reads the ranges when the build is recorded, and again
        // at execution.
        const auto copy = [memory, counts, source = addresses[i], stride = strides[i]] {
            for (size_t g = 0; g < counts.size(); ++g) {
                RangeInfo range;
                std::memcpy(&range, hostPointer<const void>(source + g * stride), sizeof range);
                range.primitiveCount = counts[g];
                std::memcpy(memory.bytes + g * stride, &range, sizeof range);
            }
        };
        copy();
        beforeExecution(handle, copy);
        copies.push_back(memory.address);
    }
    next(handle, count, infos, copies.data(), strides, most);
}

} // namespace

LevelRows commandRows()
{
    static const Row device[]{
        {"vkCreateRayTracingPipelinesKHR", DRIVER_FUNCTION(createPipelines)},
        {"vkCmdBindPipeline", DRIVER_FUNCTION(bindPipeline)},
        {"vkCmdTraceRaysKHR", DRIVER_FUNCTION(traceRays)},
        {"vkGetDeviceQueue", DRIVER_FUNCTION(getQueue)},
        {"vkDestroyDevice", DRIVER_FUNCTION(destroyDevice)},
        {"vkQueueSubmit", DRIVER_FUNCTION(submit)},
        {"vkQueueSubmit2", DRIVER_FUNCTION(submit2)},
        {"vkBeginCommandBuffer", DRIVER_FUNCTION(begin)},
        {"vkCmdBuildMicromapsEXT", DRIVER_FUNCTION(cmdBuildMicromaps)},
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuild)},
        {"vkCmdBuildAccelerationStructuresIndirectKHR", DRIVER_FUNCTION(cmdBuildIndirect)},
    };
    return {device, {}};
}

} // namespace faults
