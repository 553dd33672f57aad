// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/pipeline_creation.h"

#include <algorithm>
#include <optional>
#include <span>

#include "layer/base/commands.h"
#include "layer/input/checked.h"
#include "layer/pipelines/binaries.h"
#include "layer/pipelines/shaders.h"
#include "layer/rules/creations.h"

namespace vellum::layer
{
namespace
{

constexpr const char *kCommand = "vkCreateRayTracingPipelinesKHR";
constexpr VkFlags64 kMicromapPipelineFlag = VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT;
// Promises that no null closest-hit or any-hit shader would run. They do not hold for the driver: the layer's hit group
// for null handles has no closest-hit shader, and with hidden ray flags an any-hit shader would run more often.
constexpr VkFlags64 kNoNullShaderFlags = VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR |
                                         VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR;

VkFlags64 flagsOf(const VkRayTracingPipelineCreateInfoKHR &info)
{
    return pipelineFlags(info.pNext, info.flags);
}

std::span<const VkPipeline> librariesOf(const VkRayTracingPipelineCreateInfoKHR &info)
{
    return info.pLibraryInfo ? std::span(info.pLibraryInfo->pLibraries, info.pLibraryInfo->libraryCount)
                             : std::span<const VkPipeline>();
}

// Returns whether the setting assume_micromaps gives a pipeline the micromap bit. Not one that promises to meet no
// micromaps, nor one with such a library (VUID-VkRayTracingPipelineCreateInfoKHR-pLibraries-11598).
bool isAssumed(const DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info)
{
    return device.driver.assumesMicromaps() &&
           (flagsOf(info) & VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM) == 0 &&
           std::ranges::none_of(librariesOf(info),
                                [&](VkPipeline library) { return device.librariesWithoutMicromaps.get(library); });
}

// Checks the create infos, if validation has not.
input::Pipelines checked(const DevicePipelines &device, uint32_t count, const VkRayTracingPipelineCreateInfoKHR *infos)
{
    return input::Checked<input::Pipelines>::take(infos, [&] {
        return rules::checkPipelines(device.objects.rules, count, infos, [&](VkPipeline library) {
            return device.driver.emulated() ? std::optional(device.rayTracingPipelines.get(library) != nullptr)
                                            : std::nullopt;
        });
    });
}

} // namespace

PipelineCreation::PipelineCreation(DevicePipelines &device, VkPipeline *pipelines)
    : device_(device), pipelines_(pipelines), stages_(device), modules_(device)
{
}

HiddenInBinary PipelineCreation::hidden() const
{
    return kept_.back().record ? kept_.back().record->hidden : HiddenInBinary{};
}

bool PipelineCreation::changed() const
{
    return stages_.changed() || changed_ || !chains_.empty() ||
           std::ranges::any_of(kept_, [](const Kept &kept) { return kept.record != nullptr; });
}

VkResult PipelineCreation::add(const VkRayTracingPipelineCreateInfoKHR &info, bool accepted)
{
    VkRayTracingPipelineCreateInfoKHR &own = infos_.emplace_back(info);
    kept_.emplace_back();
    const Driver &driver = device_.driver;
    if (!driver.providesMicromaps())
        return passOn(own);
    bool usesMicromaps = (flagsOf(info) & kMicromapPipelineFlag) != 0 || isAssumed(device_, info);
    if (!accepted)
        return VK_ERROR_VALIDATION_FAILED_EXT;
    if (driver.emulated()) {
        if (const VkResult result = chooseAsLibraries(info, usesMicromaps); result != VK_SUCCESS)
            return result;
        if (usesMicromaps)
            return addMicromapPipeline(own);
    }
    // The code of a pipeline of binaries is ignored.
    if (pipelines_ && !usesMicromaps && driver.enabled.anyFeature() && !binariesOf(info.pNext))
        warnOfTracing(info);
    return passOn(own);
}

void PipelineCreation::reserve()
{
    for (Kept &kept : kept_)
        if (kept.record)
            kept.entry = device_.rayTracingPipelines.entry(kept.record);
}

void PipelineCreation::finish() noexcept
{
    for (const Feedback &feedback : feedback_)
        std::copy_n(feedback.own.begin(), std::min<size_t>(feedback.count, feedback.own.size()), feedback.application);
    for (size_t i = 0; i < kept_.size(); ++i) {
        Kept &kept = kept_[i];
        if (kept.withoutMicromaps && pipelines_[i])
            device_.librariesWithoutMicromaps.set(pipelines_[i], std::move(kept.withoutMicromaps));
        if (!kept.record || !pipelines_[i])
            continue;
        if (kept.record->hasNullGroup)
            writeStandIn(device_, pipelines_[i], *kept.record);
        measureStacks(device_, pipelines_[i], kept.ownAnyHitGroups);
        device_.rayTracingPipelines.set(pipelines_[i], std::move(kept.entry));
    }
}

// --- messages and checks ---

std::string PipelineCreation::message(const std::string &text) const
{
    return std::string(kCommand) + ": pipeline " + std::to_string(infos_.size() - 1) + " " + text;
}

// A pipeline and its libraries must agree in the micromap bit. If not, the libraries, whose shaders are already
// rewritten, set `usesMicromaps`.
VkResult PipelineCreation::chooseAsLibraries(const VkRayTracingPipelineCreateInfoKHR &info, bool &usesMicromaps)
{
    const auto usesOf = [&](VkPipeline library) { return device_.rayTracingPipelines.get(library) != nullptr; };
    const std::span<const VkPipeline> libraries = librariesOf(info);
    const bool with = std::ranges::any_of(libraries, usesOf);
    if (std::ranges::all_of(libraries, usesOf)) {
        usesMicromaps = usesMicromaps || with;
        return VK_SUCCESS;
    }
    usesMicromaps = false;
    if (!with)
        return VK_SUCCESS;
    device_.driver.report().notAvailable("a ray tracing pipeline of libraries with and without the micromap bit");
    return VK_ERROR_UNKNOWN;
}

// A pipeline without the micromap bit is harmless if it meets no micromaps. Some applications forget the bit, such
// as those that use NVRHI.
void PipelineCreation::warnOfTracing(const VkRayTracingPipelineCreateInfoKHR &info)
{
    constexpr const char *kId = "VELLUM-pipeline-without-micromaps";
    bool isFirst = false;
    for (const VkPipelineShaderStageCreateInfo &stage : std::span(info.pStages, info.stageCount)) {
        if (!tracedBy(device_, stage).traces)
            continue;
        const auto module = device_.rayTracingModules.get(stage.module);
        const uint64_t hash =
            module && module->original != 0 ? module->original : ShaderWarnings::hashOf(stageCode(device_, stage));
        isFirst = device_.shaderWarnings.isFirst(kId, hash) || isFirst;
    }
    if (isFirst)
        device_.objects.warnings.warn(
            kId, message("traces rays and was created without RAY_TRACING_OPACITY_MICROMAP: ") +
                     (device_.driver.emulated() ? "where they meet micromaps, every hit on their geometry is non-opaque"
                                                : "they must meet no micromaps") +
                     ". The setting assume_micromaps creates all pipelines with it");
}

// --- structures that differ for the driver ---

// A pipeline whose micromaps, if it has any, are the driver's.
VkResult PipelineCreation::passOn(VkRayTracingPipelineCreateInfoKHR &info)
{
    const bool mayAdd = !device_.driver.emulated() && device_.driver.assumesMicromaps();
    const VkFlags64 added = mayAdd && isAssumed(device_, info) ? kMicromapPipelineFlag : 0;
    const VkFlags64 kind = (flagsOf(info) | added) & (kMicromapPipelineFlag | VK_PIPELINE_CREATE_LIBRARY_BIT_KHR);
    if (pipelines_ && mayAdd && kind == VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) {
        kept_.back().withoutMicromaps = DevicePipelines::Flagged::entry(true);
        changed_ = true; // so that finish() is called
    }
    if (!changeFlags(info, unknownPipelineFlags(device_.driver), added))
        return VK_ERROR_INITIALIZATION_FAILED;
    if (!binariesOf(info.pNext) && !stages_.rewrite(info.pStages, info.stageCount))
        return VK_ERROR_UNKNOWN;
    return replaceIdentifiers(info);
}

bool PipelineCreation::changeFlags(VkRayTracingPipelineCreateInfoKHR &info, VkFlags64 removed, VkFlags64 added)
{
    const VkPipelineCreateFlags application = info.flags;
    const bool done = changePipelineFlags(device_.driver, info.pNext, info.flags, removed, added, chains_, kCommand);
    changed_ = changed_ || info.flags != application;
    return done;
}

// Replaces module identifiers of stages without code by the driver's.
VkResult PipelineCreation::replaceIdentifiers(VkRayTracingPipelineCreateInfoKHR &info)
{
    if (binariesOf(info.pNext))
        return VK_SUCCESS;
    DriverIdentifiers &identifiers = identifiers_.emplace_back(device_);
    identifiers.replace(info.pStages, info.stageCount, true);
    changed_ = changed_ || identifiers.any();
    return identifiers.variants() == 0 ? VK_PIPELINE_COMPILE_REQUIRED : VK_SUCCESS;
}

// The driver writes feedback for each of its stages (VUID-...-pipelineStageCreationFeedbackCount-06652), of which
// there may be more than the application's.
VkResult PipelineCreation::reserveFeedback(VkRayTracingPipelineCreateInfoKHR &info)
{
    constexpr VkStructureType type = VK_STRUCTURE_TYPE_PIPELINE_CREATION_FEEDBACK_CREATE_INFO;
    const auto *application = findInChain<VkPipelineCreationFeedbackCreateInfo>(info.pNext, type);
    if (!application || application->pipelineStageCreationFeedbackCount == 0)
        return VK_SUCCESS;
    Chain &chain = chains_.emplace_back(info.pNext);
    auto *own = chain.edit<VkPipelineCreationFeedbackCreateInfo>(type);
    if (!own) {
        device_.driver.report().error(
            "VELLUM-pipeline-feedback",
            message("has VkPipelineCreationFeedbackCreateInfo behind a structure of unknown size"));
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

// The layer's any-hit shaders read the barycentrics, even if no shader of the application does, and payloads may
// have a prefix.
void PipelineCreation::widenInterface(VkRayTracingPipelineCreateInfoKHR &info, const spirv::HiddenFlags &hidden)
{
    constexpr uint32_t kBarycentricsBytes = 8;
    constexpr uint32_t kPrefixBytes = 8; // with padding before the payload
    if (!info.pLibraryInterface)
        return;
    VkRayTracingPipelineInterfaceCreateInfoKHR &own = interfaces_.emplace_back(*info.pLibraryInterface);
    own.maxPipelineRayHitAttributeSize = std::max(own.maxPipelineRayHitAttributeSize, kBarycentricsBytes);
    if (hidden.inPayload())
        own.maxPipelineRayPayloadSize += std::min(kPrefixBytes, UINT32_MAX - own.maxPipelineRayPayloadSize);
    info.pLibraryInterface = &own;
}

// --- pipelines that use emulated micromaps ---

// Notes in `record` which hit records the rays of the pipeline may read. Returns the ray flags of its own stages.
spirv::TracedFlags PipelineCreation::traceStages(const VkRayTracingPipelineCreateInfoKHR &info,
                                                 RayTracingPipeline &record)
{
    spirv::TracedFlags traced;
    for (const VkPipelineShaderStageCreateInfo &stage : std::span(info.pStages, info.stageCount))
        traced.add(tracedBy(device_, stage));
    record.mostStride = traced.mostStride;
    record.hasBoxes = std::any_of(info.pGroups, info.pGroups + info.groupCount, [](const auto &group) {
        return group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR;
    });
    for (const VkPipeline library : librariesOf(info)) {
        if (const auto known = device_.rayTracingPipelines.get(library)) {
            record.hasBoxes = record.hasBoxes || known->hasBoxes;
            record.mostStride = std::max(record.mostStride, known->mostStride);
        }
    }
    return traced;
}

// How hidden ray flags reach the shaders of a ray. They are constants where all rays have the same, as in most
// pipelines. The rays of libraries are not known when the shaders are rewritten.
spirv::HiddenFlags PipelineCreation::hiddenFlags(const VkRayTracingPipelineCreateInfoKHR &info,
                                                 const spirv::TracedFlags &traced)
{
    if (const VkPipelineBinaryInfoKHR *binaries = binariesOf(info.pNext)) {
        // Unknown for binaries of a pipeline without micromaps.
        if (const HiddenInBinary kept = hiddenFlagsIn(device_, *binaries); kept.known)
            return {kept.fixed, kept.constant};
    }
    const bool complete = device_.driver.settings->constantRayFlags && librariesOf(info).empty() &&
                          (flagsOf(info) & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) == 0;
    return complete ? spirv::HiddenFlags{traced.fixed, traced.constant} : spirv::HiddenFlags{.fixed = 0};
}

VkResult PipelineCreation::addMicromapPipeline(VkRayTracingPipelineCreateInfoKHR &info)
{
    const VkFlags64 flags = flagsOf(info);
    const bool isLibrary = (flags & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) != 0;
    kept_.back().record = std::make_shared<RayTracingPipeline>();
    RayTracingPipeline &record = *kept_.back().record;
    record.ownGroups = info.groupCount;
    record.hasNullGroup = !isLibrary && (flags & VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR) == 0;
    if (pipelines_ && record.hasNullGroup) {
        record.standIn = PooledMemory(device_.buffers.hitRecords, kGroupHandleBytes);
        if (!record.standIn.address())
            return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    }
    StageRewrite rewrite;
    rewrite.hidden = hiddenFlags(info, traceStages(info, record));
    rewrite.hasCode = !binariesOf(info.pNext);
    rewrite.forLibrary = isLibrary;
    if (!changeFlags(info, unknownPipelineFlags(device_.driver) | kNoNullShaderFlags, 0))
        return VK_ERROR_INITIALIZATION_FAILED;
    if (rewrite.hidden.inPayload()) {
        record.payloads = payloadTypes(device_, info, rewrite.payloads);
        // Other pipelines may trace rays with other payloads to the groups of a library.
        if (!isLibrary)
            rewrite.hidden.payload = record.payloads.common();
    }
    record.hidden = {true, rewrite.hidden.fixed, rewrite.hidden.constant};
    if (!checkFlagTransport(device_, info, rewrite.hidden))
        return VK_ERROR_UNKNOWN;
    widenInterface(info, rewrite.hidden);
    MicromapStages &own = micromapStages_.emplace_back(device_, modules_, std::move(rewrite));
    if (const VkResult result = own.add(info, record.hasNullGroup); result != VK_SUCCESS)
        return result;
    if (isLibrary)
        own.noteStages(record);
    kept_.back().ownAnyHitGroups = own.ownAnyHitGroups;
    info.stageCount = static_cast<uint32_t>(own.stages.size());
    info.pStages = own.stages.data();
    info.groupCount = static_cast<uint32_t>(own.groups.size());
    info.pGroups = own.groups.data();
    return reserveFeedback(info);
}

VkResult
withDriverInfo(DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
               const std::function<VkResult(const VkRayTracingPipelineCreateInfoKHR &, const HiddenInBinary &)> &use)
{
    PipelineCreation creation(device, nullptr);
    const VkResult result = creation.add(info, checked(device, 1, &info).accepted[0]);
    return result == VK_SUCCESS ? use(creation.infos().front(), creation.hidden()) : result;
}

VkResult createRayTracingPipelines(DevicePipelines &device, VkDevice handle, VkDeferredOperationKHR operation,
                                   VkPipelineCache cache, uint32_t count,
                                   const VkRayTracingPipelineCreateInfoKHR *infos,
                                   const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    std::fill_n(pipelines, count, VK_NULL_HANDLE);
    auto creation = std::make_unique<PipelineCreation>(device, pipelines);
    const input::Pipelines verdicts = checked(device, count, infos);
    const std::vector<VkResult> prepared = prepareEach(std::span(infos, count), [&](const auto &info) {
        return creation->add(info, verdicts.accepted[static_cast<size_t>(&info - infos)]);
    });
    creation->reserve();
    const auto create = [&](VkDeferredOperationKHR deferral, uint32_t some,
                            const VkRayTracingPipelineCreateInfoKHR *driverInfos, VkPipeline *created) {
        return device.driver.next.CreateRayTracingPipelinesKHR(handle, deferral, cache, some, driverInfos, allocator,
                                                               created);
    };
    if (!allSucceeded(prepared)) {
        const VkResult result = createPrepared(std::span(creation->infos()), prepared, pipelines,
                                               [&](auto... arguments) { return create(VK_NULL_HANDLE, arguments...); });
        creation->finish();
        return result;
    }
    if (!creation->changed())
        return create(operation, count, infos, pipelines);
    std::shared_ptr<DeferredOperation> deferred; // allocated before the driver's call
    if (operation) {
        deferred = std::make_shared<DeferredOperation>();
        device.commands.deferredOperations.set(operation, deferred);
    }
    const VkResult result = create(operation, count, creation->infos().data(), pipelines);
    if (result == VK_OPERATION_DEFERRED_KHR && deferred)
        deferred->work = std::move(creation);
    else
        creation->finish();
    return result;
}

} // namespace vellum::layer
