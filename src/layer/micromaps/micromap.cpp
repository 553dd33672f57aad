// SPDX-License-Identifier: Apache-2.0
#include "layer/micromaps/micromap.h"

#include <algorithm>
#include <new>
#include <string>

#include "layer/input/checked.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/rules/creations.h"

namespace vellum::layer
{

VkResult createMicromap(DeviceMicromaps &device, VkDevice, const VkMicromapCreateInfoEXT *info,
                        const VkAllocationCallbacks *, VkMicromapEXT *micromap)
{
    const VkDeviceSize bufferSize = device.buffers.infos.get(info->buffer).size;
    const auto creation = input::Checked<input::Creation>::take(info, [&] {
        const Place command("vkCreateMicromapEXT");
        const Place place = command.member("pCreateInfo");
        return rules::checkCreation(InputCheck(device.objects.rules, place, info->buffer), *info, bufferSize);
    });
    if (!creation.accepted)
        return VK_ERROR_VALIDATION_FAILED_EXT;
    const bool replayable = creation.replays && device.driver.enabled.captureReplay;
    // The address of a micromap follows from that of its buffer, which the driver replays.
    if (replayable && info->deviceAddress != 0 &&
        info->deviceAddress != device.driver.bufferAddress(info->buffer) + info->offset) {
        device.driver.report().error(
            "VELLUM-micromap-replay",
            "vkCreateMicromapEXT: the buffer is not at the address that it had at the time of capture");
        return VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS;
    }
    auto *object = new (std::nothrow)
        Micromap{info->buffer, info->offset, std::min(info->size, bufferSize - std::min(info->offset, bufferSize)), {}};
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
