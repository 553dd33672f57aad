// SPDX-License-Identifier: Apache-2.0
#include "gpu/known_faults.h"

#include <algorithm>
#include <array>

#include "vk/vk_init.h"

namespace vellum::gpu
{
namespace
{

constexpr uint32_t kMesa26 = VK_MAKE_API_VERSION(0, 26, 0, 0);
constexpr uint32_t kNotFixed = UINT32_MAX; // in any version that is known

struct OfDriver {
    KnownFault known;
    VkDriverId driver;
    uint32_t first, end; // versions that have it: from `first`, and before `end`
};

constexpr std::array<OfDriver, 9> kOfDrivers{{
    {{Fault::ReportChangesAttributes,
      "a hit that an intersection shader reports and that is not accepted changes the attributes of the committed hit",
      "attributes of such committed hits are not checked"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kNotFixed},
    {{Fault::SharedIntersectionStage,
      "where two hit groups share an intersection shader, the any-hit shader of one of them runs for both",
      "hit groups do not share intersection shaders"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kNotFixed},
    {{Fault::RayGenerationInLibrary, "a ray generation shader of a pipeline library does not run",
      "ray generation shaders are not in libraries"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kNotFixed},
    {{Fault::InstanceBehindInvisible,
      "an instance behind one that is inactive or has mask 0 crashes shaders that trace",
      "such instances are active and have another mask, except at the end"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     kMesa26,
     kNotFixed},
    {{Fault::AddressWithConstantFlags,
      "ray queries in ray tracing stages with constant ray flags, of an acceleration structure by its address, meet "
      "nothing, meet wrong things or crash",
      "ray queries in these stages get structures from descriptors where their flags are constant"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     kMesa26,
     kNotFixed},
    // Mesa 25.0 builds on the CPU. Later ones build as RADV does (vk_acceleration_structure.c), which is right in
    // these two.
    {{Fault::FirstVertexIgnored, "builds ignore firstVertex", "it is 0"}, VK_DRIVER_ID_MESA_LLVMPIPE, 0, kMesa26},
    {{Fault::FourthComponentTransformed,
      "transformData moves vertices by as much as their fourth component, which is to be ignored",
      "geometries whose vertex format has four components have no transformData"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kMesa26},
    // Mesa 26.1.6 leaves their nodes as the memory was.
    {{Fault::InactiveHideOthers,
      "inactive triangles and AABBs hide others of their structure, are met, or crash shaders that trace",
      "degenerate ones are in their place"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kNotFixed},
    {{Fault::ConditionalBuilds, "a build within conditional rendering whose predicate is false crashes",
      "builds, copies and queries are not within it"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     kMesa26,
     kNotFixed},
}};

struct OfLayer {
    KnownFault known;
    std::string_view description; // the fault as the layer reports it
};

constexpr std::array<OfLayer, 3> kOfLayer{{
    {{Fault::LayerIntersectionShaders,
      "Vellum's layer emulates: intersection shaders may lack ray flags, and run for boxes that a ray flag culls",
      "neither is checked"},
     "emulated"},
    {{Fault::LayerSerializedStructures,
      "Vellum's layer translates to VK_EXT_opacity_micromap, and rejects serializing a BLAS with micromaps",
      "with VK_KHR_opacity_micromap, such structures are not serialized"},
     "translated"},
    {{Fault::LayerMixedLibraries,
      "Vellum's layer emulates: it creates no pipelines of libraries with and without the micromap bit",
      "all libraries of a pipeline have it, or none"},
     "emulated"},
}};

std::vector<VkPhysicalDeviceToolProperties> toolsOf(VkPhysicalDevice device)
{
    uint32_t count = 0;
    vkGetPhysicalDeviceToolProperties(device, &count, nullptr);
    std::vector<VkPhysicalDeviceToolProperties> tools(count, vkInit<VkPhysicalDeviceToolProperties>());
    vkGetPhysicalDeviceToolProperties(device, &count, tools.data());
    return tools;
}

} // namespace

std::vector<KnownFault> knownFaults(VkPhysicalDevice device, bool includesTools)
{
    auto driver = vkInit<VkPhysicalDeviceDriverProperties>();
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &driver});
    vkGetPhysicalDeviceProperties2(device, &properties);
    const uint32_t version = properties.properties.driverVersion;
    std::vector<KnownFault> faults;
    for (const OfDriver &row : kOfDrivers)
        if (row.driver == driver.driverID && version >= row.first && version < row.end)
            faults.push_back(row.known);
    if (!includesTools || properties.properties.apiVersion < VK_API_VERSION_1_3)
        return faults;
    for (const VkPhysicalDeviceToolProperties &tool : toolsOf(device))
        for (const OfLayer &row : kOfLayer)
            if (std::string_view(tool.layer).starts_with("VK_LAYER_VELLUM_") && tool.description == row.description)
                faults.push_back(row.known);
    return faults;
}

} // namespace vellum::gpu
