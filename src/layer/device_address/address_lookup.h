// From the address ranges of VK_KHR_device_address_commands to buffers.
#pragma once

#include <optional>
#include <string>

#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::layer
{

struct DeviceBuffers;

// Finds the buffers of one command's ranges, and tells what is wrong with a range that has none: the command must then
// record nothing. Drivers read and write addresses, whatever the size of the range and the usage of the buffer are:
// what is wrong with these is told, and the command recorded, as long as all that it accesses lies in one buffer.
class AddressLookup
{
public:
    // `otherwise`: for messages, what happens to the command then.
    AddressLookup(const DeviceBuffers &device, VkCommandBuffer commandBuffer, const char *command,
                  const char *otherwise = "nothing is recorded")
        : device_(device), commandBuffer_(commandBuffer), command_(command), otherwise_(otherwise)
    {
    }

    // What a command accesses of a range.
    enum class Part {
        All,
        Least,   // the bytes that it needs at least
        UpToEnd, // what shaders ask for, and nothing behind the range
    };
    // What a command needs of a range.
    struct Need {
        const char *member;  // for messages: the parameter or member that the range is
        VkFlags64 usage;     // of the buffer
        const char *usageId; // message where buffers there lack it
        VkDeviceSize least = 0;
        const char *leastId = nullptr; // message where the range is smaller
        uint32_t index = 0;            // for messages: the element of an array that the range is in
        Part part = Part::All;
    };
    struct Found {
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
        VkDeviceSize size = 0; // of the range, as far as the buffer goes
    };
    [[nodiscard]] std::optional<Found> find(const VkDeviceAddressRangeKHR &range, const Need &need) const;
    [[nodiscard]] std::optional<Found> find(const VkStridedDeviceAddressRangeKHR &range, const Need &need) const;

    void reject(const char *id, const std::string &text) const;
    // Whether the command is recorded all the same, as where the fault is harmless and nobody is strict.
    [[nodiscard]] bool tolerateIf(bool harmless, const char *id, const std::string &text) const;

private:
    struct Rules {
        const char *null, *buffer;
    };
    [[nodiscard]] std::optional<Found> find(const VkDeviceAddressRangeKHR &range, const Need &need,
                                            const Rules &rules) const;

    const DeviceBuffers &device_;
    VkCommandBuffer commandBuffer_;
    const char *command_;
    const char *otherwise_;
};

} // namespace vellum::layer
