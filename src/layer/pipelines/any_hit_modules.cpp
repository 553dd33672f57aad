// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/any_hit_modules.h"

#include "layer/base/undo.h"
#include "shaders/any_hit.h"
#include "spirv/module/opcodes.h"

namespace vellum::layer
{

using spirv::Prologue;

AnyHitModules::~AnyHitModules()
{
    for (const auto &[key, module] : modules_)
        context_.next->DestroyShaderModule(context_.device, module, nullptr);
}

VkShaderModule AnyHitModules::get(Prologue prologue, spirv::HiddenFlags hidden, const spirv::RewriteOptions &options)
{
    const std::pair key(prologue, hidden);
    {
        std::lock_guard lock(mutex_);
        if (const auto known = modules_.find(key); known != modules_.end())
            return known->second;
    }
    // Without the lock, so that threads can rewrite different shaders at the same time.
    spirv::RewriteOptions forStage = options;
    forStage.pipelineStage = spirv::PipelineStage{"main", spv::ExecutionModelAnyHitKHR, prologue, hidden};
    const spirv::RewriteResult result = spirv::rewrite(any_hit, forStage);
    VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    info.codeSize = result.words.size() * 4;
    info.pCode = result.words.data();
    VkShaderModule module = VK_NULL_HANDLE;
    if (result.status != spirv::RewriteResult::Status::Rewritten ||
        context_.next->CreateShaderModule(context_.device, &info, nullptr, &module) != VK_SUCCESS)
        return VK_NULL_HANDLE;
    Undo undo([&] { context_.next->DestroyShaderModule(context_.device, module, nullptr); });
    std::lock_guard lock(mutex_);
    const auto [entry, isNew] = modules_.emplace(key, module);
    if (isNew) // not if another thread has added it meanwhile
        undo.keep();
    return entry->second;
}

} // namespace vellum::layer
