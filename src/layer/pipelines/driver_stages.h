// SPDX-License-Identifier: Apache-2.0
// Shaders and pipeline stages as the driver gets them: rewritten so that they resolve micromaps; on a driver with
// VK_EXT_opacity_micromap only, with SPV_EXT_opacity_micromap in place of SPV_KHR_opacity_micromap; on a driver with
// VK_KHR_opacity_micromap, with the execution mode OpacityMicromapIdKHR if the setting assume_micromaps is on.
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"
#include "spirv/rewrite.h"

namespace vellum::layer
{

struct DevicePipelines;

using SharedWords = std::shared_ptr<const std::vector<uint32_t>>;

spirv::RewriteOptions rewriteOptions(DevicePipelines &device,
                                     std::optional<spirv::PipelineStage> pipelineStage = std::nullopt);

// Replaces `code` and `bytes` by what the driver gets, if that differs; `storage` then holds the words. Returns false
// and reports an error if the shader cannot be rewritten.
bool rewriteShader(DevicePipelines &device, const uint32_t *&code, size_t &bytes, SharedWords &storage,
                   std::optional<spirv::PipelineStage> pipelineStage = std::nullopt);

// Stages with rewritten inline shader modules (VkShaderModuleCreateInfo in a stage's pNext chain). Other modules are
// rewritten when they are created. The driver's structures live as long as this object.
class DriverStages
{
public:
    explicit DriverStages(DevicePipelines &device) : device_(device) {}

    // Replaces `stages` if one of them has an inline module that changes.
    bool rewrite(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count);
    // Rewrites one stage's inline module; sets `changed` if that changes it.
    bool rewriteInline(VkPipelineShaderStageCreateInfo &stage, bool &changed,
                       std::optional<spirv::PipelineStage> pipelineStage = std::nullopt);
    [[nodiscard]] bool changed() const { return changed_; }

private:
    DevicePipelines &device_;
    std::deque<std::vector<VkPipelineShaderStageCreateInfo>> stages_;
    std::deque<Chain> chains_;
    std::deque<SharedWords> words_;
    bool changed_ = false;
};

} // namespace vellum::layer
