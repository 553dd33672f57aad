// SPDX-License-Identifier: Apache-2.0
// Identifiers of shader modules (VK_EXT_shader_module_identifier), which applications store from run to run to create
// pipelines from the driver's cache. Rewritten code holds addresses of the layer's tables, and the cache may contain
// pipelines that were created without the layer. The application therefore gets the driver's identifier mixed with a
// mask: that of the layer, or, for rewritten code, that of the device's tables. The driver does not know an identifier
// from anywhere else, and returns VK_PIPELINE_COMPILE_REQUIRED.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DevicePipelines;

using Mask = std::array<uint8_t, VK_MAX_SHADER_MODULE_IDENTIFIER_SIZE_EXT>;
// A mask that depends on all of the bytes.
Mask maskOf(std::span<const std::byte> bytes);
// Settings that change rewritten shaders or pipelines.
uint64_t rewriteSettings(const DevicePipelines &device);
// A mask that depends on all that rewritten code depends on.
Mask deviceMask(DevicePipelines &device);
// The mask for modules that trace rays: that of the device, or, where no micromaps are emulated and the driver gets
// their code unchanged, a constant.
Mask tracingMask(DevicePipelines &device);
// Mixing twice restores the bytes.
void mix(uint8_t *bytes, uint32_t count, const Mask &mask);

// Distinguishes the layer's identifier algorithm from the driver's: mixed with shaderModuleIdentifierAlgorithmUUID.
extern const std::array<uint8_t, VK_UUID_SIZE> kIdentifierUuid;

// Identifiers of modules that are known to trace rays: those that this device returned, and those that the driver
// accepted as such.
class TracingIdentifiers
{
public:
    void add(std::span<const uint8_t> identifier);
    [[nodiscard]] bool contains(const VkPipelineShaderStageModuleIdentifierCreateInfoEXT &identifier) const;

private:
    mutable std::mutex mutex_;
    std::set<std::string> known_;
};

// Stages of a pipeline with the driver's identifiers in place of the application's. An identifier that the application
// has stored in another run may or may not be that of a rewritten module. With such identifiers there are several
// variants of the stages, one for each combination.
class DriverIdentifiers
{
public:
    explicit DriverIdentifiers(DevicePipelines &device) : device_(device) {}
    DriverIdentifiers(const DriverIdentifiers &) = delete;
    DriverIdentifiers &operator=(const DriverIdentifiers &) = delete;

    // Replaces `stages` if one of them has an identifier and no code. `tracing`: all modules trace rays, as in ray
    // tracing pipelines. The stages are those of variant 0, in which no unknown module traces rays.
    void replace(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count, bool tracing = false);
    [[nodiscard]] bool any() const { return hidden_ || !bytes_.empty(); }
    // 0 if an identifier is behind a structure of unknown size, where it cannot be replaced.
    [[nodiscard]] uint32_t variants() const { return hidden_ ? 0 : 1u << unknown_.size(); }
    // Calls `use` for one variant after the other until the driver knows its identifiers, and returns the last result;
    // VK_PIPELINE_COMPILE_REQUIRED if there are no variants.
    template <typename Use>
    VkResult useUntilKnown(Use use)
    {
        VkResult result = VK_PIPELINE_COMPILE_REQUIRED;
        for (uint32_t variant = 0; variant < variants() &&
                                   (result == VK_PIPELINE_COMPILE_REQUIRED || result == VK_PIPELINE_BINARY_MISSING_KHR);
             ++variant) {
            choose(variant);
            result = use();
            if (result == VK_SUCCESS || result == VK_INCOMPLETE)
                remember(variant);
        }
        return result;
    }

private:
    // Writes the identifiers of a variant.
    void choose(uint32_t variant);
    // Adds the identifiers of a variant that the driver accepted to the known ones, for later pipelines and their keys.
    void remember(uint32_t variant) noexcept;
    struct Unknown {
        std::vector<uint8_t> *driver;
        std::vector<uint8_t> application;
    };
    DevicePipelines &device_;
    std::vector<VkPipelineShaderStageCreateInfo> stages_;
    std::deque<Chain> chains_;
    std::deque<std::vector<uint8_t>> bytes_;
    std::vector<Unknown> unknown_; // identifiers that may or may not be of rewritten modules
    bool hidden_ = false;          // an identifier is behind a structure of unknown size
};

} // namespace vellum::layer
