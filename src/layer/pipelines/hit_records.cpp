// SPDX-License-Identifier: Apache-2.0
// vkCmdTraceRays*: hits through a null hit record, or beyond the end of the hit table, still look up micromaps.
// Pipelines that use micromaps trace with a copy of the table in which a hit record of the layer replaces these.
#include <algorithm>
#include <memory>

#include "layer/base/commands.h"
#include "layer/pipelines/device_pipelines.h"

namespace vellum::layer
{
namespace
{

using Region = VkStridedDeviceAddressRegionKHR;

// Capacity for the hit records of an indirect command, whose number only the GPU knows.
constexpr uint32_t kIndirectCapacity = 16 * 1024 * 1024;
constexpr uint32_t kIndirectThreads = 4096;
// The driver copies larger tables. A smaller one is copied faster by the shader, with a barrier less.
constexpr VkDeviceSize kLeastTransfer = 16 * 1024;
// After so many bytes of a driver on a CPU, the shader looks for null records in them, while a cache holds them.
constexpr VkDeviceSize kPiece = 1024 * 1024;
constexpr VkDeviceSize kCommandBytes = 256;
static_assert(sizeof(VkTraceRaysIndirectCommand2KHR) <= kCommandBytes);

// Minimum and maximum size of the layer's records behind a table's own. There is a minimum because builds that are not
// complete may have larger record offsets than the known ones.
constexpr VkDeviceSize kLeastPadding = 16 * 1024;
constexpr VkDeviceSize kMostPadding = 16 * 1024 * 1024;
constexpr uint32_t kMostRayOffset = 15; // SBT offset of OpTraceRayKHR, which has four bits

// The bound ray tracing pipeline, if null records have to be replaced for it.
std::shared_ptr<RayTracingPipeline> pipelineOf(const DevicePipelines &device, const CommandState *state)
{
    auto pipeline = state ? device.rayTracingPipelines.get(state->rayTracingPipeline) : nullptr;
    return pipeline && pipeline->hasNullGroup ? pipeline : nullptr;
}

shared::HitRecordsPush pushOf(const DevicePipelines &device, const RayTracingPipeline &pipeline)
{
    shared::HitRecordsPush push{};
    push.standIn = pipeline.standIn.address();
    push.recordOffset = device.objects.root.greatestRecordOffsetAddress();
    push.reach = kMostRayOffset + pipeline.mostStride * (device.objects.mostGeometries - 1);
    push.oneForAll = !pipeline.hasBoxes;
    return push;
}

void reportNoMemory(const DevicePipelines &device)
{
    device.driver.report().error("VELLUM-out-of-memory",
                                 "no memory for hit records: hits through null ones ignore opacity micromaps");
}

// The number of a table's records that hold a whole handle.
uint64_t recordsOf(const Region &table)
{
    if (table.deviceAddress == 0 || table.size < kGroupHandleBytes)
        return 0;
    return table.stride == 0 ? 1 : 1 + (table.size - kGroupHandleBytes) / table.stride;
}

// Runs the shader between barriers.
bool run(InjectedWork &work, const shared::HitRecordsPush &push, uint64_t threads)
{
    work.barrier();
    const bool copied = work.dispatch(InjectedShader::HitRecords, push, threads, 64);
    work.barrier();
    return copied;
}

// Writes the copy of a table: its records and up to `reached` ones, with the layer's record in place of null ones.
bool write(DevicePipelines &device, VkCommandBuffer commandBuffer, const CommandState &state, const Region &table,
           const HitTableCopies::Copy &copy, uint64_t reached, shared::HitRecordsPush push)
{
    push.source = table.deviceAddress;
    push.target = copy.address;
    push.size = static_cast<uint32_t>(table.size);
    push.stride = static_cast<uint32_t>(table.stride);
    push.capacity = static_cast<uint32_t>(copy.bytes);
    const uint64_t records =
        std::max(recordsOf(table), std::min(reached, recordsOf({copy.address, table.stride, copy.bytes})));
    InjectedWork work(device.commands, commandBuffer);
    // Another execution of a command buffer with SIMULTANEOUS_USE may trace with the copy meanwhile. The shader writes
    // each word once, the driver also null records.
    const bool transfers = table.size >= kLeastTransfer && state.hitTables.isShared();
    const AddressMap::Location source =
        transfers ? device.buffers.addresses.covering(table.deviceAddress, table.size, VK_BUFFER_USAGE_TRANSFER_SRC_BIT)
                  : AddressMap::Location{};
    if (!source.buffer)
        return run(work, push, std::max(table.size, records * table.stride) / (shared::kHitUnitsOfThread * 16) + 1);
    device.commands.states.keep(commandBuffer, source.owner);
    push.copied = 1;
    const VkDeviceSize piece = device.driver.threads == 0 ? table.size : kPiece;
    const uint64_t recordsOfPiece = table.stride == 0 ? 1 : piece / table.stride + 1;
    bool written = true;
    work.barrier();
    for (VkDeviceSize begin = 0; begin < table.size; begin = push.size) {
        const VkDeviceSize left = table.size - begin;
        const VkDeviceSize bytes = table.stride == 0 ? left : std::min(left, recordsOfPiece * table.stride);
        const bool isLast = bytes == left;
        const VkBufferCopy region{source.offset + begin, copy.offset + begin, bytes};
        device.driver.next.CmdCopyBuffer(commandBuffer, source.buffer, copy.buffer, 1, &region);
        push.size = static_cast<uint32_t>(begin + bytes);
        push.capacity = isLast ? static_cast<uint32_t>(copy.bytes) : push.size;
        work.barrier();
        const uint64_t looked = isLast ? records - push.first : recordsOfPiece;
        written =
            work.dispatch(InjectedShader::HitRecords, push, looked / shared::kHitRecordsOfThread + 1, 64) && written;
        push.first += static_cast<uint32_t>(recordsOfPiece);
    }
    work.barrier();
    return written;
}

// The hit table that the driver gets. The layer's any-hit shader runs for every triangle that a ray meets, and the
// driver reads a record for it, even if the application's ray would not need one.
Region driverTable(DevicePipelines &device, VkCommandBuffer commandBuffer, const Region &application)
{
    CommandState *const state = device.commands.states.get(commandBuffer);
    const auto pipeline = pipelineOf(device, state);
    if (!pipeline)
        return application;
    Region table = application;
    table.size = std::min(application.size, device.buffers.addresses.bytesFrom(application.deviceAddress));
    const uint64_t records = recordsOf(table);
    if (records == 0)
        return {pipeline->standIn.address(), 0, kGroupHandleBytes};
    // Hits with another index have no record, so that no shader of the application runs for them.
    if (records == 1 && !pipeline->hasBoxes)
        table.stride = 0;
    const bool overlap = table.stride > 0 && table.stride < kGroupHandleBytes;
    // If conditional rendering is inherited, it cannot be suspended and may discard the copy.
    if (state->inheritsConditionalRendering || overlap || table.size > UINT32_MAX - kMostPadding)
        return table;
    VkDeviceSize bytes = table.size;
    uint64_t reached = records;
    shared::HitRecordsPush push = pushOf(device, *pipeline);
    if (table.stride > 0) {
        reached = uint64_t{device.objects.root.greatestRecordOffset()} + push.reach + 1;
        const VkDeviceSize needed = std::max(reached * table.stride, table.size);
        bytes += std::clamp(needed - table.size, kLeastPadding, kMostPadding);
    }
    const HitTableCopies::Copy copy = state->hitTables.get(
        {table.deviceAddress, table.size, table.stride, pipeline->standIn.address(), push.reach}, bytes);
    if (!copy.address) {
        reportNoMemory(device);
        return table;
    }
    const Region region{copy.address, table.stride, copy.bytes};
    if (copy.isCurrent)
        return region;
    if (write(device, commandBuffer, *state, table, copy, reached, push))
        return region;
    state->hitTables.forget();
    return table;
}

} // namespace

void cmdTraceRays(DevicePipelines &device, VkCommandBuffer commandBuffer, const VkStridedDeviceAddressRegionKHR *raygen,
                  const VkStridedDeviceAddressRegionKHR *miss, const VkStridedDeviceAddressRegionKHR *hit,
                  const VkStridedDeviceAddressRegionKHR *callable, uint32_t width, uint32_t height, uint32_t depth)
{
    const Region own = driverTable(device, commandBuffer, *hit);
    device.driver.next.CmdTraceRaysKHR(commandBuffer, raygen, miss, &own, callable, width, height, depth);
}

void cmdTraceRaysIndirect(DevicePipelines &device, VkCommandBuffer commandBuffer,
                          const VkStridedDeviceAddressRegionKHR *raygen, const VkStridedDeviceAddressRegionKHR *miss,
                          const VkStridedDeviceAddressRegionKHR *hit, const VkStridedDeviceAddressRegionKHR *callable,
                          VkDeviceAddress command)
{
    const Region own = driverTable(device, commandBuffer, *hit);
    device.driver.next.CmdTraceRaysIndirectKHR(commandBuffer, raygen, miss, &own, callable, command);
}

void cmdTraceRaysIndirect2(DevicePipelines &device, VkCommandBuffer commandBuffer, VkDeviceAddress command)
{
    CommandState *const state = device.commands.states.get(commandBuffer);
    const auto pipeline = pipelineOf(device, state);
    if (pipeline && !state->inheritsConditionalRendering) {
        shared::HitRecordsPush push = pushOf(device, *pipeline);
        push.command = command;
        state->scratch.restart();
        push.commandCopy = state->scratch.allocate(kCommandBytes + kIndirectCapacity);
        push.target = push.commandCopy + kCommandBytes;
        push.capacity = kIndirectCapacity;
        if (!push.commandCopy)
            reportNoMemory(device);
        InjectedWork work(device.commands, commandBuffer);
        if (push.commandCopy && run(work, push, kIndirectThreads))
            command = push.commandCopy;
    }
    device.driver.next.CmdTraceRaysIndirect2KHR(commandBuffer, command);
}

} // namespace vellum::layer
