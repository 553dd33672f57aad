// SPDX-License-Identifier: Apache-2.0
// The settings of the layer. Their sources, from the weakest to the strongest: vk_layer_settings.txt,
// VkLayerSettingsCreateInfoEXT, environment variables.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "layer/base/settings_table.h"

namespace vellum::layer
{

// The names of this copy of the layer (copy.cpp). The tests have a second copy, which acts as a driver with micromaps
// under the first.
extern const char *const kLayerName;      // VK_LAYER_VELLUM_opacity_micromap
extern const char *const kVariablePrefix; // of environment variables: VELLUM_
extern const char *const kMessagePrefix;  // of message ids; empty except in the second copy

enum class ReportLevel { None, Error, Warning, Info };
// Who implements micromaps.
enum class Preferred { Automatic, Driver, Ext, Emulated };

// The parts of validation that are on.
struct Checks {
#define VELLUM_MEMBER(name, member, label, description) bool member = false;
    VELLUM_CHECKS(VELLUM_MEMBER)
#undef VELLUM_MEMBER
    [[nodiscard]] bool any() const
    {
        return core || gpu || sync;
    }
    bool operator==(const Checks &) const = default;
};

struct Settings {
#define VELLUM_MEMBER(key, member, type, initial, label, description) type member = initial;
    VELLUM_SETTINGS(VELLUM_MEMBER)
#undef VELLUM_MEMBER
    bool reportIsGiven = false;      // with any value
    std::vector<std::string> faults; // unknown names and wrong values, as messages

    // Messages on stderr if there is no other receiver: with `validate`, unless `report` says otherwise.
    [[nodiscard]] ReportLevel reportAlone() const
    {
        return reportIsGiven || !validate.any() ? report : ReportLevel::Warning;
    }
};

// A limit of a device as a setting simulates it.
inline uint32_t simulatedLimit(uint32_t limit, uint32_t setting)
{
    return setting == 0 ? limit : std::min(limit, setting);
}

// `instanceChain`: the pNext chain of VkInstanceCreateInfo.
Settings readSettings(const void *instanceChain);

} // namespace vellum::layer
