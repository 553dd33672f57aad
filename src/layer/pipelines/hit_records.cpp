#include "layer/pipelines/hit_records.h"

#include <algorithm>
#include <memory>

#include "layer/door/device.h"

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
std::shared_ptr<RayTracingPipeline> pipelineOf(const Device &device, const CommandState *state)
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

VkDeviceAddress allocate(const Device &device, CommandState &state, VkDeviceSize bytes)
{
    state.scratch.restart();
    const VkDeviceAddress address = state.scratch.allocate(device.gpu, bytes);
    if (!address)
        device.report().error("VELLUM-out-of-memory",
                              "no memory for hit records: null ones do not see opacity micromaps");
    return address;
}

bool run(Device &device, VkCommandBuffer commandBuffer, const HitRecordsPush &push, uint64_t threads)
{
    InjectedWork work(device, commandBuffer);
    work.barrier();
    const bool copied = work.dispatch(InjectedShader::HitRecords, push, threads, 64);
    work.barrier();
    return copied;
}

VkStridedDeviceAddressRegionKHR withoutNull(Device &device, VkCommandBuffer commandBuffer,
                                            const VkStridedDeviceAddressRegionKHR &hit)
{
    const auto state = commandState(commandBuffer);
    const auto pipeline = pipelineOf(device, state.get());
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

VKAPI_ATTR void VKAPI_CALL cmdTraceRays(VkCommandBuffer commandBuffer, const VkStridedDeviceAddressRegionKHR *raygen,
                                        const VkStridedDeviceAddressRegionKHR *miss,
                                        const VkStridedDeviceAddressRegionKHR *hit,
                                        const VkStridedDeviceAddressRegionKHR *callable, uint32_t width,
                                        uint32_t height, uint32_t depth)
{
    Device &device = deviceOf(commandBuffer);
    const VkStridedDeviceAddressRegionKHR own = withoutNull(device, commandBuffer, *hit);
    device.next.CmdTraceRaysKHR(commandBuffer, raygen, miss, &own, callable, width, height, depth);
}

VKAPI_ATTR void VKAPI_CALL cmdTraceRaysIndirect(VkCommandBuffer commandBuffer,
                                                const VkStridedDeviceAddressRegionKHR *raygen,
                                                const VkStridedDeviceAddressRegionKHR *miss,
                                                const VkStridedDeviceAddressRegionKHR *hit,
                                                const VkStridedDeviceAddressRegionKHR *callable,
                                                VkDeviceAddress command)
{
    Device &device = deviceOf(commandBuffer);
    const VkStridedDeviceAddressRegionKHR own = withoutNull(device, commandBuffer, *hit);
    device.next.CmdTraceRaysIndirectKHR(commandBuffer, raygen, miss, &own, callable, command);
}

VKAPI_ATTR void VKAPI_CALL cmdTraceRaysIndirect2(VkCommandBuffer commandBuffer, VkDeviceAddress command)
{
    Device &device = deviceOf(commandBuffer);
    const auto state = commandState(commandBuffer);
    if (const auto pipeline = pipelineOf(device, state.get())) {
        HitRecordsPush push = pushOf(*pipeline);
        push.command = command;
        push.commandCopy = allocate(device, *state, kCommandRoom + kIndirectRoom);
        push.target = push.commandCopy + kCommandRoom;
        push.size = kIndirectRoom;
        if (push.commandCopy && run(device, commandBuffer, push, kIndirectThreads))
            command = push.commandCopy;
    }
    device.next.CmdTraceRaysIndirect2KHR(commandBuffer, command);
}

} // namespace vellum::layer
