// SPDX-License-Identifier: Apache-2.0
// The driver's micromaps in the memory of the application's acceleration structures.
//
// A VkMicromapEXT has one size, and the target of a clone must have exactly the size of its source. An acceleration
// structure may be much larger than what is built into it: a GENERIC one often reaches to the end of its buffer. So
// each size that is used at a location has its own VkMicromapEXT there. They live as long as any structure at that
// location.
#pragma once

#include <mutex>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct AccelerationStructure;
struct DeviceKhrOverExt;
struct Driver;

// A driver's micromap, and what was recorded into it last.
struct PlacedMicromap {
    VkMicromapEXT handle = VK_NULL_HANDLE;
    VkDeviceSize bytes = 0;
    bool isKnown = false; // `usages` is valid for what was recorded last
    // Levels and formats, each once, of everything that was recorded at the location: sizes of structures that name the
    // micromap may have been queried at any time in between.
    std::vector<VkMicromapUsageEXT> usages;
};

// All micromaps at one location.
class PlacedMicromaps
{
public:
    explicit PlacedMicromaps(const Driver &driver) : driver_(driver) {}
    ~PlacedMicromaps();
    PlacedMicromaps(const PlacedMicromaps &) = delete;
    PlacedMicromaps &operator=(const PlacedMicromaps &) = delete;

    // The micromap of that size, which is created if needed; VK_NULL_HANDLE if the driver cannot create it.
    VkMicromapEXT ofSize(VkBuffer buffer, VkDeviceSize offset, VkDeviceSize bytes);
    void record(PlacedMicromap micromap);
    [[nodiscard]] PlacedMicromap last() const; // with a null handle: nothing was recorded

private:
    const Driver &driver_;
    mutable std::mutex mutex_;
    std::vector<std::pair<VkDeviceSize, VkMicromapEXT>> micromaps_;
    PlacedMicromap last_;
    std::vector<VkMicromapUsageEXT> usages_;
};

// Returns whether the driver can have a micromap there. EXT requires that the offset is a multiple of 256, KHR that the
// address is. Both are the same if buffers have such addresses. Otherwise, as on lavapipe, the address is sufficient,
// because drivers work with addresses; other structures of vkCreateAccelerationStructure2KHR are passed to them in the
// same way.
bool allowsMicromapAt(const DeviceKhrOverExt &device, VkBuffer buffer, VkDeviceSize offset);
// The driver's micromap of that size at the location of a structure; VK_NULL_HANDLE if it cannot be created.
VkMicromapEXT micromapOfSize(DeviceKhrOverExt &device, const AccelerationStructure &structure, VkDeviceSize bytes);
// What was recorded last at the structure's location. If nothing was: an unknown micromap of the greatest possible
// size.
PlacedMicromap lastMicromap(DeviceKhrOverExt &device, const AccelerationStructure &structure);
// Returns whether the driver has made a micromap for the structure; reports that it could not.
bool checkDriverMicromap(const DeviceKhrOverExt &device, const char *command, const AccelerationStructure &structure,
                         VkMicromapEXT micromap);
// Notes that a build or copy of a micromap is recorded into the structure.
void setDriverMicromap(DeviceKhrOverExt &device, AccelerationStructure &structure, PlacedMicromap micromap);

} // namespace vellum::layer
