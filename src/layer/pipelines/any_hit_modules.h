// SPDX-License-Identifier: Apache-2.0
// Modules of the layer's any-hit shaders, for hit groups without one.
#pragma once

#include <map>
#include <mutex>

#include "layer/memory/gpu_memory.h"
#include "spirv/rewrite.h"

namespace vellum::layer
{

// Each module is created when it is first needed.
class AnyHitModules
{
public:
    void create(const GpuContext &context) { context_ = context; }
    ~AnyHitModules();
    // VK_NULL_HANDLE if the driver could not create it.
    VkShaderModule get(spirv::Prologue prologue, spirv::HiddenFlags hidden, const spirv::RewriteOptions &options);

private:
    GpuContext context_;
    std::mutex mutex_;
    std::map<std::pair<spirv::Prologue, spirv::HiddenFlags>, VkShaderModule> modules_;
};

} // namespace vellum::layer
