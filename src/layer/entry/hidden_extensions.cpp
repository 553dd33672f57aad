// SPDX-License-Identifier: Apache-2.0
#include "layer/entry/hidden_extensions.h"

#include <algorithm>
#include <cstring>
#include <iterator>

namespace vellum::layer
{
namespace
{

constexpr HiddenExtension kHidden[] = {
    {newer::kDisplacementMicromapExtension, "it extends the driver's VK_EXT_opacity_micromap",
     newer::kDisplacementMicromapFeatures, 1},
    // Extensions that build top-level structures in which instances have no slot.
    {"VK_NV_ray_tracing", "its structures are built and traced by commands of its own", VkStructureType{}, 0},
    {"VK_NV_ray_tracing_motion_blur", "its instances have another layout",
     VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_MOTION_BLUR_FEATURES_NV, 2},
    {"VK_NV_cluster_acceleration_structure", "its structures are built by commands of its own",
     static_cast<VkStructureType>(1000569000), 1},
    {"VK_NV_partitioned_acceleration_structure", "its structures are built by commands of its own",
     static_cast<VkStructureType>(1000570000), 1},
    {"VK_AMDX_dense_geometry_format", "its triangles name micromaps in another way",
     static_cast<VkStructureType>(1000478000), 1, HiddenExtension::Translated::NotBesideKhr},
    // "recording any non-heap descriptor state commands immediately invalidates" what vkCmdPushDataEXT pushed, and
    // injected dispatches push constants.
    {"VK_EXT_descriptor_heap", "injected commands would invalidate the heaps that are bound",
     static_cast<VkStructureType>(1000135009), 2, HiddenExtension::Translated::NotBesideWork},
    {"VK_AMDX_shader_enqueue", "the layer does not rewrite the shaders of its pipelines",
     static_cast<VkStructureType>(1000134000), 2, HiddenExtension::Translated::NotBesideKhr},
};

} // namespace

const HiddenExtension *hiddenByEmulation(const char *name)
{
    const auto *found = std::find_if(std::begin(kHidden), std::end(kHidden),
                                     [name](const HiddenExtension &e) { return std::strcmp(e.name, name) == 0; });
    return found == std::end(kHidden) ? nullptr : found;
}

const HiddenExtension *hiddenByTranslation(const char *name)
{
    const HiddenExtension *hidden = hiddenByEmulation(name);
    return hidden && hidden->translated != HiddenExtension::Translated::Works ? hidden : nullptr;
}

void clearHiddenFeatures(VkPhysicalDeviceFeatures2 &features, const HiddenExtension *(*hidden)(const char *name))
{
    for (auto *s = static_cast<VkBaseOutStructure *>(features.pNext); s != nullptr; s = s->pNext) {
        for (const HiddenExtension &one : kHidden) {
            if (one.featureCount != 0 && s->sType == one.features && hidden(one.name))
                std::fill_n(reinterpret_cast<VkBool32 *>(s + 1), one.featureCount, VK_FALSE);
        }
    }
}

} // namespace vellum::layer
