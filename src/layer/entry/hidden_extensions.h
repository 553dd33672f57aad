// Extensions of drivers that do not work beside emulated micromaps. They are hidden where VK_EXT_opacity_micromap is
// emulated. Where it is the driver's own they stay, but a device cannot have one of them and emulated micromaps. Some
// do not work beside translated micromaps either. They are hidden where VK_KHR_opacity_micromap is translated, so that
// a device may enable all that is listed there.
#pragma once

#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

struct HiddenExtension {
    const char *name;
    const char *reason;       // a clause that says why
    VkStructureType features; // its VkPhysicalDevice...Features, which has
    uint32_t featureCount;    // so many VkBool32
    enum class Translated {
        Works,
        NotBesideKhr,  // it does not work on a device that has VK_KHR_opacity_micromap
        NotBesideWork, // nor on any for which the layer adds work of its own to command buffers
    } translated = Translated::Works;
};

// Of this name, or null: those that do not work beside emulated micromaps, and those beside translated ones.
const HiddenExtension *hiddenByEmulation(const char *name);
const HiddenExtension *hiddenByTranslation(const char *name);

// Answers a query of features: sets those of extensions that `hidden` gives to false.
void clearHiddenFeatures(VkPhysicalDeviceFeatures2 &features, const HiddenExtension *(*hidden)(const char *name));

} // namespace vellum::layer
