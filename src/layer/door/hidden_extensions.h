// Extensions of drivers that do not work beside emulated micromaps. They are hidden where VK_EXT_opacity_micromap is
// emulated. Where it is the driver's own they stay, but a device cannot have one of them and emulated micromaps.
#pragma once

#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

struct HiddenExtension {
    const char *name;
    const char *reason;       // a clause that says why
    VkStructureType features; // its VkPhysicalDevice...Features, which has
    uint32_t featureCount;    // so many VkBool32
};

// Of this name, or null.
const HiddenExtension *hiddenExtension(const char *name);

// Why an extension cannot be enabled beside translated micromaps: a clause; null where it can. The driver's list and its
// features are as they are: without VK_KHR_opacity_micromap, all of them work.
const char *notBesideTranslation(const char *name);

// Answers a query of features: sets those of hidden extensions to false.
void clearHiddenFeatures(VkPhysicalDeviceFeatures2 &features);

} // namespace vellum::layer
