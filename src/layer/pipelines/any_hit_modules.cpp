#include "layer/pipelines/any_hit_modules.h"

#include "shaders/any_hit.h"
#include "spirv/module/opcodes.h"

namespace vellum::layer
{

using spirv::Decides;

AnyHitModules::~AnyHitModules()
{
    for (const auto &[key, module] : modules_) {
        if (module)
            context_.next->DestroyShaderModule(context_.device, module, nullptr);
    }
}

VkShaderModule AnyHitModules::get(Decides decides, spirv::HiddenFlags hidden, const spirv::RewriteOptions &options)
{
    std::lock_guard lock(mutex_);
    VkShaderModule &module = modules_[{decides, hidden}];
    if (module)
        return module;
    spirv::RewriteOptions forStage = options;
    forStage.pipelineStage = spirv::PipelineStage{"main", spv::ExecutionModelAnyHitKHR, decides, hidden};
    const spirv::RewriteResult result = spirv::rewrite(any_hit, forStage);
    VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    info.codeSize = result.words.size() * 4;
    info.pCode = result.words.data();
    if (result.status != spirv::RewriteResult::Status::Rewritten ||
        context_.next->CreateShaderModule(context_.device, &info, nullptr, &module) != VK_SUCCESS)
        module = VK_NULL_HANDLE;
    return module;
}

} // namespace vellum::layer
