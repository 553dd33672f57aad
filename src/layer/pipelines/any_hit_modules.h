// The layer's own any-hit shaders, for hit groups that have none.
#pragma once

#include <map>
#include <mutex>

#include "layer/memory/gpu_memory.h"
#include "spirv/rewrite.h"

namespace vellum::layer
{

// Each is made when it is needed first.
class AnyHitModules
{
public:
    void create(const GpuContext &context) { context_ = context; }
    ~AnyHitModules();
    // VK_NULL_HANDLE where the driver could not make it.
    VkShaderModule get(spirv::Prologue prologue, spirv::HiddenFlags hidden, const spirv::RewriteOptions &options);

private:
    GpuContext context_;
    std::mutex mutex_;
    std::map<std::pair<spirv::Prologue, spirv::HiddenFlags>, VkShaderModule> modules_;
};

} // namespace vellum::layer
