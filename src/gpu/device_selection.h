// SPDX-License-Identifier: Apache-2.0
// The physical devices of an instance, which of these is used (--device), and what is known of its faults.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>
#include <vulkan/vulkan.h>

#include "gpu/instance.h"

namespace vellum::gpu
{
struct DeviceInfo {
    const Instance *instance = nullptr;
    VkPhysicalDevice handle = VK_NULL_HANDLE;
    uint32_t number = 0; // in Vulkan's list
    std::string name;
    std::set<std::string> extensions;
    VkPhysicalDeviceType type = VK_PHYSICAL_DEVICE_TYPE_OTHER;
    bool rayQueries = false;          // with Vulkan 1.3 and acceleration structures
    bool rayTracingPipelines = false; // likewise
    bool khrMicromaps = false;        // of the driver or a layer
    bool extMicromaps = false;
    std::string implementation; // of micromaps, in words

    [[nodiscard]] bool tracesRays() const { return rayQueries || rayTracingPipelines; }
    [[nodiscard]] bool has(Api api) const { return api == Api::Khr ? khrMicromaps : extMicromaps; }
};

// Lavapipe of Mesa 26 or newer.
bool isLavapipe26(VkPhysicalDevice device);

// `instance` must outlive what is made of them.
std::vector<DeviceInfo> listDevices(const Instance &instance);

// Selects a device, as --device does: a text of digits is a number in Vulkan's list and nothing else, any other text a
// part of a name. Of several, and without a text of all, the most powerful kind that traces rays, and the first of
// these.
class DeviceSelection
{
public:
    DeviceSelection() = default;
    explicit DeviceSelection(std::optional<std::string> text) : text_(std::move(text)) {}

    // Throws std::runtime_error if no device matches.
    [[nodiscard]] DeviceInfo from(std::span<const DeviceInfo> devices) const;
    [[nodiscard]] DeviceInfo from(const Instance &instance) const { return from(listDevices(instance)); }
    // Nothing if it does not select by number.
    [[nodiscard]] std::optional<uint32_t> number() const;
    // The option for the command line of another process.
    [[nodiscard]] const std::optional<std::string> &text() const { return text_; }

private:
    std::optional<std::string> text_;
};

// Throws std::runtime_error where the device lacks the extension. `layer`: the layer was enabled.
void requireMicromaps(const DeviceInfo &device, Api api, bool layer);

// Faults of drivers that have nothing to do with opacity micromaps, as each occurs without them, and documented limits
// of Vellum's layer. Cases that would meet one are avoided or not checked, and reports name it.
enum class Fault {
    ReportChangesAttributes,
    SharedIntersectionStage,
    RayGenerationInLibrary,
    InstanceBehindInvisible,
    AddressWithConstantFlags,
    FirstVertexIgnored,
    FourthComponentTransformed,
    InactiveHideOthers,
    ConditionalBuilds,
    LayerIntersectionShaders,
    LayerSerializedStructures,
    LayerMixedLibraries,
};

struct KnownFault {
    Fault fault;
    std::string_view text;     // the fault of the driver or the layer
    std::string_view response; // what is avoided or not checked
};

// The known faults of a device. includesTools: also those of Vellum's layer, which is a tool of the device
// (Vulkan 1.3).
std::vector<KnownFault> knownFaults(VkPhysicalDevice device, bool includesTools);

} // namespace vellum::gpu
