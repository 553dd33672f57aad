// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/sync/sync_ranges.h"

#include <algorithm>

#include "layer/validation/device_validation.h"

namespace vellum::layer::sync
{
namespace
{

constexpr VkDeviceSize kStructureAlignment = 256; // of offsets in buffers

Range rangeOf(const ValidatedBuffer *buffer, VkDeviceSize offset, VkDeviceSize size)
{
    if (!buffer || !buffer->memory || offset >= buffer->size)
        return {};
    const VkDeviceSize begin = buffer->memoryOffset + offset;
    return {uint64_t(buffer->memory), begin, begin + std::min(size, buffer->size - offset)};
}

} // namespace

Location locationOf(const ValidatedStructure *structure)
{
    if (!structure)
        return {};
    const VkDeviceSize bytes = std::min(structure->size, kStructureAlignment);
    return {rangeOf(structure->buffer.get(), structure->offset, bytes),
            structure->buffer && structure->buffer->exclusive, structure->handle};
}

Location locationAt(const DeviceValidation &device, VkDeviceAddress address, VkDeviceSize size)
{
    const AddressMap::Location found = device.buffers.addresses.find(address);
    const auto buffer = found.buffer ? device.objects.buffers.get(found.buffer) : nullptr;
    if (!buffer || size == 0)
        return {};
    return {rangeOf(buffer.get(), found.offset, size), buffer->exclusive, buffer->handle};
}

Location locationIn(const DeviceValidation &device, VkBuffer handle, VkDeviceSize offset, VkDeviceSize size)
{
    const auto buffer = device.objects.buffers.get(handle);
    constexpr VkFlags64 interesting =
        VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
        VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
        VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;
    if (!buffer || (buffer->usage & interesting) == 0)
        return {};
    return {rangeOf(buffer.get(), offset, size), buffer->exclusive, buffer->handle};
}

Range rangeIn(const DeviceValidation &device, VkBuffer handle, VkDeviceSize offset, VkDeviceSize size)
{
    return rangeOf(device.objects.buffers.get(handle).get(), offset, size);
}

} // namespace vellum::layer::sync
