#include <algorithm>
#include <deque>
#include <span>
#include <vector>

#include "layer/khr_over_ext/device_khr_over_ext.h"
#include "layer/khr_over_ext/shader_translation.h"
#include "layer/pipelines/pipeline_binaries.h"
#include "layer/pipelines/pipeline_flags.h"
#include "layer/pipelines/shaders.h"
#include "spirv/module/khr_to_ext.h"
#include "spirv/rewrite.h"

namespace vellum::layer
{
namespace
{

constexpr VkFlags64 kUsesMicromaps = VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT;

// SPIR-V as a driver takes it that knows SPV_EXT_opacity_micromap only. `code` and `bytes` are replaced where something
// changes; `storage` then holds the words.
void translateShader(DeviceKhrOverExt &device, const uint32_t *&code, size_t &bytes, std::vector<uint32_t> &storage)
{
    constexpr const char *kForgetful = "VELLUM-queries-without-micromaps";
    const std::span<const uint32_t> words(code, bytes / 4);
    spirv::TranslateResult result = spirv::translateToExt(words);
    if (result.queriesForget && device.driver.enabled.khrFeature && !device.driver.enabled.ext &&
        device.pipelines.shaderWarnings.isFirst(kForgetful, codeHash(words)))
        device.driver.report().warning(
            kForgetful,
            "a shader has ray queries and no execution mode OpacityMicromapIdKHR: on this device, whose driver has "
            "VK_EXT_opacity_micromap, they use micromaps all the same; on others, every hit on geometry with micromaps "
            "is non-opaque");
    if (result.words.empty())
        return;
    storage = std::move(result.words);
    code = storage.data();
    bytes = storage.size() * 4;
}

// What creation of pipelines is given in place of what the application gave. It must live until a deferred operation is
// complete.
class DriverInfos final : public DeferredWork
{
public:
    explicit DriverInfos(DeviceKhrOverExt &device) : device_(device) {}
    void finish() noexcept override {}

    // False: it cannot be, and that is told.
    bool translate(VkComputePipelineCreateInfo &info) { return setFlags(info) && translateStage(info.stage); }
    bool translate(VkGraphicsPipelineCreateInfo &info)
    {
        return setFlags(info) && (!hasShaderStages(info) || translateStages(info.pStages, info.stageCount));
    }
    bool translate(VkRayTracingPipelineCreateInfoKHR &info)
    {
        const bool assumes = device_.driver.enabled.khrFeature && device_.driver.settings->assumeMicromaps;
        return setFlags(info, assumes ? kUsesMicromaps : 0) && translateStages(info.pStages, info.stageCount);
    }
    std::vector<VkRayTracingPipelineCreateInfoKHR> rayTracing;

private:
    // Inline modules (VkShaderModuleCreateInfo in a stage's pNext chain).
    bool translateStage(VkPipelineShaderStageCreateInfo &stage)
    {
        if (stage.module || !findInChain(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO))
            return true;
        Chain &chain = chains_.emplace_back(stage.pNext);
        auto *module = chain.edit<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
        if (!module) {
            device_.driver.report().error("VELLUM-shader-rewrite",
                                          "an inline shader module lies behind a structure of unknown size");
            return false;
        }
        translateShader(device_, module->pCode, module->codeSize, words_.emplace_back());
        stage.pNext = chain.head();
        return true;
    }
    bool translateStages(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count)
    {
        if (!stages || count == 0)
            return true;
        auto &own = stages_.emplace_back(stages, stages + count);
        stages = own.data();
        return std::ranges::all_of(own,
                                   [this](VkPipelineShaderStageCreateInfo &stage) { return translateStage(stage); });
    }
    // Takes out the flags that a driver with VK_EXT_opacity_micromap does not know, and adds some. That of ray tracing
    // pipelines is EXT's own.
    template <typename Info>
    bool setFlags(Info &info, VkFlags64 added = 0)
    {
        const auto *flags2 =
            findInChain<newer::PipelineCreateFlags2CreateInfo>(info.pNext, newer::kPipelineCreateFlags2CreateInfo);
        if (!flags2) {
            info.flags |= static_cast<VkPipelineCreateFlags>(added);
            return true;
        }
        VkFlags64 unknown = VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;
        if (!device_.driver.enabled.pipelineMicromaps)
            unknown |= newer::kPipelineDisallowOpacityMicromap;
        const VkFlags64 flags = (flags2->flags & ~unknown) | added;
        if (flags == flags2->flags)
            return true;
        Chain &chain = chains_.emplace_back(info.pNext);
        auto *own = chain.edit<newer::PipelineCreateFlags2CreateInfo>(newer::kPipelineCreateFlags2CreateInfo);
        if (!own) {
            device_.driver.report().error("VELLUM-pipeline-flags",
                                          "VkPipelineCreateFlags2CreateInfo, whose flags the driver must not get as "
                                          "they are, lies behind a structure of unknown size");
            return false;
        }
        own->flags = flags;
        info.pNext = chain.head();
        return true;
    }

    DeviceKhrOverExt &device_;
    std::deque<Chain> chains_;
    std::deque<std::vector<uint32_t>> words_;
    std::deque<std::vector<VkPipelineShaderStageCreateInfo>> stages_;
};

// codeHash of a stage's code, if that traces rays; else 0.
uint64_t tracingCode(const DeviceKhrOverExt &device, const VkPipelineShaderStageCreateInfo &stage)
{
    const auto *inlined =
        findInChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    if (stage.module || !inlined)
        return device.tracingModules.get(stage.module);
    const std::span<const uint32_t> words(inlined->pCode, inlined->codeSize / 4);
    return spirv::scan(words).traced.traces ? codeHash(words) : 0;
}

void warnOfTracing(DeviceKhrOverExt &device, const VkRayTracingPipelineCreateInfoKHR &info)
{
    constexpr const char *kId = "VELLUM-pipeline-without-micromaps";
    bool isFirst = false;
    for (const VkPipelineShaderStageCreateInfo &stage : std::span(info.pStages, info.stageCount)) {
        const uint64_t code = tracingCode(device, stage);
        isFirst = (code != 0 && device.pipelines.shaderWarnings.isFirst(kId, code)) || isFirst;
    }
    if (isFirst)
        device.driver.report().warning(
            kId, "vkCreateRayTracingPipelinesKHR: a pipeline traces rays and was created without "
                 "RAY_TRACING_OPACITY_MICROMAP: they must meet no micromaps. The setting assume_micromaps creates all "
                 "pipelines with it");
}

bool mayHaveRayTracingFlags(DeviceKhrOverExt &device, const VkRayTracingPipelineCreateInfoKHR &info)
{
    const Driver &driver = device.driver;
    const VkFlags64 flags = pipelineFlags(info.pNext, info.flags);
    const bool uses = (flags & kUsesMicromaps) != 0;
    const bool available = driver.enabled.khrFeature || driver.enabled.extFeature;
    if (uses && !available &&
        !driver.report().tolerates("VELLUM-VUID-VkRayTracingPipelineCreateInfoKHR-flags-11597",
                                   "vkCreateRayTracingPipelinesKHR: a pipeline uses opacity micromaps, but the feature "
                                   "micromap is not enabled"))
        return false;
    if ((!uses || !driver.enabled.khrFeature) &&
        (flags & VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR) != 0 &&
        !toleratesMixedSpecialIndex(driver, "VELLUM-VUID-VkRayTracingPipelineCreateInfoKHR-flags-11599",
                                    "vkCreateRayTracingPipelinesKHR"))
        return false;
    if (!uses && available && !driver.settings->assumeMicromaps && !binariesOf(info.pNext))
        warnOfTracing(device, info);
    return true;
}

// Calls `use` with the create info of a pipeline as the driver gets it.
template <typename Use>
VkResult withDriverInfo(DeviceKhrOverExt &device, const newer::PipelineCreateInfo &info, Use use)
{
    const auto *structure = static_cast<const VkBaseInStructure *>(info.pNext);
    DriverInfos own(device);
    const auto useOwn = [&]<typename Info>(const Info *application) {
        Info driverInfo = *application;
        if (!own.translate(driverInfo))
            return VK_ERROR_INITIALIZATION_FAILED;
        return use({info.sType, &driverInfo});
    };
    switch (structure ? structure->sType : VK_STRUCTURE_TYPE_MAX_ENUM) {
    case VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO:
        return useOwn(reinterpret_cast<const VkComputePipelineCreateInfo *>(structure));
    case VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO:
        return useOwn(reinterpret_cast<const VkGraphicsPipelineCreateInfo *>(structure));
    case VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR:
        return useOwn(reinterpret_cast<const VkRayTracingPipelineCreateInfoKHR *>(structure));
    default: return use(info);
    }
}

// Pipelines without groups: compute and graphics, by the driver's command for them.
template <typename Info, typename Create>
VkResult createPipelines(DeviceKhrOverExt &device, uint32_t count, const Info *infos, VkPipeline *pipelines,
                         const char *id, const char *command, Create create)
{
    DriverInfos own(device);
    std::vector<Info> driverInfos(infos, infos + count);
    const std::vector<VkResult> prepared = prepareEach(std::span(driverInfos), [&](Info &info) {
        if (!mayHaveFlags(device.driver, info.pNext, info.flags, id, command))
            return VK_ERROR_VALIDATION_FAILED_EXT;
        return own.translate(info) ? VK_SUCCESS : VK_ERROR_INVALID_SHADER_NV;
    });
    return createPrepared(std::span(driverInfos), prepared, pipelines, create);
}

} // namespace

VkResult createTranslatedModule(DeviceKhrOverExt &device, VkDevice handle, const VkShaderModuleCreateInfo *info,
                                const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    VkShaderModuleCreateInfo driverInfo = *info;
    std::vector<uint32_t> storage;
    translateShader(device, driverInfo.pCode, driverInfo.codeSize, storage);
    const VkResult result = device.driver.next.CreateShaderModule(handle, &driverInfo, allocator, module);
    const std::span<const uint32_t> words(info->pCode, info->codeSize / 4);
    if (result == VK_SUCCESS && spirv::scan(words).traced.traces)
        device.tracingModules.set(*module, codeHash(words));
    return result;
}

void destroyTranslatedModule(DeviceKhrOverExt &device, VkDevice handle, VkShaderModule module,
                             const VkAllocationCallbacks *allocator)
{
    device.tracingModules.take(module);
    device.driver.next.DestroyShaderModule(handle, module, allocator);
}

VkResult createTranslatedComputePipelines(DeviceKhrOverExt &device, VkDevice handle, VkPipelineCache cache,
                                          uint32_t count, const VkComputePipelineCreateInfo *infos,
                                          const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    return createPipelines(device, count, infos, pipelines, "VELLUM-VUID-VkComputePipelineCreateInfo-flags-11593",
                           "vkCreateComputePipelines",
                           [&](uint32_t some, const VkComputePipelineCreateInfo *driverInfos, VkPipeline *made) {
                               return device.driver.next.CreateComputePipelines(handle, cache, some, driverInfos,
                                                                                allocator, made);
                           });
}

VkResult createTranslatedGraphicsPipelines(DeviceKhrOverExt &device, VkDevice handle, VkPipelineCache cache,
                                           uint32_t count, const VkGraphicsPipelineCreateInfo *infos,
                                           const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    return createPipelines(device, count, infos, pipelines, "VELLUM-VUID-VkGraphicsPipelineCreateInfo-flags-11595",
                           "vkCreateGraphicsPipelines",
                           [&](uint32_t some, const VkGraphicsPipelineCreateInfo *driverInfos, VkPipeline *made) {
                               return device.driver.next.CreateGraphicsPipelines(handle, cache, some, driverInfos,
                                                                                 allocator, made);
                           });
}

VkResult createTranslatedRayTracingPipelines(DeviceKhrOverExt &device, VkDevice handle,
                                             VkDeferredOperationKHR operation, VkPipelineCache cache, uint32_t count,
                                             const VkRayTracingPipelineCreateInfoKHR *infos,
                                             const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    auto own = std::make_unique<DriverInfos>(device);
    own->rayTracing.assign(infos, infos + count);
    const std::vector<VkResult> prepared =
        prepareEach(std::span(own->rayTracing), [&](VkRayTracingPipelineCreateInfoKHR &info) {
            if (!mayHaveRayTracingFlags(device, info))
                return VK_ERROR_VALIDATION_FAILED_EXT;
            return own->translate(info) ? VK_SUCCESS : VK_ERROR_INVALID_SHADER_NV;
        });
    const auto create = [&](VkDeferredOperationKHR deferral, uint32_t some,
                            const VkRayTracingPipelineCreateInfoKHR *driverInfos, VkPipeline *made) {
        return device.driver.next.CreateRayTracingPipelinesKHR(handle, deferral, cache, some, driverInfos, allocator,
                                                               made);
    };
    if (!allSucceeded(prepared))
        return createPrepared(std::span(own->rayTracing), prepared, pipelines,
                              [&](auto... arguments) { return create(VK_NULL_HANDLE, arguments...); });
    std::shared_ptr<DeferredOperation> deferred; // made before the driver may begin to need it
    if (operation) {
        deferred = std::make_shared<DeferredOperation>();
        device.commands.deferredOperations.set(operation, deferred);
    }
    const VkResult result = create(operation, count, own->rayTracing.data(), pipelines);
    if (result == VK_OPERATION_DEFERRED_KHR && deferred)
        deferred->work = std::move(own);
    return result;
}

VkResult createTranslatedShaders(DeviceKhrOverExt &device, VkDevice handle, uint32_t count,
                                 const newer::ShaderCreateInfo *infos, const VkAllocationCallbacks *allocator,
                                 newer::ShaderEXT *shaders)
{
    std::vector<newer::ShaderCreateInfo> own(infos, infos + count);
    std::deque<std::vector<uint32_t>> storage;
    const auto prepare = [&](newer::ShaderCreateInfo &info) {
        if (!takeMixedSpecialIndex(device.driver, info))
            return VK_ERROR_VALIDATION_FAILED_EXT;
        if (info.codeType != newer::kShaderCodeTypeSpirv)
            return VK_SUCCESS;
        const auto *code = static_cast<const uint32_t *>(info.pCode);
        translateShader(device, code, info.codeSize, storage.emplace_back());
        info.pCode = code;
        return VK_SUCCESS;
    };
    return createShadersBeforeFailure(own, shaders, prepare, [&](uint32_t prepared) {
        return device.driver.next.CreateShadersEXT(handle, prepared, own.data(), allocator, shaders);
    });
}

void getTranslatedInfoIdentifier(DeviceKhrOverExt &device, VkDevice handle, const VkShaderModuleCreateInfo *info,
                                 VkShaderModuleIdentifierEXT *identifier)
{
    VkShaderModuleCreateInfo driverInfo = *info;
    std::vector<uint32_t> storage;
    translateShader(device, driverInfo.pCode, driverInfo.codeSize, storage);
    device.driver.next.GetShaderModuleCreateInfoIdentifierEXT(handle, &driverInfo, identifier);
}

VkResult createTranslatedBinaries(DeviceKhrOverExt &device, VkDevice handle,
                                  const newer::PipelineBinaryCreateInfo *info, const VkAllocationCallbacks *allocator,
                                  newer::PipelineBinaryHandlesInfo *binaries)
{
    const auto create = device.driver.next.CreatePipelineBinariesKHR;
    if (!info->pPipelineCreateInfo)
        return create(handle, info, allocator, binaries);
    bool asked = false;
    const VkResult result =
        withDriverInfo(device, *info->pPipelineCreateInfo, [&](const newer::PipelineCreateInfo &pipeline) {
            newer::PipelineBinaryCreateInfo driverInfo = *info;
            driverInfo.pPipelineCreateInfo = &pipeline;
            asked = true;
            return create(handle, &driverInfo, allocator, binaries);
        });
    if (!asked) {
        std::fill_n(binaries->pPipelineBinaries, binaries->pPipelineBinaries ? binaries->pipelineBinaryCount : 0,
                    nullptr);
        binaries->pipelineBinaryCount = 0;
    }
    return result;
}

VkResult getTranslatedKey(DeviceKhrOverExt &device, VkDevice handle, const newer::PipelineCreateInfo *info,
                          newer::PipelineBinaryKey *key)
{
    const auto get = device.driver.next.GetPipelineKeyKHR;
    if (!info)
        return get(handle, nullptr, key);
    return withDriverInfo(device, *info,
                          [&](const newer::PipelineCreateInfo &driverInfo) { return get(handle, &driverInfo, key); });
}

} // namespace vellum::layer
