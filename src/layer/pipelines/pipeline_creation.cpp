// The creation of ray tracing pipelines: stages rewritten for what they decide, an any-hit shader in every hit group,
// and flags that the driver does not know.

#include <algorithm>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "layer/base/pnext.h"
#include "layer/command_buffer/deferred_operation.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/driver_stages.h"
#include "layer/pipelines/pipeline_binaries.h"
#include "layer/pipelines/pipeline_flags.h"
#include "layer/pipelines/shaders.h"
#include "spirv/module/opcodes.h"

namespace vellum::layer
{
namespace
{

using spirv::Decides;

constexpr VkFlags64 kMicromapPipelineFlag = VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT;
// The application promises that no closest-hit and no any-hit shader that would run is null. But the group that stands
// in for null handles has no closest-hit shader, and with hidden ray flags an any-hit shader would run more often.
constexpr VkFlags64 kHiddenPipelineFlags = kMicromapPipelineFlags |
                                           VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR |
                                           VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR;

uint32_t executionModelOf(VkShaderStageFlagBits stage)
{
    switch (stage) {
    case VK_SHADER_STAGE_RAYGEN_BIT_KHR: return spv::ExecutionModelRayGenerationKHR;
    case VK_SHADER_STAGE_INTERSECTION_BIT_KHR: return spv::ExecutionModelIntersectionKHR;
    case VK_SHADER_STAGE_ANY_HIT_BIT_KHR: return spv::ExecutionModelAnyHitKHR;
    case VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR: return spv::ExecutionModelClosestHitKHR;
    case VK_SHADER_STAGE_MISS_BIT_KHR: return spv::ExecutionModelMissKHR;
    default: return spv::ExecutionModelCallableKHR;
    }
}

VkFlags64 flagsOf(const VkRayTracingPipelineCreateInfoKHR &info)
{
    return pipelineFlags(info.pNext, info.flags);
}

// Everything that one vkCreateRayTracingPipelinesKHR hands to the driver, for as long as the driver may read it.
class Creation : public DeferredWork
{
public:
    Creation(DevicePipelines &device, VkPipeline *pipelines) : device_(device), stages_(device), pipelines_(pipelines)
    {
    }
    ~Creation() override
    {
        for (const VkShaderModule module : modules_)
            device_.driver.next.DestroyShaderModule(device_.driver.handle, module, nullptr);
    }
    Creation(const Creation &) = delete;
    Creation &operator=(const Creation &) = delete;

    // Adds a pipeline. Anything but VK_SUCCESS: it cannot be made.
    VkResult add(const VkRayTracingPipelineCreateInfoKHR &info)
    {
        VkRayTracingPipelineCreateInfoKHR &own = infos_.emplace_back(info);
        records_.emplace_back();
        groupsOfOurs_.emplace_back();
        if (!device_.driver.emulated())
            return takeIdentifiers(own);
        const bool available = device_.driver.enabled.anyFeature();
        bool asked =
            (flagsOf(info) & kMicromapPipelineFlag) != 0 || (available && device_.driver.settings->assumeMicromaps);
        if (asked && !available &&
            !tolerateIf(true, "VELLUM-VUID-VkRayTracingPipelineCreateInfoKHR-flags-11597",
                        "uses opacity micromaps, but the feature micromap is not enabled"))
            return VK_ERROR_VALIDATION_FAILED_EXT;
        if ((!asked || !device_.driver.enabled.khrFeature) &&
            (flagsOf(info) & VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR) != 0 &&
            !toleratesMixedSpecialIndex(device_.driver, "VELLUM-VUID-VkRayTracingPipelineCreateInfoKHR-flags-11599",
                                        "vkCreateRayTracingPipelinesKHR"))
            return VK_ERROR_VALIDATION_FAILED_EXT;
        const uint32_t libraries = info.pLibraryInfo ? info.pLibraryInfo->libraryCount : 0;
        std::optional<uint32_t> without;
        uint32_t with = 0;
        for (uint32_t i = 0; i < libraries; ++i) {
            if (device_.rayTracingPipelines.get(info.pLibraryInfo->pLibraries[i]))
                ++with;
            else
                without = i;
        }
        if (asked && without) {
            // Where all were, the pipeline can be one without micromaps.
            if (!tolerateIf(with == 0, "VELLUM-VUID-VkRayTracingPipelineCreateInfoKHR-pLibraries-11598",
                            "uses opacity micromaps, but library " + std::to_string(*without) +
                                " was created without the bit"))
                return VK_ERROR_VALIDATION_FAILED_EXT;
            asked = false;
        }
        if (with > 0 && without) {
            device_.driver.report().notAvailable(
                "a ray tracing pipeline of libraries with and without the micromap bit");
            return VK_ERROR_UNKNOWN;
        }
        // A pipeline without the bit may have libraries with it, whose shaders are what they are.
        const bool usesMicromaps = asked || with > 0;
        if (usesMicromaps)
            return addMicromapPipeline(own);
        // Not for queries of pipeline keys. The code of a pipeline of binaries is ignored.
        if (pipelines_ && available && !binariesOf(info.pNext))
            warnOfTracing(info);
        // Where the chain has other flags, these mean nothing; the driver does not know the bit all the same.
        own.flags &= ~static_cast<VkPipelineCreateFlags>(kMicromapPipelineFlags);
        changed_ = changed_ || own.flags != info.flags;
        if (!hideMicromapFlags(device_.driver, own.pNext, chains_, "vkCreateRayTracingPipelinesKHR"))
            return VK_ERROR_INITIALIZATION_FAILED;
        if (!binariesOf(own.pNext) && !stages_.rewrite(own.pStages, own.stageCount))
            return VK_ERROR_UNKNOWN;
        return takeIdentifiers(own);
    }

    [[nodiscard]] const std::vector<VkRayTracingPipelineCreateInfoKHR> &infos() const { return infos_; }
    // Of the last one.
    [[nodiscard]] HiddenInBinary hidden() const { return records_.back() ? records_.back()->hidden : HiddenInBinary{}; }
    [[nodiscard]] bool changed() const
    {
        return stages_.changed() || changed_ || !chains_.empty() ||
               std::any_of(records_.begin(), records_.end(), [](const auto &r) { return !!r; });
    }

    // Before the driver makes the pipelines: afterwards nothing allocates.
    void reserve()
    {
        for (const auto &record : records_)
            entries_.push_back(device_.rayTracingPipelines.entry(record));
    }

    // The driver has made the pipelines, or failed to.
    void finish() noexcept override
    {
        for (const Feedback &feedback : feedback_)
            std::copy_n(feedback.own.begin(), std::min<size_t>(feedback.count, feedback.own.size()),
                        feedback.application);
        for (size_t i = 0; i < records_.size(); ++i) {
            if (!records_[i] || !pipelines_[i])
                continue;
            if (records_[i]->hasNullGroup)
                writeStandIn(device_, pipelines_[i], *records_[i]);
            measureStacks(device_, pipelines_[i], groupsOfOurs_[i]);
            device_.rayTracingPipelines.set(pipelines_[i], std::move(entries_[i]));
        }
    }

private:
    // Of stages whose code only the driver has.
    VkResult takeIdentifiers(VkRayTracingPipelineCreateInfoKHR &info)
    {
        if (binariesOf(info.pNext))
            return VK_SUCCESS;
        DriverIdentifiers &identifiers = identifiers_.emplace_back(device_);
        identifiers.take(info.pStages, info.stageCount, true);
        changed_ = changed_ || identifiers.any();
        return identifiers.ways() == 0 ? VK_PIPELINE_COMPILE_REQUIRED : VK_SUCCESS;
    }

    // Reports about the pipeline that is being added.
    void reject(const char *id, const std::string &text)
    {
        device_.driver.report().error(id, "vkCreateRayTracingPipelinesKHR: pipeline " +
                                              std::to_string(infos_.size() - 1) + " " + text);
    }

    // Whether it may be made all the same, as where the fault is harmless and nobody is strict.
    bool tolerateIf(bool harmless, const char *id, const std::string &text)
    {
        if (harmless)
            return device_.driver.report().tolerates(id, "vkCreateRayTracingPipelinesKHR: pipeline " +
                                                             std::to_string(infos_.size() - 1) + " " + text);
        reject(id, text);
        return false;
    }

    // Of a pipeline without the micromap bit, which is harmless where it meets no micromaps. Applications forget it all
    // the same, NVRHI for one.
    void warnOfTracing(const VkRayTracingPipelineCreateInfoKHR &info)
    {
        constexpr const char *kId = "VELLUM-pipeline-without-micromaps";
        bool isFirst = false;
        for (const VkPipelineShaderStageCreateInfo &stage : std::span(info.pStages, info.stageCount)) {
            const std::span<const uint32_t> code = stageCode(device_, stage);
            isFirst =
                (tracedBy(device_, stage).traces && device_.shaderWarnings.isFirst(kId, codeHash(code))) || isFirst;
        }
        if (isFirst)
            device_.driver.report().warning(
                kId,
                "vkCreateRayTracingPipelinesKHR: pipeline " + std::to_string(infos_.size() - 1) +
                    " traces rays and was created without RAY_TRACING_OPACITY_MICROMAP: where they meet micromaps, "
                    "every hit on their geometry is non-opaque. The setting assume_micromaps creates all pipelines "
                    "with it");
    }

    // What a driver's stage is made from: the application's stage, what it decides, and the type of the payload that it
    // gets, if it declares none and needs one.
    using StageKey = std::tuple<uint32_t, Decides, spirv::TypeWords>;

    struct Feedback {
        VkPipelineCreationFeedback *application = nullptr;
        uint32_t count = 0;
        std::vector<VkPipelineCreationFeedback> own;
    };
    struct Stages {
        std::vector<VkPipelineShaderStageCreateInfo> infos;
        std::map<StageKey, uint32_t> index;
        // With the payload of rays of which no shader of a group tells more.
        spirv::HiddenFlags hidden;
        // Of the application's stages, the payloads that they declare that they are called with. Empty where groups
        // must not differ by that.
        std::vector<std::optional<spirv::TypeWords>> payloads;
        bool needCode = true; // the pipeline is not made of binaries
    };

    VkResult addMicromapPipeline(VkRayTracingPipelineCreateInfoKHR &info)
    {
        const VkFlags64 flags = flagsOf(info);
        records_.back() = std::make_shared<RayTracingPipeline>();
        RayTracingPipeline &record = *records_.back();
        record.ownGroups = info.groupCount;
        record.hasNullGroup =
            (flags & (VK_PIPELINE_CREATE_LIBRARY_BIT_KHR | VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR)) == 0;
        if (pipelines_ && record.hasNullGroup) {
            record.standIn = PooledMemory(device_.buffers.hitRecords, kGroupHandleBytes);
            if (!record.standIn.address())
                return VK_ERROR_OUT_OF_DEVICE_MEMORY;
        }
        noteHitRecords(device_, info, record);
        if (!hideFlags(info))
            return VK_ERROR_INITIALIZATION_FAILED;
        Stages stages;
        const newer::PipelineBinaryInfo *const binaries = binariesOf(info.pNext);
        // Binaries that came from elsewhere are those of a pipeline without micromaps.
        const HiddenInBinary kept = binaries ? hiddenFlagsIn(device_, *binaries) : HiddenInBinary{};
        stages.hidden = kept.known ? spirv::HiddenFlags{kept.fixed, kept.constant} : hiddenFlags(info);
        stages.needCode = !binaries;
        if (stages.hidden.inPayload()) {
            record.payloads = payloadTypes(info, stages.payloads);
            // The rays that reach a library's groups may be others' with other payloads.
            if ((flags & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) == 0)
                stages.hidden.payload = record.payloads.common();
        }
        record.hidden = {true, stages.hidden.fixed, stages.hidden.constant};
        if (!flagsTravelAlike(device_, info, stages.hidden))
            return VK_ERROR_UNKNOWN;
        widenInterface(info, stages.hidden);
        if (const VkResult result = addStages(info, stages); result != VK_SUCCESS)
            return result;
        std::vector<VkRayTracingShaderGroupCreateInfoKHR> groups(info.pGroups, info.pGroups + info.groupCount);
        if (record.hasNullGroup) {
            VkRayTracingShaderGroupCreateInfoKHR group{VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR};
            group.type = VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR;
            group.generalShader = group.closestHitShader = group.intersectionShader = VK_SHADER_UNUSED_KHR;
            group.anyHitShader = VK_SHADER_UNUSED_KHR;
            groups.push_back(group);
        }
        for (uint32_t i = 0; i < groups.size(); ++i) {
            const bool own = groups[i].type != VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR &&
                             groups[i].anyHitShader == VK_SHADER_UNUSED_KHR;
            if (!setHitShaders(groups[i], stages))
                return VK_ERROR_OUT_OF_HOST_MEMORY;
            if (own)
                groupsOfOurs_.back().push_back(i);
        }
        const auto &ownStages = stageArrays_.emplace_back(std::move(stages.infos));
        const auto &ownGroups = groupArrays_.emplace_back(std::move(groups));
        info.stageCount = static_cast<uint32_t>(ownStages.size());
        info.pStages = ownStages.data();
        info.groupCount = static_cast<uint32_t>(ownGroups.size());
        info.pGroups = ownGroups.data();
        return reserveFeedback(info);
    }

    // The driver writes feedback for each of its stages (VUID-...-pipelineStageCreationFeedbackCount-06652), of which
    // there may be more than the application knows.
    VkResult reserveFeedback(VkRayTracingPipelineCreateInfoKHR &info)
    {
        constexpr VkStructureType type = VK_STRUCTURE_TYPE_PIPELINE_CREATION_FEEDBACK_CREATE_INFO;
        const auto *application = findInChain<VkPipelineCreationFeedbackCreateInfo>(info.pNext, type);
        if (!application || application->pipelineStageCreationFeedbackCount == 0)
            return VK_SUCCESS;
        Chain &chain = chains_.emplace_back(info.pNext);
        auto *own = chain.edit<VkPipelineCreationFeedbackCreateInfo>(type);
        if (!own) {
            reject("VELLUM-pipeline-feedback",
                   "has VkPipelineCreationFeedbackCreateInfo behind a structure of unknown size");
            return VK_ERROR_INITIALIZATION_FAILED;
        }
        Feedback &feedback = feedback_.emplace_back();
        feedback.application = application->pPipelineStageCreationFeedbacks;
        feedback.count = application->pipelineStageCreationFeedbackCount;
        feedback.own.resize(info.stageCount);
        own->pipelineStageCreationFeedbackCount = info.stageCount;
        own->pPipelineStageCreationFeedbacks = feedback.own.data();
        info.pNext = chain.head();
        return VK_SUCCESS;
    }

    bool hideFlags(VkRayTracingPipelineCreateInfoKHR &info)
    {
        info.flags &= ~static_cast<VkPipelineCreateFlags>(kHiddenPipelineFlags);
        if (!findInChain(info.pNext, newer::kPipelineCreateFlags2CreateInfo))
            return true;
        Chain &chain = chains_.emplace_back(info.pNext);
        auto *flags = chain.edit<newer::PipelineCreateFlags2CreateInfo>(newer::kPipelineCreateFlags2CreateInfo);
        if (!flags) {
            reject("VELLUM-pipeline-flags", "has VkPipelineCreateFlags2CreateInfo behind a structure of unknown size");
            return false;
        }
        flags->flags &= ~kHiddenPipelineFlags;
        info.pNext = chain.head();
        return true;
    }

    // How ray flags that are hidden from the driver reach the shaders of a ray. Most pipelines pass constant flags that
    // agree on the hidden ones. What libraries trace that a pipeline will be made of or linked with, nobody knows here.
    spirv::HiddenFlags hiddenFlags(const VkRayTracingPipelineCreateInfoKHR &info)
    {
        const bool complete = device_.driver.settings->constantRayFlags &&
                              (flagsOf(info) & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) == 0 &&
                              (!info.pLibraryInfo || info.pLibraryInfo->libraryCount == 0);
        if (!complete)
            return {.fixed = 0};
        spirv::TracedFlags traced;
        for (uint32_t i = 0; i < info.stageCount; ++i)
            traced.add(tracedBy(device_, info.pStages[i]));
        return {traced.fixed, traced.constant};
    }

    // Of all shaders, as far as they are known here: what a library will be linked with is not. `incoming`: those that
    // the stages are called with.
    spirv::PayloadTypes payloadTypes(const VkRayTracingPipelineCreateInfoKHR &info,
                                     std::vector<std::optional<spirv::TypeWords>> &incoming) const
    {
        spirv::PayloadTypes types;
        for (uint32_t i = 0; i < info.stageCount; ++i)
            incoming.push_back(types.add(stageCode(device_, info.pStages[i]), info.pStages[i].pName,
                                         executionModelOf(info.pStages[i].stage)));
        // A pipeline of binaries, whose stages may come without code, must have the stages of the one of code.
        if (device_.driver.next.CreatePipelineBinariesKHR)
            incoming.clear();
        for (uint32_t i = 0; info.pLibraryInfo && i < info.pLibraryInfo->libraryCount; ++i) {
            if (const auto library = device_.rayTracingPipelines.get(info.pLibraryInfo->pLibraries[i]))
                types.add(library->payloads);
        }
        return types;
    }

    // Our any-hit shaders read the barycentrics, also where none of the application's does, and payloads may have a
    // prefix.
    void widenInterface(VkRayTracingPipelineCreateInfoKHR &info, const spirv::HiddenFlags &hidden)
    {
        constexpr uint32_t kBarycentricsBytes = 8;
        constexpr uint32_t kPrefixBytes = 8; // aligned for what comes after
        if (!info.pLibraryInterface)
            return;
        VkRayTracingPipelineInterfaceCreateInfoKHR &own = interfaces_.emplace_back(*info.pLibraryInterface);
        own.maxPipelineRayHitAttributeSize = std::max(own.maxPipelineRayHitAttributeSize, kBarycentricsBytes);
        if (hidden.inPayload())
            own.maxPipelineRayPayloadSize += std::min(kPrefixBytes, UINT32_MAX - own.maxPipelineRayPayloadSize);
        info.pLibraryInterface = &own;
    }

    // Of the rays that reach a group, where it matters: what its shaders declare, which all of a ray must
    // (VUID-RuntimeSpirv-OpTraceRayKHR-11855).
    static spirv::TypeWords payloadOf(const VkRayTracingShaderGroupCreateInfoKHR &group, const Stages &stages)
    {
        if (group.type != VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR)
            for (const uint32_t shader : {group.closestHitShader, group.anyHitShader})
                if (shader < stages.payloads.size() && stages.payloads[shader])
                    return *stages.payloads[shader];
        return stages.hidden.payload;
    }

    static StageKey keyOf(uint32_t stage, Decides decides, const VkRayTracingShaderGroupCreateInfoKHR &group,
                          const Stages &stages)
    {
        const bool knows = decides == Decides::BoxCulling || (stage < stages.payloads.size() && stages.payloads[stage]);
        return {stage, decides, knows ? spirv::TypeWords{} : payloadOf(group, stages)};
    }

    // Every stage of the application, once for each thing that it is in some group.
    VkResult addStages(const VkRayTracingPipelineCreateInfoKHR &info, Stages &stages)
    {
        std::vector<std::set<StageKey>> needed(info.stageCount);
        for (uint32_t g = 0; g < info.groupCount; ++g) {
            const VkRayTracingShaderGroupCreateInfoKHR &group = info.pGroups[g];
            const auto need = [&](uint32_t stage, Decides decides) {
                if (stage < info.stageCount)
                    needed[stage].insert(keyOf(stage, decides, group, stages));
            };
            const bool boxes = group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR;
            if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR) {
                need(group.generalShader, Decides::Nothing);
                continue;
            }
            need(group.closestHitShader, Decides::Nothing);
            need(group.anyHitShader, boxes ? Decides::BoxHits : Decides::TriangleHits);
            if (boxes)
                need(group.intersectionShader, Decides::BoxCulling);
        }
        stages.infos.assign(info.pStages, info.pStages + info.stageCount);
        for (uint32_t i = 0; i < info.stageCount; ++i) {
            if (needed[i].empty())
                needed[i].insert({i, Decides::Nothing, {}});
            bool first = true;
            for (const StageKey &key : needed[i]) {
                const uint32_t at = first ? i : static_cast<uint32_t>(stages.infos.size());
                if (!first)
                    stages.infos.push_back(info.pStages[i]);
                first = false;
                const VkResult result =
                    stages.needCode ? rewriteStage(stages.infos[at], std::get<Decides>(key), hiddenFor(key, stages))
                                    : VK_SUCCESS;
                if (result != VK_SUCCESS)
                    return result;
                stages.index[key] = at;
            }
        }
        return VK_SUCCESS;
    }

    static spirv::HiddenFlags hiddenFor(const StageKey &key, const Stages &stages)
    {
        return {stages.hidden.fixed, stages.hidden.constant, std::get<spirv::TypeWords>(key)};
    }

    VkResult rewriteStage(VkPipelineShaderStageCreateInfo &stage, Decides decides, const spirv::HiddenFlags &hidden)
    {
        const spirv::PipelineStage target{stage.pName, executionModelOf(stage.stage), decides, hidden};
        const auto original = device_.rayTracingModules.get(stage.module);
        if (!original) {
            bool inlined = false;
            if (!stages_.rewriteInline(stage, inlined, target))
                return VK_ERROR_UNKNOWN;
            // Without its code (but a module identifier) a stage cannot be rewritten; the application is ready to be
            // told so.
            return inlined ? VK_SUCCESS : VK_PIPELINE_COMPILE_REQUIRED;
        }
        VkShaderModule &module =
            rewritten_[{stage.module, stage.stage, decides, hidden, std::string(stage.pName)}]; // null until it is made
        if (!module) {
            const uint32_t *code = original->words.data();
            size_t bytes = original->words.size() * 4;
            std::vector<uint32_t> storage;
            if (!rewriteShader(device_, code, bytes, storage, target))
                return VK_ERROR_UNKNOWN;
            const VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0, bytes, code};
            modules_.reserve(modules_.size() + 1);
            VkShaderModule made = VK_NULL_HANDLE;
            const VkResult result =
                device_.driver.next.CreateShaderModule(device_.driver.handle, &info, nullptr, &made);
            if (result != VK_SUCCESS)
                return result;
            module = made;
            modules_.push_back(module);
        }
        stage.module = module;
        return VK_SUCCESS;
    }

    bool setHitShaders(VkRayTracingShaderGroupCreateInfoKHR &group, Stages &stages)
    {
        if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR)
            return true; // there is one of its stage
        const bool triangles = group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR;
        const VkRayTracingShaderGroupCreateInfoKHR asked = group;
        const auto driverStage = [&](uint32_t stage, Decides decides) {
            const auto found = stages.index.find(keyOf(stage, decides, asked, stages));
            return found == stages.index.end() ? VK_SHADER_UNUSED_KHR : found->second;
        };
        const Decides decides = triangles ? Decides::TriangleHits : Decides::BoxHits;
        group.closestHitShader = driverStage(asked.closestHitShader, Decides::Nothing);
        if (!triangles)
            group.intersectionShader = driverStage(asked.intersectionShader, Decides::BoxCulling);
        group.anyHitShader = asked.anyHitShader == VK_SHADER_UNUSED_KHR
                                 ? ownAnyHit(keyOf(VK_SHADER_UNUSED_KHR, decides, asked, stages), stages)
                                 : driverStage(asked.anyHitShader, decides);
        return group.anyHitShader != VK_SHADER_UNUSED_KHR;
    }

    // The stage with the layer's any-hit shader; VK_SHADER_UNUSED_KHR where it cannot be made.
    uint32_t ownAnyHit(const StageKey &key, Stages &stages)
    {
        const auto [known, isNew] = stages.index.try_emplace(key, VK_SHADER_UNUSED_KHR);
        if (!isNew)
            return known->second;
        const VkShaderModule module =
            device_.anyHitModules.get(std::get<Decides>(key), hiddenFor(key, stages), rewriteOptions(device_));
        if (!module) {
            device_.driver.report().error("VELLUM-any-hit-shader",
                                          "the driver could not make a shader module of the layer's");
            return VK_SHADER_UNUSED_KHR;
        }
        known->second = static_cast<uint32_t>(stages.infos.size());
        stages.infos.push_back({VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, nullptr, 0,
                                VK_SHADER_STAGE_ANY_HIT_BIT_KHR, module, "main", nullptr});
        return known->second;
    }

    DevicePipelines &device_;
    DriverStages stages_;
    VkPipeline *pipelines_; // the application's, which must stay valid until a deferred operation is complete
    std::vector<VkRayTracingPipelineCreateInfoKHR> infos_;
    std::vector<std::shared_ptr<RayTracingPipeline>> records_;                   // null for pipelines without micromaps
    std::vector<decltype(DevicePipelines::rayTracingPipelines)::Entry> entries_; // of the records
    std::vector<std::vector<uint32_t>> groupsOfOurs_; // per pipeline, those whose any-hit shader is the layer's
    std::deque<Chain> chains_;
    std::deque<DriverIdentifiers> identifiers_;
    bool changed_ = false;
    std::deque<std::vector<VkPipelineShaderStageCreateInfo>> stageArrays_;
    std::deque<std::vector<VkRayTracingShaderGroupCreateInfoKHR>> groupArrays_;
    std::deque<VkRayTracingPipelineInterfaceCreateInfoKHR> interfaces_;
    std::deque<Feedback> feedback_;
    std::map<std::tuple<VkShaderModule, VkShaderStageFlagBits, Decides, spirv::HiddenFlags, std::string>,
             VkShaderModule>
        rewritten_;
    std::vector<VkShaderModule> modules_;
};

} // namespace

VkResult
withDriverInfo(DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
               const std::function<VkResult(const VkRayTracingPipelineCreateInfoKHR &, const HiddenInBinary &)> &use)
{
    Creation creation(device, nullptr);
    const VkResult result = creation.add(info);
    return result == VK_SUCCESS ? use(creation.infos().front(), creation.hidden()) : result;
}

VkResult createRayTracingPipelines(DevicePipelines &device, VkDevice handle, VkDeferredOperationKHR operation,
                                   VkPipelineCache cache, uint32_t count,
                                   const VkRayTracingPipelineCreateInfoKHR *infos,
                                   const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    std::fill_n(pipelines, count, VK_NULL_HANDLE);
    auto creation = std::make_unique<Creation>(device, pipelines);
    const std::vector<VkResult> prepared =
        prepareEach(std::span(infos, count), [&](const auto &info) { return creation->add(info); });
    creation->reserve();
    if (!allSucceeded(prepared)) {
        const VkResult result =
            createPrepared(std::span(creation->infos()), prepared, pipelines,
                           [&](uint32_t one, const VkRayTracingPipelineCreateInfoKHR *info, VkPipeline *pipeline) {
                               return device.driver.next.CreateRayTracingPipelinesKHR(handle, VK_NULL_HANDLE, cache,
                                                                                      one, info, allocator, pipeline);
                           });
        creation->finish();
        return result;
    }
    if (!creation->changed())
        return device.driver.next.CreateRayTracingPipelinesKHR(handle, operation, cache, count, infos, allocator,
                                                               pipelines);
    // Nobody would tell here when it is complete; and where only identifiers are changed, the driver compiles nothing.
    if (!device.driver.emulated()) {
        const VkResult result = device.driver.next.CreateRayTracingPipelinesKHR(
            handle, VK_NULL_HANDLE, cache, count, creation->infos().data(), allocator, pipelines);
        return operation && result == VK_SUCCESS ? VK_OPERATION_NOT_DEFERRED_KHR : result;
    }
    std::shared_ptr<DeferredOperation> deferred; // made before the driver may begin to need it
    if (operation) {
        deferred = std::make_shared<DeferredOperation>();
        device.commands.deferredOperations.set(operation, deferred);
    }
    const VkResult result = device.driver.next.CreateRayTracingPipelinesKHR(
        handle, operation, cache, count, creation->infos().data(), allocator, pipelines);
    if (result == VK_OPERATION_DEFERRED_KHR && deferred)
        deferred->work = std::move(creation);
    else
        creation->finish();
    return result;
}

} // namespace vellum::layer
