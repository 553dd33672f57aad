// SPDX-License-Identifier: Apache-2.0
#include "layer/state/device_state.h"

#include <algorithm>

#include "core/records.h"
#include "layer/rules/ids.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

struct GpuError {
    const char *id;
    const char *text;
};

// In the order of kGpuError*.
constexpr GpuError kGpuErrorTexts[kGpuErrors] = {
    {rules::ids::kCompatible,
     "vkCmdCopyMemoryToAccelerationStructureKHR: the data comes from another driver, from another version of the "
     "layer, or from a device without the layer. The structure has no geometry now"},
    {rules::ids::kDamaged,
     "vkCmdCopyMemoryToAccelerationStructureKHR: the memory does not hold serialized data, or not all of it, or it was "
     "changed. The structure has no geometry now"},
    {"VELLUM-serialized-type",
     "vkCmdCopyMemoryToAccelerationStructureKHR: top-level data for a bottom-level structure, or the other way round. "
     "The structure has no geometry now"},
    {rules::ids::kDeserializedSize,
     "vkCmdCopyMemoryToAccelerationStructureKHR: dst is smaller than the deserialized size. It has no geometry now"},
    {rules::ids::kSerializedSize,
     "vkCmdCopyAccelerationStructureToMemoryKHR: the buffer ends before the serialized data does. Nothing was written"},
    {"VELLUM-copy-reference",
     "a copied or deserialized top-level structure names a bottom-level structure that does not exist; such instances "
     "are inactive"},
    {"VELLUM-copy-unbuilt-reference", "a top-level structure was copied or deserialized before the bottom-level "
                                      "structures were built that it names; such instances are inactive"},
    {rules::ids::kCompactedSize,
     "vkCmdCopyAccelerationStructureKHR: dst is too small for the copy, and has no geometry now"},
    {rules::ids::kDeserializedMicromaps,
     "vkCmdCopyMemoryToAccelerationStructureKHR: the data names a micromap that does not exist, or is smaller than the "
     "one that was serialized. Its geometry has no micromap now"},
    {"VELLUM-micromap-copy-size",
     "a micromap was copied, serialized or deserialized to memory that is too small for it. A micromap that was the "
     "target is empty now"},
    {"VELLUM-micromap-not-constructed", "a micromap was copied or serialized before it was built"},
    {"VELLUM-micromap-serialized",
     "a micromap was deserialized from memory that does not hold a serialized micromap of "
     "this version of the layer, or not all of it. It is empty now"},
    {"VELLUM-micromap-copy-overlap",
     "a micromap was to be copied to where it would overlap its source. The target is as it was"},
    {rules::ids::kReference, "vkCmdBuildAccelerationStructuresKHR: an instance references no bottom-level structure; "
                             "such instances are inactive"},
    {rules::ids::kReference, "vkCmdBuildAccelerationStructuresIndirectKHR: an instance references no "
                             "bottom-level structure; such instances are inactive"},
};

} // namespace

bool DeviceState::own(VkObjectType type, uint64_t handle) const
{
    if (type != VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR)
        return type == VK_OBJECT_TYPE_MICROMAP_EXT && driver.emulated();
    const auto structure = accelerationStructures.get(reinterpret_cast<VkAccelerationStructureKHR>(handle));
    return structure && isLayerObject(*structure);
}

void reportGpuErrors(DeviceState &device)
{
    if (!device.validationReportsGpuErrors)
        reportGpuErrors(device, 0);
}

void reportGpuErrors(DeviceState &device, uint32_t known)
{
    if (!device.root.countsGpuErrors())
        return;
    const uint32_t bits = device.root.takeGpuErrors() & ~known;
    for (uint32_t i = 0; bits != 0 && i < kGpuErrors; ++i) {
        if ((bits >> i & 1u) != 0)
            device.driver.report().error(rules::ids::idAt(kGpuErrorTexts[i].text, kGpuErrorTexts[i].id),
                                         kGpuErrorTexts[i].text);
    }
}

void MicromapWarnings::warn(const char *id, const std::string &text)
{
    {
        std::lock_guard lock(mutex_);
        // If EXT is the driver's, the application uses its micromaps without the layer.
        if (!used_ && !(driver_.translated() && driver_.enabled.ext)) {
            // One more than the limit is enough for the message about the limit.
            const uint32_t limit = driver_.settings->messageLimit;
            const auto isSame = [id](const auto &kept) { return kept.first == id; };
            if (limit == 0 || std::ranges::count_if(kept_, isSame) <= std::ptrdiff_t{limit})
                kept_.emplace_back(id, text);
            return;
        }
    }
    driver_.report().warning(id, text);
}

void MicromapWarnings::micromapsAreUsed()
{
    if (used_.load(std::memory_order_relaxed))
        return;
    std::vector<std::pair<const char *, std::string>> kept;
    {
        std::lock_guard lock(mutex_);
        used_ = true;
        kept.swap(kept_);
    }
    for (const auto &[id, text] : kept)
        driver_.report().warning(id, text);
}

} // namespace vellum::layer
