// SPDX-License-Identifier: Apache-2.0
#include "layer/micromaps/micromap.h"

#include <algorithm>
#include <new>
#include <string>

#include "layer/base/command_check.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/rules/ids.h"

namespace vellum::layer
{

VkResult createMicromap(DeviceMicromaps &device, VkDevice, const VkMicromapCreateInfoEXT *info,
                        const VkAllocationCallbacks *, VkMicromapEXT *micromap)
{
    const CommandCheck check(device.driver.report(), "vkCreateMicromapEXT");
    // Tolerated: the type of the build decides.
    if (info->type != VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT &&
        !check.tolerate("VUID-VkMicromapCreateInfoEXT-type-parameter",
                        "type is not VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    const bool flagged = (info->createFlags & VK_MICROMAP_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_EXT) != 0;
    const bool replayable = flagged && device.driver.enabled.captureReplay;
    if (flagged && !replayable &&
        !check.tolerate(rules::ids::kMicromapReplay,
                        "DEVICE_ADDRESS_CAPTURE_REPLAY without the feature micromapCaptureReplay"))
        return VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS;
    // Drivers ignore the address in this case, and NVRHI always sets one.
    if (info->deviceAddress != 0 && !flagged &&
        !check.tolerate(rules::ids::kMicromapAddress, "deviceAddress without DEVICE_ADDRESS_CAPTURE_REPLAY"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    const VkDeviceSize bufferSize = device.buffers.infos.get(info->buffer).size;
    const VkDeviceSize capacity = bufferSize - std::min(info->offset, bufferSize);
    // The part inside the buffer may be large enough for the build.
    if (info->size > capacity &&
        !check.tolerateIf(capacity > 0, rules::ids::kMicromapRange,
                          "offset " + std::to_string(info->offset) + " + size " + std::to_string(info->size) +
                              " is beyond the buffer's " + std::to_string(bufferSize) + " bytes"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    // Shaders read and write 16 bytes at once.
    if (info->offset % 256 != 0 &&
        !check.tolerateIf(info->offset % 16 == 0, rules::ids::kMicromapOffset,
                          "offset " + std::to_string(info->offset) + " is not a multiple of 256"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    // The address of a micromap follows from that of its buffer, which the driver was asked to replay.
    if (replayable && info->deviceAddress != 0 &&
        info->deviceAddress != device.driver.bufferAddress(info->buffer) + info->offset) {
        device.driver.report().error(
            "VELLUM-micromap-replay",
            "vkCreateMicromapEXT: the buffer is not at the address that it had at the time of capture");
        return VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS;
    }
    auto *object = new (std::nothrow) Micromap{info->buffer, info->offset, std::min(info->size, capacity), {}};
    if (!object)
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    *micromap = reinterpret_cast<VkMicromapEXT>(object);
    object->object.handle = reinterpret_cast<uint64_t>(*micromap);
    return VK_SUCCESS;
}

void destroyMicromap(DeviceMicromaps &device, VkDevice, VkMicromapEXT micromap, const VkAllocationCallbacks *)
{
    if (micromap) {
        device.objects.privateData.forgetObject(reinterpret_cast<uint64_t>(micromap));
        device.driver.report().setName(reinterpret_cast<uint64_t>(micromap), "");
    }
    delete micromapOf(micromap);
}

} // namespace vellum::layer
