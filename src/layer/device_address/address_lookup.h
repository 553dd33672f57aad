// SPDX-License-Identifier: Apache-2.0
// Finds the buffers of the address ranges of VK_KHR_device_address_commands.
#pragma once

#include <optional>
#include <string>

#include "layer/memory/address_map.h"
#include "layer/rules/address_ranges.h"
#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::layer
{

struct DeviceAddresses;

// Finds the buffers of one command's ranges, and keeps them for as long as the command exists (DriverBuffer). Reports
// an error for a range that is in no buffer; nothing may be recorded then. A wrong size of the range or usage of the
// buffer is harmless to drivers, if everything that the command accesses is in one buffer; it is reported and
// tolerated.
class AddressLookup
{
public:
    // `otherwise`: what a message says about the command that is rejected.
    AddressLookup(const DeviceAddresses &device, VkCommandBuffer commandBuffer, const char *command,
                  const char *otherwise = "nothing is recorded");

    // What a command requires of a range.
    struct Need {
        const char *member; // parameter or member, for messages
        const rules::Range &range;
        VkDeviceSize least = 0;        // minimum size; 0: that of `range`
        uint32_t index = 0;            // array element, for messages
        const char *leastId = nullptr; // message id for a smaller range; null: that of `range`
    };
    struct Found {
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
        VkDeviceSize size = 0; // of the range, limited by the buffer
    };
    [[nodiscard]] std::optional<Found> find(const VkDeviceAddressRangeKHR &range, const Need &need) const;
    [[nodiscard]] std::optional<Found> find(const VkStridedDeviceAddressRangeKHR &range, const Need &need) const;

    // Reports a violation, unless validation has reported one for the command. Returns whether the command may be
    // recorded.
    bool report(Severity severity, const char *id, const std::string &text) const;

private:
    [[nodiscard]] std::optional<Found> find(const VkDeviceAddressRangeKHR &range, const Need &need,
                                            const rules::AnyRange &rules) const;

    [[nodiscard]] Found keep(const AddressMap::Location &location, VkDeviceSize size) const;

    const DeviceAddresses &device_;
    VkCommandBuffer commandBuffer_;
    Place command_;
    const char *otherwise_;
    bool isReported_;
};

} // namespace vellum::layer
