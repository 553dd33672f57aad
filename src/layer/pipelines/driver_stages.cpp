// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/driver_stages.h"

#include <atomic>
#include <fstream>
#include <span>
#include <string>

#include "core/utf8_path.h"
#include "layer/input/checked.h"
#include "layer/input/creations.h"
#include "layer/pipelines/device_pipelines.h"
#include "spirv/module/khr_to_ext.h"
#include "spirv/module/micromap_mode.h"

namespace vellum::layer
{
namespace
{

void dump(const DevicePipelines &device, uint32_t number, const char *suffix, std::span<const uint32_t> words)
{
    const std::string path = device.driver.settings->dumpShaders + "/" + std::to_string(number) + suffix;
    std::ofstream file(utf8Path(path), std::ios::binary);
    file.write(reinterpret_cast<const char *>(words.data()), static_cast<std::streamsize>(words.size_bytes()));
    if (!file.flush())
        device.driver.report().warning("VELLUM-dump-shaders", "cannot write " + path);
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

// The application's code: `words`, or what validation has made them of.
std::span<const uint32_t> originalOf(std::span<const uint32_t> words)
{
    return input::Checked<input::OriginalCode>::take(words.data(), [words] { return input::OriginalCode{words}; })
        .words;
}

// Sends a warning about a shader, once for the same code.
void warnOnce(DevicePipelines &device, std::span<const uint32_t> words, const char *id, const std::string &text)
{
    if (device.shaderWarnings.isFirst(id, ShaderWarnings::hashOf(originalOf(words))))
        device.driver.report().warning(id, text);
}

// Ray queries of KHR without the execution mode are harmless if they meet no micromaps. Some applications forget it,
// such as the Vulkan tutorial's engine. The shader has no handle yet: its entry points and size tell which it is.
void warnOfQueries(DevicePipelines &device, std::span<const uint32_t> words, const char *consequence)
{
    constexpr const char *kId = "VELLUM-queries-without-micromaps";
    const std::span<const uint32_t> original = originalOf(words);
    if (!device.shaderWarnings.isFirst(kId, ShaderWarnings::hashOf(original)))
        return;
    std::string error, names;
    for (const spirv::EntryPoint &entry :
         spirv::readEntryPoints(original, error).value_or(std::vector<spirv::EntryPoint>{}))
        if (entry.queries && entry.mode.when == spirv::MicromapMode::When::Absent)
            names += entry.name + ", ";
    device.objects.warnings.warn(kId, "a shader (" + names + std::to_string(original.size_bytes()) +
                                          " bytes of SPIR-V) has ray queries and no execution mode "
                                          "OpacityMicromapIdKHR: " +
                                          consequence);
}

// Words that belong to a result.
template <typename Result>
SharedWords wordsOf(std::shared_ptr<Result> result)
{
    return result->words.empty() ? nullptr : SharedWords(result, &result->words);
}

// SPIR-V in which every ray query uses micromaps, for a driver that has VK_KHR_opacity_micromap. Null: unchanged.
SharedWords assumeMicromaps(DevicePipelines &device, std::span<const uint32_t> words)
{
    const EnabledFeatures &enabled = device.driver.enabled;
    if (!device.driver.assumesMicromaps() || enabled.everyQueryUsesMicromaps() || !spirv::scan(words).tracesRays)
        return {};
    auto result =
        std::make_shared<spirv::ModeResult>(spirv::editMicromapMode(words, {.to = spirv::ModeEdit::To::Always}));
    if (!result->error.empty())
        warnOnce(device, words, "VELLUM-assume-micromaps",
                 "a shader's ray queries cannot be given the execution mode OpacityMicromapIdKHR: " + result->error);
    return wordsOf(std::move(result));
}

// SPIR-V for a driver that has SPV_EXT_opacity_micromap only. Null: unchanged.
SharedWords translateShader(DevicePipelines &device, std::span<const uint32_t> words)
{
    auto result = std::make_shared<spirv::TranslateResult>(spirv::translateToExt(words));
    const Driver &driver = device.driver;
    if (result->queriesForget && driver.enabled.khrFeature && !driver.enabled.ext && !driver.assumesMicromaps())
        warnOfQueries(device, words,
                      "on this device, whose driver has VK_EXT_opacity_micromap, they use micromaps nevertheless; on "
                      "others, every hit on geometry with micromaps is non-opaque");
    return wordsOf(std::move(result));
}

// SPIR-V that resolves micromaps itself. Null: unchanged. Nothing if it cannot be rewritten, after a message.
std::optional<SharedWords> emulateMicromaps(DevicePipelines &device, std::span<const uint32_t> words,
                                            const std::optional<spirv::PipelineStage> &pipelineStage)
{
    const auto known = device.rewriteCache.rewrite(words, rewriteOptions(device, pipelineStage));
    const spirv::RewriteResult &result = *known;
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
        return {};
    }
    if (result.queriesForget && device.driver.enabled.khrFeature)
        warnOfQueries(device, words,
                      "where they meet micromaps, every hit on their geometry is non-opaque. Give it the mode (vellum "
                      "spirv --enable-micromaps), or let all ray queries use them by the setting assume_micromaps "
                      "(--assume-micromaps of vellum run)");
    if (result.lacksHiddenFlags)
        warnOnce(device, words, "VELLUM-intersection-ray-flags",
                 "an intersection shader reads the ray flags: it does not see Opaque, CullNoOpaque and "
                 "ForceOpacityMicromap2State, which travel in ray payloads where not all rays have them alike");
    return wordsOf(known);
}

} // namespace

bool rewriteShader(DevicePipelines &device, const uint32_t *&code, size_t &bytes, SharedWords &storage,
                   std::optional<spirv::PipelineStage> pipelineStage)
{
    const std::span<const uint32_t> words(code, bytes / 4);
    std::optional<SharedWords> result;
    if (device.driver.emulated())
        result = emulateMicromaps(device, words, pipelineStage);
    else if (device.driver.translated())
        result = translateShader(device, words);
    else
        result = assumeMicromaps(device, words);
    if (!result || !*result)
        return result.has_value();
    storage = std::move(*result);
    code = storage->data();
    bytes = storage->size() * 4;
    return true;
}

bool DriverStages::rewrite(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count)
{
    if (!stages || count == 0)
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
    if (stage.module || !inlined)
        return true;
    const uint32_t *code = inlined->pCode;
    size_t bytes = inlined->codeSize;
    SharedWords words;
    if (!rewriteShader(device_, code, bytes, words, pipelineStage))
        return false;
    if (!words)
        return true;
    Chain &chain = chains_.emplace_back(stage.pNext);
    auto *module = chain.edit<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    if (!module) {
        device_.driver.report().error("VELLUM-shader-rewrite",
                                      "an inline shader module is behind a structure of unknown size");
        return false;
    }
    module->pCode = words_.emplace_back(std::move(words))->data();
    module->codeSize = bytes;
    stage.pNext = chain.head();
    changed = true;
    return true;
}

} // namespace vellum::layer
