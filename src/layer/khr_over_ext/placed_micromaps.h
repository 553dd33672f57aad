// Micromaps of the driver's in the memory of the application's acceleration structures.
//
// A VkMicromapEXT is made for one size, and a clone wants a target of just the size of its source. An acceleration
// structure may be much larger than what is built into it: a GENERIC one often reaches to the end of its buffer. So
// each size that is used at a place has a VkMicromapEXT of its own there. They live as long as some structure at that
// place.
#pragma once

#include <mutex>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct AccelerationStructure;
struct DeviceKhrOverExt;
struct Driver;

// A micromap of the driver's, and what was recorded into it last.
struct PlacedMicromap {
    VkMicromapEXT handle = VK_NULL_HANDLE;
    VkDeviceSize bytes = 0;
    bool isKnown = false; // what follows is of what was recorded last
    // Levels and formats, each once, of all that was recorded at the place: the sizes of structures that name the
    // micromap were asked for at some time between.
    std::vector<VkMicromapUsageEXT> usages;
};

// All at one place.
class PlacedMicromaps
{
public:
    explicit PlacedMicromaps(const Driver &driver) : driver_(driver) {}
    ~PlacedMicromaps();
    PlacedMicromaps(const PlacedMicromaps &) = delete;
    PlacedMicromaps &operator=(const PlacedMicromaps &) = delete;

    // The one of that size, made if there is none; VK_NULL_HANDLE where the driver cannot make it.
    VkMicromapEXT ofSize(VkBuffer buffer, VkDeviceSize offset, VkDeviceSize bytes);
    void record(PlacedMicromap micromap);
    [[nodiscard]] PlacedMicromap last() const; // a null one: nothing was recorded

private:
    const Driver &driver_;
    mutable std::mutex mutex_;
    std::vector<std::pair<VkDeviceSize, VkMicromapEXT>> micromaps_;
    PlacedMicromap last_;
    std::vector<VkMicromapUsageEXT> usages_;
};

// Whether the driver can have a micromap there. EXT wants an offset that is a multiple of 256, KHR an address. These
// are the same where buffers for structures lie at such addresses; where they do not, as on lavapipe, it is addresses
// that drivers work with, and other structures of vkCreateAccelerationStructure2KHR are given to them in the same way.
bool mayHaveMicromapAt(const DeviceKhrOverExt &device, VkBuffer buffer, VkDeviceSize offset);
// The driver's micromap of that size at the place of a structure; VK_NULL_HANDLE where it cannot be made.
VkMicromapEXT micromapOfSize(DeviceKhrOverExt &device, const AccelerationStructure &structure, VkDeviceSize bytes);
// What was recorded last at its place. If nothing was, what a micromap there would be of which nothing is known.
PlacedMicromap lastMicromap(DeviceKhrOverExt &device, const AccelerationStructure &structure);
// Whether the driver has made a micromap for the structure; reports that it could not.
bool checkDriverMicromap(const DeviceKhrOverExt &device, const char *command, const AccelerationStructure &structure,
                         VkMicromapEXT micromap);
// Something of a micromap is recorded into the structure.
void becomesMicromap(DeviceKhrOverExt &device, AccelerationStructure &structure, PlacedMicromap micromap);

} // namespace vellum::layer
