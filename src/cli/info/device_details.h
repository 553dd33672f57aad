// SPDX-License-Identifier: Apache-2.0
// The features of a Vulkan device that micromaps need, and who implements micromaps.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "base/json_writer.h"
#include "gpu/device.h"

namespace vellum::cli
{

enum class Provider { Nobody, Driver, Layer, Translated };

// Name of a limit as Vulkan has it, or of a memory heap, and its value.
struct DeviceLimit {
    std::string name;
    uint64_t value = 0;
};

struct DeviceDetails {
    uint32_t number = 0; // for --device
    std::string name;
    std::string driver;  // name and version, as it says
    std::string version; // of Vulkan: "1.3.289"
    std::string kind;    // "CPU"
    bool accelerationStructures = false;
    bool rayQueries = false;
    bool rayTracingPipelines = false;
    Provider ext = Provider::Nobody; // of VK_EXT_opacity_micromap
    Provider khr = Provider::Nobody; // of VK_KHR_opacity_micromap
    // The maxima of either extension.
    uint32_t most2StateLevel = 0;
    uint32_t most4StateLevel = 0;
    std::set<std::string> extensions; // with the layer, if it is on
    // The limits that matter for ray tracing, and the bytes of each memory heap. Empty below Vulkan 1.2.
    std::vector<DeviceLimit> limits;
    // Why the layer would not bring micromaps, one line each.
    std::vector<std::string> missing;

    [[nodiscard]] bool hasMicromaps() const { return ext != Provider::Nobody || khr != Provider::Nobody; }
};

// Describes each device of `instance`, in the order of listDevices.
std::vector<DeviceDetails> describeDevices(const gpu::Instance &instance);

// Writes members of the JSON object that is open.
void writeMembers(const DeviceDetails &details, JsonWriter &json);

} // namespace vellum::cli
