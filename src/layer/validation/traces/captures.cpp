// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/traces/captures.h"

#include <algorithm>

#include "core/push.h"
#include "layer/validation/builds.h"
#include "layer/validation/device_validation.h"

namespace vellum::layer
{
namespace
{

constexpr size_t kCountWords = 2; // of a capture, before what was written
constexpr uint32_t kGroupSize = 64;

CapturedInstances captureInstances(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                   const VkAccelerationStructureGeometryInstancesDataKHR &instances,
                                   const VkAccelerationStructureBuildRangeInfoKHR &range)
{
    const uint32_t count = range.primitiveCount;
    const VkDeviceAddress source = instances.data.deviceAddress + range.primitiveOffset;
    const VkDeviceSize bytes = instanceStride(instances);
    if (count > device.buffers.addresses.elementsFrom(source, bytes, bytes))
        return {}; // outside their buffer
    auto memory = Capture::make(device.traces.memory, kCountWords + size_t{count} * 2, kCountWords);
    if (!memory)
        return {};
    if (count != 0) {
        const shared::InstancesContentsPush push{.source = source,
                                                 .target = memory->address(),
                                                 .count = count,
                                                 .pointers = instances.arrayOfPointers ? 1u : 0u};
        InjectedWork work(device.commands, commandBuffer);
        work.barrier();
        work.dispatch(InjectedShader::InstancesContents, push, count, kGroupSize);
        work.barrier(true);
    }
    return {count, std::move(memory)};
}

CapturedIndices captureIndices(DeviceValidation &device, VkCommandBuffer commandBuffer,
                               const AttachmentInput &attachment, uint32_t count)
{
    const uint32_t bytes = indexBytes(attachment.indexType);
    const VkDeviceAddress source = attachment.indexBuffer.deviceAddress;
    const auto buffer = bufferAt(device, source);
    if (bytes == 0 || !attachment.handle.handle || !buffer || count == 0)
        return {};
    const VkDeviceSize rest = buffer->address + buffer->size - source;
    if (VkDeviceSize{count - 1} * attachment.indexStride + bytes > rest)
        return {}; // outside its buffer, which other rules are about
    auto memory = Capture::make(device.traces.memory, kCountWords, kCountWords);
    if (!memory)
        return {};
    const shared::IndexKindsPush push{.source = source,
                                      .target = memory->address(),
                                      .stride = static_cast<uint32_t>(attachment.indexStride),
                                      .count = count,
                                      .bytes = bytes,
                                      .unused = 0};
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    work.dispatch(InjectedShader::IndexKinds, push, count, kGroupSize);
    work.barrier(true);
    return {count, std::move(memory)};
}

} // namespace

std::shared_ptr<Capture> Capture::make(MemoryPool &pool, size_t words, size_t zeros)
{
    const MemoryPool::Piece piece = pool.take(words * sizeof(uint32_t));
    if (piece.address == 0)
        return nullptr;
    std::fill_n(piece.words, zeros, 0u);
    return std::make_shared<Capture>(pool, piece);
}

std::optional<std::span<const VkDeviceAddress>> CapturedInstances::references() const
{
    if (!memory || memory->written() < count)
        return {};
    return std::span(reinterpret_cast<const VkDeviceAddress *>(memory->words() + kCountWords), count);
}

std::optional<bool> CapturedIndices::mixed() const
{
    if (!memory || memory->written() < count)
        return {};
    return memory->words()[1] == (shared::kIndexKindSpecial | shared::kIndexKindMicromap);
}

void captureContents(DeviceValidation &device, VkCommandBuffer commandBuffer,
                     const VkAccelerationStructureBuildGeometryInfoKHR &info,
                     const VkAccelerationStructureBuildRangeInfoKHR *ranges, StructureContents &contents)
{
    const CommandState *state = device.commands.states.get(commandBuffer);
    // In a command buffer that inherits conditional rendering, dispatches may be discarded.
    if (!device.gpu.on || !ranges || !state || state->inheritsConditionalRendering)
        return;
    for (uint32_t g = 0; g < contents.geometries.size(); ++g) {
        const VkAccelerationStructureGeometryKHR &geometry = *geometryOf(info, g);
        if (geometry.geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR)
            contents.instances = captureInstances(device, commandBuffer, geometry.geometry.instances, ranges[g]);
        else if (const auto attachment = attachmentOf(device, geometry))
            contents.geometries[g].indices =
                captureIndices(device, commandBuffer, *attachment, ranges[g].primitiveCount);
    }
}

} // namespace vellum::layer
