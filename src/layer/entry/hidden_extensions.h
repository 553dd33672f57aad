// SPDX-License-Identifier: Apache-2.0
// Extensions of drivers that do not work beside emulated micromaps. They are hidden if VK_EXT_opacity_micromap is
// emulated. If the driver has that extension they are listed, but a device cannot enable one of them together with
// emulated micromaps. Some do not work beside translated micromaps either. These are hidden if VK_KHR_opacity_micromap
// is translated, so that a device can enable all extensions that are listed.
#pragma once

#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

struct HiddenExtension {
    const char *name;
    const char *reason;       // a clause for messages
    VkStructureType features; // VkPhysicalDevice...Features of the extension
    uint32_t featureCount;    // members of that structure, each a VkBool32
    enum class Translated {
        Works,
        NotBesideKhr,  // does not work on a device with VK_KHR_opacity_micromap
        NotBesideWork, // does not work on any device whose command buffers get injected work
    } translated = Translated::Works;
};

// The extension of this name, if it does not work beside emulated (translated) micromaps; otherwise null.
const HiddenExtension *hiddenByEmulation(const char *name);
const HiddenExtension *hiddenByTranslation(const char *name);

// Sets the features of the extensions that `hidden` returns to false.
void clearHiddenFeatures(VkPhysicalDeviceFeatures2 &features, const HiddenExtension *(*hidden)(const char *name));

} // namespace vellum::layer
