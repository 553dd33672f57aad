#include "layer/shaders.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "layer/device.h"
#include "layer/pnext.h"
#include "layer/shader_binary.h"
#include "spirv/rewrite.h"

namespace vellum::layer
{
namespace
{

constexpr VkFlags64 kMicromapPipelineFlag =
    VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT | newer::kPipelineDisallowOpacityMicromap;

// A pipeline's pNext chain without the flags that only mean something to the layer; they promise what a pipeline meets,
// and the layer does not use them. Copies are kept in `chains`.
const void *driverChain(const void *pNext, std::deque<Chain> &chains)
{
    const auto *flags2 =
        findInChain<newer::PipelineCreateFlags2CreateInfo>(pNext, newer::kPipelineCreateFlags2CreateInfo);
    if (!flags2 || (flags2->flags & kMicromapPipelineFlag) == 0)
        return pNext;
    Chain &chain = chains.emplace_back(pNext);
    if (auto *edited = chain.edit<newer::PipelineCreateFlags2CreateInfo>(newer::kPipelineCreateFlags2CreateInfo))
        edited->flags &= ~kMicromapPipelineFlag;
    return chain.head();
}

void dump(const Device &device, uint32_t number, const char *suffix, std::span<const uint32_t> words)
{
    const std::string path = device.instance->settings.dumpShaders + "/" + std::to_string(number) + suffix;
    std::FILE *file = std::fopen(path.c_str(), "wb");
    if (!file || std::fwrite(words.data(), 4, words.size(), file) != words.size())
        device.report().warning("VELLUM-dump-shaders", "cannot write " + path);
    if (file)
        std::fclose(file);
}

// Rewrites one shader. `code` and `bytes` are replaced where it traces rays; `storage` then holds the words.
// Returns false, and reports, where it cannot be rewritten.
bool rewriteShader(const Device &device, const uint32_t *&code, size_t &bytes, std::vector<uint32_t> &storage)
{
    const std::span<const uint32_t> words(code, bytes / 4);
    if (!spirv::tracesRays(words))
        return true;
    spirv::RewriteResult result = spirv::rewrite(words, {device.root.address(), device.carriesRayFlagBits});
    static std::atomic<uint32_t> counter{0};
    const bool dumping = !device.instance->settings.dumpShaders.empty();
    const uint32_t number = dumping ? counter++ : 0;
    if (dumping)
        dump(device, number, ".before.spv", words);
    if (result.status == spirv::RewriteResult::Status::Failed) {
        device.report().error("VELLUM-shader-rewrite",
                              "a shader that traces rays cannot be rewritten: " + result.error);
        return false;
    }
    if (result.status == spirv::RewriteResult::Status::Unchanged)
        return true;
    storage = std::move(result.words);
    code = storage.data();
    bytes = storage.size() * 4;
    if (dumping)
        dump(device, number, ".after.spv", storage);
    return true;
}

// Pipeline stages with their inline shader modules rewritten (VkShaderModuleCreateInfo in a stage's pNext chain).
class DriverStages
{
public:
    explicit DriverStages(const Device &device) : device_(device) {}

    // Replaces `stages` where one of them has an inline module that traces rays.
    bool rewrite(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count)
    {
        if (!stages)
            return true;
        std::vector<VkPipelineShaderStageCreateInfo> own(stages, stages + count);
        bool changed = false;
        for (VkPipelineShaderStageCreateInfo &stage : own) {
            const auto *inlined =
                findInChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
            if (stage.module || !inlined || !spirv::tracesRays({inlined->pCode, inlined->codeSize / 4}))
                continue;
            auto *module = chains_.emplace_back(stage.pNext)
                               .edit<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
            if (!module) {
                device_.report().error("VELLUM-shader-rewrite",
                                       "an inline shader module lies behind a structure of unknown size");
                return false;
            }
            if (!rewriteShader(device_, module->pCode, module->codeSize, words_.emplace_back()))
                return false;
            stage.pNext = chains_.back().head();
            changed = true;
        }
        if (changed)
            stages = stages_.emplace_back(std::move(own)).data();
        changed_ = changed_ || changed;
        return true;
    }
    [[nodiscard]] bool changed() const { return changed_; }

private:
    const Device &device_;
    std::deque<std::vector<VkPipelineShaderStageCreateInfo>> stages_;
    std::deque<Chain> chains_;
    std::deque<std::vector<uint32_t>> words_;
    bool changed_ = false;
};

// pStages is ignored, and may be anything, for a pipeline library without the parts that have shaders.
bool hasShaderStages(const VkGraphicsPipelineCreateInfo &info)
{
    const auto *library = findInChain<VkGraphicsPipelineLibraryCreateInfoEXT>(
        info.pNext, VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_LIBRARY_CREATE_INFO_EXT);
    const VkGraphicsPipelineLibraryFlagsEXT withShaders =
        VK_GRAPHICS_PIPELINE_LIBRARY_PRE_RASTERIZATION_SHADERS_BIT_EXT |
        VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_SHADER_BIT_EXT;
    return !library || (library->flags & withShaders) != 0;
}

VkResult failAll(uint32_t count, VkPipeline *pipelines)
{
    for (uint32_t i = 0; i < count; ++i)
        pipelines[i] = VK_NULL_HANDLE;
    return VK_ERROR_INVALID_SHADER_NV;
}

} // namespace

VKAPI_ATTR VkResult VKAPI_CALL createShaderModule(VkDevice handle, const VkShaderModuleCreateInfo *info,
                                                  const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    Device &device = deviceOf(handle);
    VkShaderModuleCreateInfo driverInfo = *info;
    std::vector<uint32_t> storage;
    if (!rewriteShader(device, driverInfo.pCode, driverInfo.codeSize, storage))
        return VK_ERROR_INVALID_SHADER_NV;
    return device.next.CreateShaderModule(handle, &driverInfo, allocator, module);
}

VKAPI_ATTR VkResult VKAPI_CALL createComputePipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                      const VkComputePipelineCreateInfo *infos,
                                                      const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    Device &device = deviceOf(handle);
    DriverStages stages(device);
    std::deque<Chain> chains;
    std::vector<VkComputePipelineCreateInfo> own(infos, infos + count);
    for (VkComputePipelineCreateInfo &info : own) {
        info.pNext = driverChain(info.pNext, chains);
        const VkPipelineShaderStageCreateInfo *stage = &info.stage;
        if (!stages.rewrite(stage, 1))
            return failAll(count, pipelines);
        if (stage != &info.stage)
            info.stage = *stage;
    }
    return device.next.CreateComputePipelines(handle, cache, count, own.data(), allocator, pipelines);
}

VKAPI_ATTR VkResult VKAPI_CALL createGraphicsPipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                       const VkGraphicsPipelineCreateInfo *infos,
                                                       const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    Device &device = deviceOf(handle);
    DriverStages stages(device);
    std::deque<Chain> chains;
    std::vector<VkGraphicsPipelineCreateInfo> own(infos, infos + count);
    for (VkGraphicsPipelineCreateInfo &info : own) {
        info.pNext = driverChain(info.pNext, chains);
        if (hasShaderStages(info) && !stages.rewrite(info.pStages, info.stageCount))
            return failAll(count, pipelines);
    }
    return device.next.CreateGraphicsPipelines(handle, cache, count, own.data(), allocator, pipelines);
}

VKAPI_ATTR VkResult VKAPI_CALL createRayTracingPipelines(VkDevice handle, VkDeferredOperationKHR operation,
                                                         VkPipelineCache cache, uint32_t count,
                                                         const VkRayTracingPipelineCreateInfoKHR *infos,
                                                         const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    Device &device = deviceOf(handle);
    DriverStages stages(device);
    std::deque<Chain> chains;
    std::vector<VkRayTracingPipelineCreateInfoKHR> own(infos, infos + count);
    bool changed = false;
    for (VkRayTracingPipelineCreateInfoKHR &info : own) {
        changed = changed || (info.flags & kMicromapPipelineFlag) != 0;
        info.flags &= ~static_cast<VkPipelineCreateFlags>(kMicromapPipelineFlag);
        if (const void *chain = driverChain(info.pNext, chains); chain != info.pNext) {
            info.pNext = chain;
            changed = true;
        }
        if (!stages.rewrite(info.pStages, info.stageCount))
            return failAll(count, pipelines);
    }
    if (!changed && !stages.changed())
        return device.next.CreateRayTracingPipelinesKHR(handle, operation, cache, count, infos, allocator, pipelines);
    // What the driver still reads would have to outlive this call if it deferred the work. It is free not to.
    const VkResult result = device.next.CreateRayTracingPipelinesKHR(handle, VK_NULL_HANDLE, cache, count, own.data(),
                                                                     allocator, pipelines);
    return result == VK_SUCCESS && operation ? VK_OPERATION_NOT_DEFERRED_KHR : result;
}

VKAPI_ATTR VkResult VKAPI_CALL createShaders(VkDevice handle, uint32_t count, const newer::ShaderCreateInfo *infos,
                                             const VkAllocationCallbacks *allocator, newer::ShaderEXT *shaders)
{
    Device &device = deviceOf(handle);
    std::vector<newer::ShaderCreateInfo> own(infos, infos + count);
    std::deque<std::vector<uint32_t>> storage;
    for (newer::ShaderCreateInfo &info : own) {
        if (info.codeType == newer::kShaderCodeTypeBinary) {
            const ShaderBinaryHeader header = shaderBinaryHeader(device);
            if (info.codeSize < sizeof header || std::memcmp(info.pCode, &header, sizeof header) != 0) {
                std::fill_n(shaders, count, nullptr);
                return newer::kIncompatibleShaderBinary;
            }
            info.pCode = static_cast<const std::byte *>(info.pCode) + sizeof header;
            info.codeSize -= sizeof header;
            continue;
        }
        const auto *code = static_cast<const uint32_t *>(info.pCode);
        if (!rewriteShader(device, code, info.codeSize, storage.emplace_back())) {
            std::fill_n(shaders, count, nullptr);
            return VK_ERROR_INITIALIZATION_FAILED; // of the errors of vkCreateShadersEXT the one about the code
        }
        info.pCode = code;
    }
    return device.next.CreateShadersEXT(handle, count, own.data(), allocator, shaders);
}

} // namespace vellum::layer
