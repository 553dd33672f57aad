// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/micromap_stages.h"

#include <set>

#include "layer/base/pipeline_info.h"
#include "layer/pipelines/device_pipelines.h"
#include "spirv/module/numbers.h"

#include "shaders/any_hit.h"

namespace vellum::layer
{
namespace
{

using spirv::Prologue;

Prologue hitPrologue(const VkRayTracingShaderGroupCreateInfoKHR &group)
{
    return group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR ? Prologue::BoxHits
                                                                                   : Prologue::TriangleHits;
}

// For a stage that no group of its pipeline names.
Prologue prologueFor(VkShaderStageFlagBits stage)
{
    return stage == VK_SHADER_STAGE_ANY_HIT_BIT_KHR        ? Prologue::EitherHits
           : stage == VK_SHADER_STAGE_INTERSECTION_BIT_KHR ? Prologue::BoxCulling
                                                           : Prologue::None;
}

} // namespace

RewrittenModules::~RewrittenModules()
{
    for (const auto &[key, module] : modules_) {
        if (module)
            device_.driver.next.DestroyShaderModule(device_.driver.handle, module, nullptr);
    }
}

VkResult RewrittenModules::rewrite(VkPipelineShaderStageCreateInfo &stage, Prologue prologue,
                                   const spirv::HiddenFlags &hidden)
{
    const spirv::PipelineStage target{stage.pName, executionModelOf(stage.stage).value_or(0), prologue, hidden};
    const auto original = device_.rayTracingModules.get(stage.module);
    if (!original) {
        bool inlined = false;
        if (!inlined_.rewriteInline(stage, inlined, target))
            return VK_ERROR_UNKNOWN;
        return inlined ? VK_SUCCESS : VK_PIPELINE_COMPILE_REQUIRED;
    }
    VkShaderModule &module =
        modules_[{stage.module, stage.stage, prologue, hidden, std::string(stage.pName)}]; // null until created
    if (!module) {
        const uint32_t *code = original->words.data();
        size_t bytes = original->words.size() * 4;
        SharedWords storage;
        if (!rewriteShader(device_, code, bytes, storage, target))
            return VK_ERROR_UNKNOWN;
        if (const VkResult result = create({code, bytes / 4}, module); result != VK_SUCCESS)
            return result;
    }
    stage.module = module;
    return VK_SUCCESS;
}

VkShaderModule RewrittenModules::ownAnyHit(Prologue prologue, const spirv::HiddenFlags &hidden)
{
    VkShaderModule &module = modules_[{VK_NULL_HANDLE, VK_SHADER_STAGE_ANY_HIT_BIT_KHR, prologue, hidden, "main"}];
    if (module)
        return module;
    const spirv::PipelineStage stage{"main", spv::ExecutionModelAnyHitKHR, prologue, hidden};
    const auto result = device_.rewriteCache.rewrite(any_hit, rewriteOptions(device_, stage));
    if (result->status != spirv::RewriteResult::Status::Rewritten || create(result->words, module) != VK_SUCCESS)
        device_.driver.report().error("VELLUM-any-hit-shader",
                                      "the driver could not create the module of the layer's any-hit shader");
    return module;
}

VkResult RewrittenModules::create(std::span<const uint32_t> words, VkShaderModule &module)
{
    const VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0, words.size_bytes(),
                                        words.data()};
    VkShaderModule created = VK_NULL_HANDLE;
    const VkResult result = device_.driver.next.CreateShaderModule(device_.driver.handle, &info, nullptr, &created);
    if (result == VK_SUCCESS)
        module = created;
    return result;
}

spirv::PayloadTypes payloadTypes(const DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
                                 std::vector<std::optional<spirv::TypeWords>> &incoming)
{
    spirv::PayloadTypes types;
    for (uint32_t i = 0; i < info.stageCount; ++i)
        incoming.push_back(types.add(stageCode(device, info.pStages[i]), info.pStages[i].pName,
                                     executionModelOf(info.pStages[i].stage).value_or(0)));
    for (uint32_t i = 0; info.pLibraryInfo && i < info.pLibraryInfo->libraryCount; ++i) {
        const auto library = device.rayTracingPipelines.get(info.pLibraryInfo->pLibraries[i]);
        if (!library)
            continue;
        types.add(library->payloads);
        for (const LibraryStage &stage : library->stages)
            incoming.push_back(stage.payload);
    }
    // A pipeline of binaries, whose stages may have no code, must have the same stages as the one that they come from.
    if (device.driver.next.CreatePipelineBinariesKHR)
        incoming.clear();
    return types;
}

VkResult MicromapStages::add(const VkRayTracingPipelineCreateInfoKHR &info, bool addNullGroup)
{
    groups.assign(info.pGroups, info.pGroups + info.groupCount);
    if (addNullGroup) {
        VkRayTracingShaderGroupCreateInfoKHR group{VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR};
        group.type = VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR;
        group.generalShader = group.closestHitShader = group.intersectionShader = VK_SHADER_UNUSED_KHR;
        group.anyHitShader = VK_SHADER_UNUSED_KHR;
        groups.push_back(group);
    }
    if (const VkResult result = addStages(info); result != VK_SUCCESS)
        return result;
    for (uint32_t i = 0; i < groups.size(); ++i) {
        if (groups[i].type == VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR ||
            groups[i].anyHitShader != VK_SHADER_UNUSED_KHR)
            continue;
        ownAnyHitGroups.push_back(i);
        if (!addOwnAnyHit(keyOf(VK_SHADER_UNUSED_KHR, hitPrologue(groups[i]), groups[i])))
            return VK_ERROR_OUT_OF_HOST_MEMORY;
    }
    addLibraries(info); // once all stages of the pipeline are known
    for (VkRayTracingShaderGroupCreateInfoKHR &group : groups) {
        if (!setShaders(group))
            return VK_ERROR_VALIDATION_FAILED_EXT;
    }
    return VK_SUCCESS;
}

// The payload type of the rays that reach a group. Its shaders declare it, and all shaders of a ray must declare the
// same (VUID-RuntimeSpirv-OpTraceRayKHR-11855).
spirv::TypeWords MicromapStages::payloadOf(const VkRayTracingShaderGroupCreateInfoKHR &group) const
{
    if (group.type != VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR)
        for (const uint32_t shader : {group.closestHitShader, group.anyHitShader})
            if (shader < rewrite_.payloads.size() && rewrite_.payloads[shader])
                return *rewrite_.payloads[shader];
    return rewrite_.hidden.payload;
}

MicromapStages::Key MicromapStages::keyOf(uint32_t stage, Prologue prologue,
                                          const VkRayTracingShaderGroupCreateInfoKHR &group) const
{
    const bool needsNoPayload =
        prologue == Prologue::BoxCulling || (stage < rewrite_.payloads.size() && rewrite_.payloads[stage]);
    return {stage, prologue, needsNoPayload ? spirv::TypeWords{} : payloadOf(group)};
}

Prologue MicromapStages::anyHitPrologue(const VkRayTracingShaderGroupCreateInfoKHR &group) const
{
    return rewrite_.forLibrary ? Prologue::EitherHits : hitPrologue(group);
}

spirv::HiddenFlags MicromapStages::hiddenFor(const Key &key) const
{
    return {rewrite_.hidden.fixed, rewrite_.hidden.constant, std::get<spirv::TypeWords>(key)};
}

// Adds each stage of the application once for each key that its groups need. The first keeps the stage's index. In a
// library that is the one that groups of other pipelines name: where such a stage declares no payload and the library's
// groups need it with several payload types, it has the first of these.
VkResult MicromapStages::addStages(const VkRayTracingPipelineCreateInfoKHR &info)
{
    std::vector<std::set<Key>> needed(info.stageCount);
    for (uint32_t g = 0; g < info.groupCount; ++g) {
        const VkRayTracingShaderGroupCreateInfoKHR &group = info.pGroups[g];
        const auto need = [&](uint32_t stage, Prologue prologue) {
            if (stage < info.stageCount)
                needed[stage].insert(keyOf(stage, prologue, group));
        };
        if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR) {
            need(group.generalShader, Prologue::None);
            continue;
        }
        need(group.closestHitShader, Prologue::None);
        need(group.anyHitShader, anyHitPrologue(group));
        if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR)
            need(group.intersectionShader, Prologue::BoxCulling);
    }
    stages.assign(info.pStages, info.pStages + info.stageCount);
    for (uint32_t i = 0; i < info.stageCount; ++i) {
        if (needed[i].empty())
            needed[i].insert({i, prologueFor(info.pStages[i].stage), {}});
        bool first = true;
        for (const Key &key : needed[i]) {
            const uint32_t at = first ? i : static_cast<uint32_t>(stages.size());
            if (!first)
                stages.push_back(info.pStages[i]);
            first = false;
            const VkResult result =
                rewrite_.hasCode ? modules_.rewrite(stages[at], std::get<Prologue>(key), hiddenFor(key)) : VK_SUCCESS;
            if (result != VK_SUCCESS)
                return result;
            index_[key] = at;
        }
    }
    return VK_SUCCESS;
}

// Adds the layer's any-hit shader. False if its module cannot be created.
bool MicromapStages::addOwnAnyHit(const Key &key)
{
    const auto [known, isNew] = index_.try_emplace(key, static_cast<uint32_t>(stages.size()));
    if (!isNew)
        return true;
    const VkShaderModule module = modules_.ownAnyHit(std::get<Prologue>(key), hiddenFor(key));
    if (!module)
        return false;
    stages.push_back({VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, nullptr, 0, VK_SHADER_STAGE_ANY_HIT_BIT_KHR,
                      module, "main", nullptr});
    return true;
}

void MicromapStages::addLibraries(const VkRayTracingPipelineCreateInfoKHR &info)
{
    const auto payloadOfNamed = [&] {
        const size_t i = namedStages_.size();
        return i < rewrite_.payloads.size() ? rewrite_.payloads[i] : std::nullopt;
    };
    for (uint32_t i = 0; i < info.stageCount; ++i)
        namedStages_.push_back({i, payloadOfNamed()});
    driverStages_ = static_cast<uint32_t>(stages.size());
    for (uint32_t i = 0; info.pLibraryInfo && i < info.pLibraryInfo->libraryCount; ++i) {
        const auto library = device_.rayTracingPipelines.get(info.pLibraryInfo->pLibraries[i]);
        if (!library)
            continue;
        for (const LibraryStage &stage : library->stages)
            namedStages_.push_back({driverStages_ + stage.driverStage, payloadOfNamed()});
        driverStages_ += library->driverStages;
    }
}

void MicromapStages::noteStages(RayTracingPipeline &library) const
{
    library.stages = namedStages_;
    library.driverStages = driverStages_;
}

// Gives a group the indices of the driver's stages. False if it names a stage that there is not.
bool MicromapStages::setShaders(VkRayTracingShaderGroupCreateInfoKHR &group) const
{
    const VkRayTracingShaderGroupCreateInfoKHR application = group;
    bool known = true;
    const auto driverStage = [&](uint32_t stage, Prologue prologue) {
        if (const auto found = index_.find(keyOf(stage, prologue, application)); found != index_.end())
            return found->second;
        if (stage < namedStages_.size())
            return namedStages_[stage].driverStage;
        known = known && stage == VK_SHADER_UNUSED_KHR;
        return VK_SHADER_UNUSED_KHR;
    };
    if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR) {
        group.generalShader = driverStage(application.generalShader, Prologue::None);
    } else {
        const bool isOwn = application.anyHitShader == VK_SHADER_UNUSED_KHR;
        group.closestHitShader = driverStage(application.closestHitShader, Prologue::None);
        group.anyHitShader = driverStage(application.anyHitShader, isOwn ? hitPrologue(group) : anyHitPrologue(group));
        if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR)
            group.intersectionShader = driverStage(application.intersectionShader, Prologue::BoxCulling);
    }
    if (!known)
        device_.driver.report().error("VELLUM-pipeline-group",
                                      "vkCreateRayTracingPipelinesKHR: a group names a stage that neither the pipeline "
                                      "nor its libraries have");
    return known;
}

} // namespace vellum::layer
