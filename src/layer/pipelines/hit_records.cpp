#include "layer/pipelines/hit_records.h"

#include <algorithm>
#include <memory>

#include "layer/pipelines/device_pipelines.h"

namespace vellum::layer
{
namespace
{

// Room for the hit records of an indirect command, which only the GPU knows the number of.
constexpr uint32_t kIndirectRoom = 16 * 1024 * 1024;
constexpr uint32_t kIndirectThreads = 4096;
constexpr VkDeviceSize kCommandRoom = 256;
static_assert(sizeof(VkTraceRaysIndirectCommand2KHR) <= kCommandRoom);

// The pipeline that a trace in this command buffer uses, if null records have to be replaced for it.
std::shared_ptr<RayTracingPipeline> pipelineOf(const DevicePipelines &device, const CommandState *state)
{
    // Where conditional rendering cannot be suspended, the copy might not be made.
    if (!state || state->inheritsConditionalRendering)
        return nullptr;
    auto pipeline = device.rayTracingPipelines.get(state->rayTracingPipeline);
    return pipeline && pipeline->hasNullGroup ? pipeline : nullptr;
}

HitRecordsPush pushOf(const RayTracingPipeline &pipeline)
{
    HitRecordsPush push{};
    std::copy(pipeline.nullHandle.begin(), pipeline.nullHandle.end(), push.handle);
    return push;
}

VkDeviceAddress allocate(const DevicePipelines &device, CommandState &state, VkDeviceSize bytes)
{
    state.scratch.restart();
    const VkDeviceAddress address = state.scratch.allocate(bytes);
    if (!address)
        device.driver.report().error("VELLUM-out-of-memory",
                                     "no memory for hit records: null ones do not see opacity micromaps");
    return address;
}

bool run(DevicePipelines &device, VkCommandBuffer commandBuffer, const HitRecordsPush &push, uint64_t threads)
{
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    const bool copied = work.dispatch(InjectedShader::HitRecords, push, threads, 64);
    work.barrier();
    return copied;
}

VkStridedDeviceAddressRegionKHR withoutNull(DevicePipelines &device, VkCommandBuffer commandBuffer,
                                            const VkStridedDeviceAddressRegionKHR &hit)
{
    CommandState *const state = device.commands.states.get(commandBuffer);
    const auto pipeline = pipelineOf(device, state);
    if (!pipeline || hit.deviceAddress == 0 || hit.size < kGroupHandleBytes || hit.size > UINT32_MAX)
        return hit;
    HitRecordsPush push = pushOf(*pipeline);
    push.source = hit.deviceAddress;
    push.target = allocate(device, *state, hit.size);
    push.size = static_cast<uint32_t>(hit.size);
    push.stride = static_cast<uint32_t>(std::min(hit.stride, hit.size));
    const uint64_t records = push.stride == 0 ? 1 : (uint64_t{push.size} + push.stride - 1) / push.stride;
    if (!push.target || !run(device, commandBuffer, push, records))
        return hit;
    return {push.target, hit.stride, hit.size};
}

} // namespace

void cmdTraceRays(DevicePipelines &device, VkCommandBuffer commandBuffer, const VkStridedDeviceAddressRegionKHR *raygen,
                  const VkStridedDeviceAddressRegionKHR *miss, const VkStridedDeviceAddressRegionKHR *hit,
                  const VkStridedDeviceAddressRegionKHR *callable, uint32_t width, uint32_t height, uint32_t depth)
{
    const VkStridedDeviceAddressRegionKHR own = withoutNull(device, commandBuffer, *hit);
    device.driver.next.CmdTraceRaysKHR(commandBuffer, raygen, miss, &own, callable, width, height, depth);
}

void cmdTraceRaysIndirect(DevicePipelines &device, VkCommandBuffer commandBuffer,
                          const VkStridedDeviceAddressRegionKHR *raygen, const VkStridedDeviceAddressRegionKHR *miss,
                          const VkStridedDeviceAddressRegionKHR *hit, const VkStridedDeviceAddressRegionKHR *callable,
                          VkDeviceAddress command)
{
    const VkStridedDeviceAddressRegionKHR own = withoutNull(device, commandBuffer, *hit);
    device.driver.next.CmdTraceRaysIndirectKHR(commandBuffer, raygen, miss, &own, callable, command);
}

void cmdTraceRaysIndirect2(DevicePipelines &device, VkCommandBuffer commandBuffer, VkDeviceAddress command)
{
    CommandState *const state = device.commands.states.get(commandBuffer);
    if (const auto pipeline = pipelineOf(device, state)) {
        HitRecordsPush push = pushOf(*pipeline);
        push.command = command;
        push.commandCopy = allocate(device, *state, kCommandRoom + kIndirectRoom);
        push.target = push.commandCopy + kCommandRoom;
        push.size = kIndirectRoom;
        if (push.commandCopy && run(device, commandBuffer, push, kIndirectThreads))
            command = push.commandCopy;
    }
    device.driver.next.CmdTraceRaysIndirect2KHR(commandBuffer, command);
}

} // namespace vellum::layer
