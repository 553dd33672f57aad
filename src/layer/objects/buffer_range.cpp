#include "layer/objects/buffer_range.h"

#include <algorithm>
#include <string>

#include "layer/ground/judge.h"
#include "layer/objects/device_objects.h"

namespace vellum::layer
{

BufferRange rangeOf(const DeviceObjects &device, const VkAccelerationStructureCreateInfo2KHR &info,
                    VkDeviceSize micromapAlignment)
{
    const Judge judge(device.driver.report(), "vkCreateAccelerationStructure2KHR");
    const bool micromap = info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    const auto &[address, size] = info.addressRange;
    if (size == 0) {
        judge.refuse("VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11608", "addressRange is empty");
        return {};
    }
    if (micromap && !device.driver.asked.khrFeature &&
        !judge.tolerate("VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-micromap-11609",
                        "the feature VkPhysicalDeviceOpacityMicromapFeaturesKHR::micromap is not enabled"))
        return {};
    AddressMap::Place found =
        device.buffers.addresses.covering(address, size, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
    if (!found.buffer) {
        found = device.buffers.addresses.find(address);
        if (!found.buffer) {
            judge.refuse("VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11602",
                         "addressRange.address is not in any buffer");
            return {};
        }
        // Drivers need no usage, and what lies in the buffer may be enough for what is built there.
        if (!judge.tolerate("VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603",
                            "addressRange, of " + std::to_string(size) +
                                " bytes, is not in one buffer for acceleration structures"))
            return {};
    }
    // Shaders of the layer read and write 16 bytes at once. What drivers do, they do not say.
    if (address % 256 != 0 && !judge.weigh(micromap && address % micromapAlignment == 0,
                                           "VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11605",
                                           "addressRange.address is not a multiple of 256"))
        return {};
    return {found.buffer, found.offset, std::min(size, found.bytes)};
}

} // namespace vellum::layer
