#include "layer/pipelines/driver_stages.h"

#include <atomic>
#include <cstdio>
#include <span>
#include <string>

#include "layer/pipelines/device_pipelines.h"

namespace vellum::layer
{
namespace
{

void dump(const DevicePipelines &device, uint32_t number, const char *suffix, std::span<const uint32_t> words)
{
    const std::string path = device.driver.settings->dumpShaders + "/" + std::to_string(number) + suffix;
    std::FILE *file = std::fopen(path.c_str(), "wb");
    if (!file || std::fwrite(words.data(), 4, words.size(), file) != words.size())
        device.driver.report().warning("VELLUM-dump-shaders", "cannot write " + path);
    if (file)
        std::fclose(file);
}

} // namespace

spirv::RewriteOptions rewriteOptions(DevicePipelines &device, std::optional<spirv::PipelineStage> pipelineStage)
{
    return {.rootAddress = device.objects.root.address(),
            .firstSlots = device.objects.root.firstSlots(),
            .queriesConsume = device.driver.enabled.everyQueryUsesMicromaps() || device.driver.settings->assumeMicromaps
                                  ? spirv::QueriesConsume::Always
                                  : spirv::QueriesConsume::WhereDeclared,
            .constantQueryFlags = device.driver.settings->constantRayFlags,
            .pipelineStage = pipelineStage};
}

namespace
{

// Warnings about a shader that was rewritten.
void warnOf(DevicePipelines &device, const spirv::RewriteResult &result, std::span<const uint32_t> words)
{
    const auto warn = [&](bool applies, const char *id, const char *text) {
        if (applies && device.shaderWarnings.isFirst(id, codeHash(words)))
            device.driver.report().warning(id, text);
    };
    // Harmless where they meet no micromaps. Applications forget it all the same, like the Vulkan tutorial's engine.
    warn(result.queriesForget && device.driver.enabled.khrFeature, "VELLUM-queries-without-micromaps",
         "a shader has ray queries and no execution mode OpacityMicromapIdKHR: where they meet micromaps, every hit on "
         "their geometry is non-opaque. The setting assume_micromaps lets all ray queries use them");
    warn(result.lacksHiddenFlags, "VELLUM-intersection-ray-flags",
         "an intersection shader reads the ray flags: it does not see Opaque, CullNoOpaque and "
         "ForceOpacityMicromap2State, which travel in ray payloads where not all rays have them alike");
}

} // namespace

bool rewriteShader(DevicePipelines &device, const uint32_t *&code, size_t &bytes, std::vector<uint32_t> &storage,
                   std::optional<spirv::PipelineStage> pipelineStage)
{
    const std::span<const uint32_t> words(code, bytes / 4);
    spirv::RewriteResult result = spirv::rewrite(words, rewriteOptions(device, pipelineStage));
    if (!device.driver.settings->dumpShaders.empty() && result.status != spirv::RewriteResult::Status::Unchanged) {
        static std::atomic<uint32_t> counter{0};
        const uint32_t number = counter++;
        dump(device, number, ".before.spv", words);
        if (result.status == spirv::RewriteResult::Status::Rewritten)
            dump(device, number, ".after.spv", result.words);
    }
    if (result.status == spirv::RewriteResult::Status::Failed) {
        device.driver.report().error("VELLUM-shader-rewrite",
                                     "a shader that traces rays cannot be rewritten: " + result.error);
        return false;
    }
    warnOf(device, result, words);
    if (result.status == spirv::RewriteResult::Status::Unchanged)
        return true;
    storage = std::move(result.words);
    code = storage.data();
    bytes = storage.size() * 4;
    return true;
}

bool DriverStages::rewrite(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count)
{
    if (!stages)
        return true;
    std::vector<VkPipelineShaderStageCreateInfo> own(stages, stages + count);
    bool changed = false;
    for (VkPipelineShaderStageCreateInfo &stage : own) {
        if (!rewriteInline(stage, changed))
            return false;
    }
    if (changed)
        stages = stages_.emplace_back(std::move(own)).data();
    changed_ = changed_ || changed;
    return true;
}

bool DriverStages::rewriteInline(VkPipelineShaderStageCreateInfo &stage, bool &changed,
                                 std::optional<spirv::PipelineStage> pipelineStage)
{
    const auto *inlined =
        findInChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    if (stage.module || !inlined ||
        (!pipelineStage && !spirv::scan({inlined->pCode, inlined->codeSize / 4}).tracesRays))
        return true;
    auto *module =
        chains_.emplace_back(stage.pNext).edit<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    if (!module) {
        device_.driver.report().error("VELLUM-shader-rewrite",
                                      "an inline shader module lies behind a structure of unknown size");
        return false;
    }
    if (!rewriteShader(device_, module->pCode, module->codeSize, words_.emplace_back(), pipelineStage))
        return false;
    stage.pNext = chains_.back().head();
    changed = true;
    return true;
}

} // namespace vellum::layer
