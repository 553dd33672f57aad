// Pipeline stages as the driver is to see them: shaders that trace rays are rewritten on their way to it.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"
#include "spirv/rewrite.h"

namespace vellum::layer
{

struct DevicePipelines;

spirv::RewriteOptions rewriteOptions(DevicePipelines &device,
                                     std::optional<spirv::PipelineStage> pipelineStage = std::nullopt);

// Rewrites one shader. `code` and `bytes` are replaced where it traces rays; `storage` then holds the words.
// Returns false, and reports, where it cannot be rewritten.
bool rewriteShader(DevicePipelines &device, const uint32_t *&code, size_t &bytes, std::vector<uint32_t> &storage,
                   std::optional<spirv::PipelineStage> pipelineStage = std::nullopt);

// Stages with their inline shader modules rewritten (VkShaderModuleCreateInfo in a stage's pNext chain). Modules are
// rewritten when they are created. What the driver gets lives as long as this object.
class DriverStages
{
public:
    explicit DriverStages(DevicePipelines &device) : device_(device) {}

    // Replaces `stages` where one of them has an inline module that traces rays.
    bool rewrite(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count);
    // Rewrites one stage's inline module, and says in `changed` whether there was one to be rewritten.
    bool rewriteInline(VkPipelineShaderStageCreateInfo &stage, bool &changed,
                       std::optional<spirv::PipelineStage> pipelineStage = std::nullopt);
    [[nodiscard]] bool changed() const { return changed_; }

private:
    DevicePipelines &device_;
    std::deque<std::vector<VkPipelineShaderStageCreateInfo>> stages_;
    std::deque<Chain> chains_;
    std::deque<std::vector<uint32_t>> words_;
    bool changed_ = false;
};

} // namespace vellum::layer
