// SPDX-License-Identifier: Apache-2.0
// What a Vulkan device has that micromaps need, and who brings it.
#pragma once

#include <string>
#include <vector>

#include "cli/vulkan/context.h"

namespace vellum::cli
{

enum class Provider { Nobody, Driver, Layer, Translated };

struct DeviceDetails {
    std::string name;
    std::string driver;  // name and version, as it says
    std::string version; // of Vulkan: "1.3.289"
    std::string kind;    // "CPU"
    bool accelerationStructures = false;
    bool rayQueries = false;
    bool rayTracingPipelines = false;
    Provider ext = Provider::Nobody; // of VK_EXT_opacity_micromap
    Provider khr = Provider::Nobody; // of VK_KHR_opacity_micromap
    // With either extension.
    uint32_t most2StateLevel = 0;
    uint32_t most4StateLevel = 0;
    // Why the layer would not bring micromaps, one line each.
    std::vector<std::string> missing;

    [[nodiscard]] bool hasMicromaps() const { return ext != Provider::Nobody || khr != Provider::Nobody; }
};

// Of each device of `instance`, in the order of listDevices.
std::vector<DeviceDetails> describeDevices(const Instance &instance);

} // namespace vellum::cli
