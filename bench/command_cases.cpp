// SPDX-License-Identifier: Apache-2.0
#include "command_cases.h"

#include "shaders/command_bench_compute.h"
#include "shaders/command_bench_queries.h"

namespace vellum::bench
{
namespace
{

using Side = const CommandSide &;
using Commands = VkCommandBuffer;
using Count = uint32_t;

template <typename Call>
auto times(Call call)
{
    return [call](Side side, Commands commands, Count count) {
        for (Count i = 0; i < count; ++i)
            call(side, commands, i);
    };
}

VkDependencyInfo dependency(const std::vector<VkMemoryBarrier2> &memory,
                            const std::vector<VkBufferMemoryBarrier2> &buffers)
{
    return vkInit<VkDependencyInfo>({.memoryBarrierCount = static_cast<uint32_t>(memory.size()),
                                     .pMemoryBarriers = memory.data(),
                                     .bufferMemoryBarrierCount = static_cast<uint32_t>(buffers.size()),
                                     .pBufferMemoryBarriers = buffers.data()});
}

VkMemoryBarrier2 memoryBarrier()
{
    return {VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,     nullptr,
            VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, VK_ACCESS_2_SHADER_WRITE_BIT,
            VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, VK_ACCESS_2_SHADER_READ_BIT};
}

VkBufferMemoryBarrier2 bufferBarrier(Side side)
{
    return {VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER_2,
            nullptr,
            VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
            VK_ACCESS_2_SHADER_WRITE_BIT,
            VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
            VK_ACCESS_2_SHADER_READ_BIT,
            VK_QUEUE_FAMILY_IGNORED,
            VK_QUEUE_FAMILY_IGNORED,
            side.buffer.buffer,
            0,
            VK_WHOLE_SIZE};
}

void barriers(Side side, Commands commands, Count count, size_t memory, size_t buffers)
{
    const std::vector<VkMemoryBarrier2> m(memory, memoryBarrier());
    const std::vector<VkBufferMemoryBarrier2> b(buffers, bufferBarrier(side));
    const VkDependencyInfo info = dependency(m, b);
    for (Count i = 0; i < count; ++i)
        side.vk.CmdPipelineBarrier2(commands, &info);
}

void addBindings(std::vector<CommandCase> &cases)
{
    cases.push_back({"vkCmdBindPipeline, compute", times([](Side side, Commands commands, Count) {
                         side.vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, side.compute);
                     })});
    cases.push_back({"vkCmdBindPipeline, graphics", times([](Side side, Commands commands, Count) {
                         side.vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, side.graphics);
                     })});
    cases.push_back({"vkCmdBindPipeline, ray tracing", times([](Side side, Commands commands, Count) {
                         side.vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, side.rayTracing);
                     })});
    cases.push_back({"vkCmdPushConstants, 128 bytes", times([](Side side, Commands commands, Count i) {
                         const uint32_t values[32] = {i};
                         side.vk.CmdPushConstants(commands, side.layout, VK_SHADER_STAGE_ALL, 0, sizeof values, values);
                     })});
    cases.push_back({"vkCmdPushConstants, 32 places in turns", times([](Side side, Commands commands, Count i) {
                         side.vk.CmdPushConstants(commands, side.layout, VK_SHADER_STAGE_ALL, i % 32 * 4, 4, &i);
                     })});
    cases.push_back({"vkCmdDispatch (passes through)",
                     times([](Side side, Commands commands, Count) { side.vk.CmdDispatch(commands, 1, 1, 1); })});
    cases.push_back({"vkCmdTraceRaysKHR, no micromaps", times([](Side side, Commands commands, Count) {
                         const VkStridedDeviceAddressRegionKHR record{side.buffer.address, 64, 64};
                         const VkStridedDeviceAddressRegionKHR none{};
                         side.vk.CmdTraceRaysKHR(commands, &record, &record, &record, &none, 1, 1, 1);
                     })});
    cases.push_back({"vkCmdSetRayTracingPipelineStackSizeKHR", times([](Side side, Commands commands, Count) {
                         side.vk.CmdSetRayTracingPipelineStackSizeKHR(commands, 1024);
                     })});
    cases.push_back({"vkCmdBegin/EndConditionalRenderingEXT", times([](Side side, Commands commands, Count) {
                         const auto info = vkInit<VkConditionalRenderingBeginInfoEXT>({.buffer = side.buffer.buffer});
                         side.vk.CmdBeginConditionalRenderingEXT(commands, &info);
                         side.vk.CmdEndConditionalRenderingEXT(commands);
                     }),
                     false, [](Side side) { return side.vk.CmdBeginConditionalRenderingEXT != nullptr; }});
}

void addSynchronization(std::vector<CommandCase> &cases)
{
    cases.push_back({"vkCmdPipelineBarrier2, 1 memory",
                     [](Side side, Commands commands, Count count) { barriers(side, commands, count, 1, 0); }});
    cases.push_back({"vkCmdPipelineBarrier2, 2 memory, 30 buffers",
                     [](Side side, Commands commands, Count count) { barriers(side, commands, count, 2, 30); }});
    cases.push_back({"vkCmdSet/ResetEvent2", [](Side side, Commands commands, Count count) {
                         const std::vector<VkMemoryBarrier2> memory(1, memoryBarrier());
                         const VkDependencyInfo info = dependency(memory, {});
                         for (Count i = 0; i < count; ++i) {
                             side.vk.CmdSetEvent2(commands, side.event, &info);
                             side.vk.CmdResetEvent2(commands, side.event, VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT);
                         }
                     }});
    cases.push_back({"vkCmdWaitEvents2, 1 event", [](Side side, Commands commands, Count count) {
                         const std::vector<VkMemoryBarrier2> memory(1, memoryBarrier());
                         const VkDependencyInfo info = dependency(memory, {});
                         for (Count i = 0; i < count; ++i)
                             side.vk.CmdWaitEvents2(commands, 1, &side.event, &info);
                     }});
    cases.push_back({"vkCmdWriteTimestamp2", times([](Side side, Commands commands, Count i) {
                         side.vk.CmdWriteTimestamp2(commands, VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, side.timestamps,
                                                    i % 64);
                     })});
    cases.push_back({"vkCmdResetQueryPool", times([](Side side, Commands commands, Count) {
                         side.vk.CmdResetQueryPool(commands, side.timestamps, 0, 64);
                     })});
    cases.push_back({"vkCmdCopyQueryPoolResults", times([](Side side, Commands commands, Count) {
                         side.vk.CmdCopyQueryPoolResults(commands, side.timestamps, 0, 1, side.buffer.buffer, 0, 8,
                                                         VK_QUERY_RESULT_64_BIT);
                     })});
    cases.push_back({"vkGetFenceStatus",
                     times([](Side side, Commands, Count) { side.vk.GetFenceStatus(side.device, side.fence); })});
    cases.push_back({"vkWaitForFences, signaled", times([](Side side, Commands, Count) {
                         side.vk.WaitForFences(side.device, 1, &side.fence, VK_TRUE, 0);
                     })});
    cases.push_back({"vkQueueSubmit, nothing", times([](Side side, Commands, Count) {
                         side.vk.QueueSubmit(side.queue, 0, nullptr, VK_NULL_HANDLE);
                     })});
    cases.push_back({"vkQueueSubmit2, nothing", times([](Side side, Commands, Count) {
                         side.vk.QueueSubmit2(side.queue, 0, nullptr, VK_NULL_HANDLE);
                     })});
}

void addCommandBuffers(std::vector<CommandCase> &cases)
{
    cases.push_back({"vkCmdExecuteCommands", times([](Side side, Commands commands, Count) {
                         side.vk.CmdExecuteCommands(commands, 1, &side.secondary);
                     })});
    cases.push_back({"vkBegin/EndCommandBuffer", times([](Side side, Commands commands, Count) {
                         side.vk.EndCommandBuffer(commands);
                         side.begin(commands);
                     })});
    cases.push_back({"vkAllocate/FreeCommandBuffers", times([](Side side, Commands, Count) {
                         const Commands made = side.allocate(side.secondaryPool, VK_COMMAND_BUFFER_LEVEL_PRIMARY);
                         side.vk.FreeCommandBuffers(side.device, side.secondaryPool, 1, &made);
                     })});
    cases.push_back({"vkCreate/DestroyCommandPool", times([](Side side, Commands, Count) {
                         side.vk.DestroyCommandPool(side.device, side.makePool(), nullptr);
                     })});
}

void addObjects(std::vector<CommandCase> &cases)
{
    cases.push_back({"vkCreate/DestroyBuffer", times([](Side side, Commands, Count) {
                         auto info = vkInit<VkBufferCreateInfo>(
                             {.size = 1024,
                              .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
                         VkBuffer buffer = VK_NULL_HANDLE;
                         side.vk.CreateBuffer(side.device, &info, nullptr, &buffer);
                         side.vk.DestroyBuffer(side.device, buffer, nullptr);
                     })});
    cases.push_back({"a buffer with memory and address, 9 commands", times([](Side side, Commands, Count) {
                         side.destroy(side.makeBuffer(1024, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                                                                VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT));
                     })});
    cases.push_back({"vkMap/UnmapMemory", times([](Side side, Commands, Count) {
                         void *data = nullptr;
                         side.vk.MapMemory(side.device, side.buffer.memory, 0, VK_WHOLE_SIZE, 0, &data);
                         side.vk.UnmapMemory(side.device, side.buffer.memory);
                     })});
    cases.push_back({"vkGetBufferDeviceAddress", times([](Side side, Commands, Count) {
                         const auto info = vkInit<VkBufferDeviceAddressInfo>({.buffer = side.buffer.buffer});
                         side.vk.GetBufferDeviceAddress(side.device, &info);
                     })});
    cases.push_back({"vkSet/GetPrivateData", times([](Side side, Commands, Count i) {
                         const auto handle = reinterpret_cast<uint64_t>(side.buffer.buffer);
                         uint64_t value = 0;
                         side.vk.SetPrivateData(side.device, VK_OBJECT_TYPE_BUFFER, handle, side.slot, i);
                         side.vk.GetPrivateData(side.device, VK_OBJECT_TYPE_BUFFER, handle, side.slot, &value);
                     })});
    cases.push_back({"vkCreate/DestroyQueryPool", times([](Side side, Commands, Count) {
                         const auto info =
                             vkInit<VkQueryPoolCreateInfo>({.queryType = VK_QUERY_TYPE_OCCLUSION, .queryCount = 8});
                         VkQueryPool pool = VK_NULL_HANDLE;
                         side.vk.CreateQueryPool(side.device, &info, nullptr, &pool);
                         side.vk.DestroyQueryPool(side.device, pool, nullptr);
                     })});
    const auto structureAt = [](VkDeviceSize offset) {
        return times([offset](Side side, Commands, Count) {
            auto info =
                vkInit<VkAccelerationStructureCreateInfoKHR>({.buffer = side.storage.buffer,
                                                              .offset = offset,
                                                              .size = 16384,
                                                              .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
            VkAccelerationStructureKHR made = VK_NULL_HANDLE;
            side.vk.CreateAccelerationStructureKHR(side.device, &info, nullptr, &made);
            side.vk.DestroyAccelerationStructureKHR(side.device, made, nullptr);
        });
    };
    cases.push_back({"vkCreate/DestroyAccelerationStructureKHR", structureAt(32768)});
    cases.push_back({"vkCreate/DestroyAccelerationStructureKHR, where another is", structureAt(0)});
    cases.push_back({"vkGetAccelerationStructureDeviceAddressKHR", times([](Side side, Commands, Count) {
                         const auto info = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>(
                             {.accelerationStructure = side.structure});
                         side.vk.GetAccelerationStructureDeviceAddressKHR(side.device, &info);
                     })});
}

void addBuilds(std::vector<CommandCase> &cases)
{
    cases.push_back({"vkCmdBuildAccelerationStructuresKHR, 1 triangle", times([](Side side, Commands commands, Count) {
                         auto geometry = vkInit<VkAccelerationStructureGeometryKHR>(
                             {.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR});
                         geometry.geometry.triangles = vkInit<VkAccelerationStructureGeometryTrianglesDataKHR>(
                             {.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
                              .vertexData = {.deviceAddress = side.buffer.address},
                              .vertexStride = 12,
                              .maxVertex = 2,
                              .indexType = VK_INDEX_TYPE_NONE_KHR});
                         const auto info = vkInit<VkAccelerationStructureBuildGeometryInfoKHR>(
                             {.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
                              .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
                              .dstAccelerationStructure = side.structure,
                              .geometryCount = 1,
                              .pGeometries = &geometry,
                              .scratchData = {.deviceAddress = side.other.address}});
                         const VkAccelerationStructureBuildRangeInfoKHR range{.primitiveCount = 1};
                         const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
                         side.vk.CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
                     })});
}

// Adds the commands of an engine's frame, about a thousand.
void addFrame(std::vector<CommandCase> &cases)
{
    cases.push_back(
        {"a frame of 1,000 commands", times([](Side side, Commands commands, Count) {
             const uint32_t values[32] = {};
             const std::vector<VkMemoryBarrier2> memory(1, memoryBarrier());
             const std::vector<VkBufferMemoryBarrier2> buffers(4, bufferBarrier(side));
             const VkDependencyInfo info = dependency(memory, buffers);
             side.vk.EndCommandBuffer(commands);
             side.begin(commands);
             for (Count i = 0; i < 111; ++i) {
                 side.vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, side.compute);
                 for (Count d = 0; d < 3; ++d) {
                     side.vk.CmdPushConstants(commands, side.layout, VK_SHADER_STAGE_ALL, 0, sizeof values, values);
                     side.vk.CmdDispatch(commands, 1, 1, 1);
                 }
                 side.vk.CmdWriteTimestamp2(commands, VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, side.timestamps, i % 64);
                 side.vk.CmdPipelineBarrier2(commands, &info);
             }
         }),
         true});
}

// The commands by address with the layer, and by buffer without.
void addAddressCommands(std::vector<CommandCase> &cases)
{
    constexpr VkAddressCommandFlagsKHR kStorage = VK_ADDRESS_COMMAND_STORAGE_BUFFER_USAGE_BIT_KHR; // of the buffers
    cases.push_back({"vkCmdCopyMemoryKHR / vkCmdCopyBuffer", times([](Side side, Commands commands, Count) {
                         if (!side.vk.CmdCopyMemoryKHR) {
                             const VkBufferCopy region{0, 0, 64};
                             return side.vk.CmdCopyBuffer(commands, side.buffer.buffer, side.other.buffer, 1, &region);
                         }
                         const auto region = vkInit<VkDeviceMemoryCopyKHR>({.srcRange = {side.buffer.address, 64},
                                                                            .srcFlags = kStorage,
                                                                            .dstRange = {side.other.address, 64},
                                                                            .dstFlags = kStorage});
                         const auto info = vkInit<VkCopyDeviceMemoryInfoKHR>({.regionCount = 1, .pRegions = &region});
                         side.vk.CmdCopyMemoryKHR(commands, &info);
                     })});
    cases.push_back({"vkCmdDispatchIndirect2KHR / ...Indirect", times([](Side side, Commands commands, Count) {
                         if (!side.vk.CmdDispatchIndirect2KHR)
                             return side.vk.CmdDispatchIndirect(commands, side.buffer.buffer, 0);
                         const auto info = vkInit<VkDispatchIndirect2InfoKHR>(
                             {.addressRange = {side.buffer.address, 12}, .addressFlags = kStorage});
                         side.vk.CmdDispatchIndirect2KHR(commands, &info);
                     })});
    cases.push_back({"vkCmdBindIndexBuffer3KHR / ...Buffer", times([](Side side, Commands commands, Count) {
                         if (!side.vk.CmdBindIndexBuffer3KHR)
                             return side.vk.CmdBindIndexBuffer(commands, side.buffer.buffer, 0, VK_INDEX_TYPE_UINT32);
                         const auto info =
                             vkInit<VkBindIndexBuffer3InfoKHR>({.addressRange = {side.buffer.address, 65536},
                                                                .addressFlags = kStorage,
                                                                .indexType = VK_INDEX_TYPE_UINT32});
                         side.vk.CmdBindIndexBuffer3KHR(commands, &info);
                     })});
}

void addCreations(std::vector<CommandCase> &cases)
{
    const auto addModule = [&](const char *name, const uint32_t *words, size_t bytes) {
        cases.push_back({name, times([words, bytes](Side side, Commands, Count) {
                             side.vk.DestroyShaderModule(side.device, side.makeModule(words, bytes), nullptr);
                         }),
                         true});
    };
    const auto addPipeline = [&](const char *name, VkPipeline (*make)(Side)) {
        cases.push_back({name, times([make](Side side, Commands, Count) {
                             side.vk.DestroyPipeline(side.device, make(side), nullptr);
                         }),
                         true});
    };
    addModule("a module that traces no rays", command_bench_compute, sizeof command_bench_compute);
    addModule("a module with a ray query", command_bench_queries, sizeof command_bench_queries);
    addPipeline("a compute pipeline that traces no rays", [](Side side) { return side.makeCompute(side.plain); });
    addPipeline("a compute pipeline with a ray query", [](Side side) { return side.makeCompute(side.queries); });
    addPipeline("a graphics pipeline", [](Side side) { return side.makeGraphics(); });
    addPipeline("a ray tracing pipeline", [](Side side) { return side.makeRayTracing(false); });
    addPipeline("a ray tracing pipeline with micromaps, against one without",
                [](Side side) { return side.makeRayTracing(side.api.has_value()); });
}

} // namespace

std::vector<CommandCase> commandCases()
{
    std::vector<CommandCase> cases;
    addBindings(cases);
    addSynchronization(cases);
    addCommandBuffers(cases);
    addObjects(cases);
    addBuilds(cases);
    addAddressCommands(cases);
    addFrame(cases);
    addCreations(cases);
    return cases;
}

} // namespace vellum::bench
