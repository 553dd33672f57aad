// From the address ranges of VK_KHR_device_address_commands to buffers.
#pragma once

#include <optional>
#include <string>

#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::layer
{

struct DeviceBuffers;

// Finds the buffers of one command's ranges, and tells what is wrong with a range that has none: the command must then
// record nothing.
class AddressLookup
{
public:
    // `otherwise`: for messages, what happens to the command then.
    AddressLookup(const DeviceBuffers &device, VkCommandBuffer commandBuffer, const char *command,
                  const char *otherwise = "nothing is recorded")
        : device_(device), commandBuffer_(commandBuffer), command_(command), otherwise_(otherwise)
    {
    }

    // What a command needs of a range.
    struct Need {
        const char *member;  // for messages: the parameter or member that the range is
        VkFlags64 usage;     // of the buffer
        const char *usageId; // message where buffers there lack it
        VkDeviceSize least = 0;
        const char *leastId = nullptr; // message where the range is smaller
        uint32_t index = 0;            // for messages: the element of an array that the range is in
    };
    struct Found {
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
    };
    [[nodiscard]] std::optional<Found> find(const VkDeviceAddressRangeKHR &range, const Need &need) const;
    [[nodiscard]] std::optional<Found> find(const VkStridedDeviceAddressRangeKHR &range, const Need &need) const;

    void refuse(const std::string &id, const std::string &text) const;

private:
    [[nodiscard]] std::optional<Found> find(const VkDeviceAddressRangeKHR &range, const Need &need,
                                            const char *structure) const;

    const DeviceBuffers &device_;
    VkCommandBuffer commandBuffer_;
    const char *command_;
    const char *otherwise_;
};

} // namespace vellum::layer
