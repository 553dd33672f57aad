// SPDX-License-Identifier: Apache-2.0
// Faults of drivers that have nothing to do with opacity micromaps, as each occurs without them, and documented limits
// of Vellum's layer. Cases that would meet one are avoided or not checked, and reports name it.
#pragma once

#include <string_view>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::gpu
{

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
