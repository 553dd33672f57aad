// SPDX-License-Identifier: Apache-2.0
#include "layer/entry/ray_tracing_extensions.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <string_view>

#include "layer/base/pnext.h"
#include "vk/newer.h"

namespace vellum::layer
{
namespace
{

using Translated = ConflictingExtension::Translated;

constexpr ConflictingExtension kConflicting[] = {
    {"VK_NV_displacement_micromap", "it extends the driver's VK_EXT_opacity_micromap",
     VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_FEATURES_NV, 1, Translated::Works, true},
    // Extensions that build top-level structures in which instances have no slot.
    {"VK_NV_ray_tracing", "its structures are built and traced by commands of its own", VkStructureType{}, 0},
    {"VK_NV_ray_tracing_motion_blur", "its instances have another layout",
     VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_MOTION_BLUR_FEATURES_NV, 2},
    {"VK_NV_cluster_acceleration_structure", "its structures are built by commands of its own",
     static_cast<VkStructureType>(1000569000), 1},
    {"VK_NV_partitioned_acceleration_structure", "its structures are built by commands of its own",
     static_cast<VkStructureType>(1000570000), 1},
    {"VK_AMDX_dense_geometry_format", "its triangles name micromaps in another way",
     static_cast<VkStructureType>(1000478000), 1, Translated::NotBesideKhr},
    // Injected dispatches bind pipelines and push constants, and only what this command buffer has bound is restored.
    {"VK_NV_command_buffer_inheritance", "injected commands would change the state that is inherited",
     static_cast<VkStructureType>(1000559000), 1, Translated::NotBesideWork},
    {"VK_NV_push_constant_bank", "injected commands would change the constants of other banks",
     static_cast<VkStructureType>(1000580001), 1, Translated::NotBesideWork},
    {"VK_AMDX_shader_enqueue", "the layer does not rewrite the shaders of its pipelines",
     static_cast<VkStructureType>(1000134000), 2, Translated::NotBesideKhr},
};

// Parts of the names of extensions for ray tracing, and all of these that can be enabled together with the layer's
// micromaps. tests/structure/check_extensions.py compares them with the registry.
constexpr std::string_view kRayTracing[] = {"ray_tracing", "ray_query", "acceleration_structure", "micromap"};
constexpr std::string_view kCompatible[] = {
    "VK_ARM_pipeline_opacity_micromap",
    "VK_EXT_opacity_micromap",
    "VK_EXT_ray_tracing_invocation_reorder",
    "VK_KHR_acceleration_structure",
    "VK_KHR_opacity_micromap",
    "VK_KHR_ray_query",
    "VK_KHR_ray_tracing_maintenance1",
    "VK_KHR_ray_tracing_pipeline",
    "VK_KHR_ray_tracing_position_fetch",
    "VK_NV_ray_tracing_invocation_reorder",
    "VK_NV_ray_tracing_linear_swept_spheres",
    "VK_NV_ray_tracing_validation",
};

const ConflictingExtension *conflictingNamed(const char *name)
{
    const auto *found = std::ranges::find_if(
        kConflicting, [name](const ConflictingExtension &e) { return std::strcmp(e.name, name) == 0; });
    return found == std::end(kConflicting) ? nullptr : found;
}

// All of these structures begin with their features.
std::span<const VkBool32> membersOf(const VkBaseInStructure &structure, uint32_t count)
{
    return {reinterpret_cast<const VkBool32 *>(&structure + 1), count};
}

bool isEnabled(const VkDeviceCreateInfo &info, const ConflictingExtension &extension)
{
    if (extension.featureCount == 0)
        return true;
    const VkBaseInStructure *features = findInChain(info.pNext, extension.features);
    return features && std::ranges::any_of(membersOf(*features, extension.featureCount),
                                           [](VkBool32 feature) { return feature != VK_FALSE; });
}

bool conflicts(const ConflictingExtension &extension, Mode mode, const EnabledFeatures &enabled)
{
    switch (mode) {
    case Mode::Emulated: return true;
    case Mode::KhrOverExt: // without KHR such a device has the driver's micromaps, unchanged
        return extension.translated == Translated::NotBesideWork ||
               (extension.translated == Translated::NotBesideKhr && enabled.khr);
    case Mode::PassThrough:
    case Mode::Identifiers: break;
    }
    return false;
}

} // namespace

const ConflictingExtension *impossibleExtension(const char *name, const Implementations &have)
{
    const ConflictingExtension *extension = conflictingNamed(name);
    return extension && extension->extendsDriversExt && have.ext == Implementation::Emulation ? extension : nullptr;
}

const ConflictingExtension *conflictingExtension(const VkDeviceCreateInfo &info, Mode mode, const Implementations &have,
                                                 const EnabledFeatures &enabled)
{
    for (uint32_t i = 0; i < info.enabledExtensionCount; ++i) {
        const char *name = info.ppEnabledExtensionNames[i];
        if (const ConflictingExtension *impossible = impossibleExtension(name, have))
            return impossible;
        const ConflictingExtension *extension = conflictingNamed(name);
        if (extension && conflicts(*extension, mode, enabled) &&
            (extension->extendsDriversExt || isEnabled(info, *extension)))
            return extension;
    }
    return nullptr;
}

void clearConflictingFeatures(VkPhysicalDeviceFeatures2 &features, const Implementations &have,
                              const EnabledFeatures &named)
{
    const Mode mode = !named.any()                              ? Mode::PassThrough
                      : have.khr == Implementation::Translation ? Mode::KhrOverExt
                                                                : Mode::Emulated;
    for (auto *s = static_cast<VkBaseOutStructure *>(features.pNext); s; s = s->pNext) {
        for (const ConflictingExtension &one : kConflicting) {
            if (one.featureCount == 0 || s->sType != one.features)
                continue;
            if (impossibleExtension(one.name, have) || conflicts(one, mode, named))
                std::fill_n(reinterpret_cast<VkBool32 *>(s + 1), one.featureCount, VK_FALSE);
        }
    }
}

bool isUnknownRayTracing(const char *name)
{
    const std::string_view text = name;
    const auto isPart = [text](std::string_view part) { return text.find(part) != std::string_view::npos; };
    return std::ranges::any_of(kRayTracing, isPart) && !conflictingNamed(name) &&
           std::ranges::find(kCompatible, text) == std::end(kCompatible);
}

bool mayBuildOtherStructures(const VkDeviceCreateInfo &info)
{
    const std::span names(info.ppEnabledExtensionNames, info.enabledExtensionCount);
    return std::ranges::any_of(
        names, [](const char *name) { return conflictingNamed(name) != nullptr || isUnknownRayTracing(name); });
}

} // namespace vellum::layer
