// SPDX-License-Identifier: Apache-2.0
#include "layer/khr_over_ext/ext_backend.h"

#include "layer/command_buffer/injected_work.h"
#include "layer/khr_over_ext/device_khr_over_ext.h"
#include "layer/khr_over_ext/placed_micromaps.h"

namespace vellum::layer
{

bool ExtBackend::begin(VkCommandBuffer commandBuffer, const char *)
{
    if (const auto state = device_.commands.states.get(commandBuffer))
        state->scratch.restart();
    return true;
}

MicromapSupport ExtBackend::support() const
{
    return {limits_, false, device_.driver.enabled.ext || device_.driver.enabled.khr, true};
}

bool ExtBackend::placesMicromap(VkBuffer buffer, VkDeviceSize offset, VkDeviceAddress) const
{
    // VUID-VkMicromapCreateInfoEXT-buffer-07435
    const bool hasUsage = (device_.buffers.infos.get(buffer).usage & VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT) != 0;
    return device_.driver.next.CreateMicromapEXT && hasUsage && allowsMicromapAt(device_, buffer, offset);
}

bool ExtBackend::createMicromap(AccelerationStructure &micromap)
{
    return micromapOfSize(device_, micromap, micromap.size) != VK_NULL_HANDLE;
}

void ExtBackend::recordMicromapAnswer(VkCommandBuffer commandBuffer, const Property &property)
{
    const DeviceTable &next = device_.driver.next;
    const PlacedMicromap micromap = lastMicromap(device_, property.structure);
    const VkQueryType own = property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR
                                ? VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT
                                : VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT;
    switch (property.type) {
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR:
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR:
        if (!micromap.handle)
            return;
        next.CmdWriteMicromapsPropertiesEXT(commandBuffer, 1, &micromap.handle, own, property.micromapPool,
                                            property.query);
        return next.CmdCopyQueryPoolResults(commandBuffer, property.micromapPool, property.query, 1, property.buffer,
                                            property.offset, 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT);
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR: {
        // EXT has no such query. A clone has as many bytes as its source:
        // VUID-VkCopyAccelerationStructureInfoKHR-mode-12418.
        const uint64_t bytes = markedMicromapSize(micromap.bytes);
        return next.CmdUpdateBuffer(commandBuffer, property.buffer, property.offset, sizeof bytes, &bytes);
    }
    default: return;
    }
}

void ExtBackend::recordCorrections(VkCommandBuffer, InjectedWork &work, std::span<const Property> properties)
{
    // The size marks a structure that is created with it as one for a micromap. Applications may create the target of a
    // deserialization with the size of the serialized data.
    for (const Property &property : properties) {
        if (property.micromap && (property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR ||
                                  property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR))
            work.dispatch(InjectedShader::MarkedSize, shared::MarkedSizePush{property.address}, 1, 1);
    }
}

} // namespace vellum::layer
