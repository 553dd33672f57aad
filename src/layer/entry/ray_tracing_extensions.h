// SPDX-License-Identifier: Apache-2.0
// Extensions of drivers that concern ray tracing: those that cannot be enabled together with the layer's micromaps, and
// those that can.
//
// An extension that cannot is offered nevertheless: a device without micromaps may enable it. A device that enables
// both is not created. Programs that enable every feature they know would then have no device, so a query of features
// that names micromaps too returns false for such an extension: all features that one query returns can be enabled
// together, and micromaps have precedence.
#pragma once

#include "layer/base/driver.h"
#include "layer/entry/physical_device.h"

namespace vellum::layer
{

struct ConflictingExtension {
    const char *name;
    const char *reason;       // a clause for messages
    VkStructureType features; // VkPhysicalDevice...Features of the extension
    uint32_t featureCount;    // members of that structure, each a VkBool32
    enum class Translated {
        Works,
        NotBesideKhr,  // does not work on a device with VK_KHR_opacity_micromap
        NotBesideWork, // does not work on any device whose command buffers get injected work
    } translated = Translated::Works;
    // It depends on VK_EXT_opacity_micromap, and can only extend that of the driver: where that is emulated, no device
    // can have this extension, and it is not listed.
    bool extendsDriversExt = false;
};

// The extension of that name if no device can have it, because it extends what the layer emulates; otherwise null.
const ConflictingExtension *impossibleExtension(const char *name, const Implementations &have);

// The first enabled extension that a device of that mode cannot have; null if there is none. Extensions of which no
// feature is enabled do nothing.
const ConflictingExtension *conflictingExtension(const VkDeviceCreateInfo &info, Mode mode, const Implementations &have,
                                                 const EnabledFeatures &enabled);

// Sets the features to false that a device cannot have together with those that the same query names; `named`: those
// that the layer provides.
void clearConflictingFeatures(VkPhysicalDeviceFeatures2 &features, const Implementations &have,
                              const EnabledFeatures &named);

// Returns whether an extension is for ray tracing, by its name, and newer than this version of the layer: it may build
// structures, or trace rays, in ways that the layer does not see.
bool isUnknownRayTracing(const char *name);

// Returns whether an enabled extension may build acceleration structures by commands of its own.
bool mayBuildOtherStructures(const VkDeviceCreateInfo &info);

} // namespace vellum::layer
