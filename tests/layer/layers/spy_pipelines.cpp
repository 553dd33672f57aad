// SPDX-License-Identifier: Apache-2.0
// Pipelines of all kinds, shader objects, and stack sizes.
#include "layers/spy.h"

#include "spirv/module/numbers.h"
#include "spirv/module/scan.h"
#include "spirv/payload_types.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <utility>

namespace spy
{
namespace
{

// Flags of a pipeline, from wherever it has them.
VkFlags64 pipelineFlags(const void *pNext, VkPipelineCreateFlags flags)
{
    const auto *flags2 = static_cast<const VkPipelineCreateFlags2CreateInfoKHR *>(
        inChain(pNext, VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR));
    return flags2 != nullptr ? flags2->flags : VkFlags64{flags};
}
constexpr VkFlags64 kDisallowMicromaps = VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM;
constexpr VkFlags64 kDisallowMixed = VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;

// Flags that no kind of pipeline may have.
void expectPromises(const char *where, VkFlags64 flags)
{
    if ((flags & kDisallowMicromaps) != 0)
        report(std::string(where) + ": DISALLOW_OPACITY_MICROMAP_BIT_ARM");
    if ((flags & kDisallowMixed) != 0)
        report(std::string(where) + ": OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR");
}

// --- modules ---

void expectModule(void *key, const char *where, const void *code, size_t size)
{
    constexpr uint32_t kExtension = 10, kExecutionModeId = 331, kCapability = 17; // Op...
    const std::span words(static_cast<const uint32_t *>(code), size / sizeof(uint32_t));
    for (size_t at = 5; at < words.size() && words[at] >> 16 != 0; at += words[at] >> 16) {
        const uint32_t opcode = words[at] & 0xffff, length = words[at] >> 16;
        if (opcode == kExtension) {
            const std::string_view name(reinterpret_cast<const char *>(&words[at + 1]));
            if (name == "SPV_KHR_opacity_micromap" || (name == "SPV_EXT_opacity_micromap" && !knowsMicromaps(key)))
                report(std::string(where) + ": a module with " + std::string(name));
        }
        if (opcode == kCapability && length == 2) {
            constexpr uint32_t kMicromap = 5381, kExecutionMode = 6032; // RayTracingOpacityMicromap...
            if (words[at + 1] == kExecutionMode || (words[at + 1] == kMicromap && !knowsMicromaps(key)))
                report(std::string(where) + ": a module with the capability " + std::to_string(words[at + 1]));
        }
        if (opcode == kExecutionModeId && length > 2 && words[at + 2] == 6031)
            report(std::string(where) + ": a module with OpacityMicromapIdKHR");
    }
}

void expectStageModules(void *key, const char *where, std::span<const VkPipelineShaderStageCreateInfo> stages)
{
    for (const VkPipelineShaderStageCreateInfo &stage : stages) {
        if (const auto *module =
                inChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO))
            expectModule(key, where, module->pCode, module->codeSize);
    }
}

std::map<VkShaderModule, std::vector<uint32_t>> rayModules; // words of modules with ray tracing stages

// A stage that groups may name: of a pipeline or of its libraries.
struct KnownStage {
    VkShaderStageFlagBits stage;
    std::optional<vellum::spirv::TypeWords> payload; // of hit shaders
};
std::map<VkPipeline, std::vector<KnownStage>> knownStages;

// "shaders defined in those libraries are treated as if they were defined as additional entries in pStages". Nothing
// where a library was created by a deferred operation.
std::optional<std::vector<KnownStage>> stagesOf(const VkRayTracingPipelineCreateInfoKHR &info)
{
    constexpr uint32_t kAnyHit = 5315, kClosestHit = 5316; // ExecutionModel...
    std::vector<KnownStage> stages;
    std::lock_guard lock(mutex);
    for (const VkPipelineShaderStageCreateInfo &stage : std::span(info.pStages, info.stageCount)) {
        KnownStage &known = stages.emplace_back(stage.stage);
        const auto words = rayModules.find(stage.module);
        vellum::spirv::PayloadTypes types;
        if (words != rayModules.end() && stage.stage == VK_SHADER_STAGE_ANY_HIT_BIT_KHR)
            known.payload = types.add(words->second, stage.pName, kAnyHit);
        else if (words != rayModules.end() && stage.stage == VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR)
            known.payload = types.add(words->second, stage.pName, kClosestHit);
    }
    for (uint32_t i = 0; info.pLibraryInfo != nullptr && i < info.pLibraryInfo->libraryCount; ++i) {
        const auto more = knownStages.find(info.pLibraryInfo->pLibraries[i]);
        if (more == knownStages.end())
            return {};
        stages.insert(stages.end(), more->second.begin(), more->second.end());
    }
    return stages;
}

// Each shader of a group is of its stage, and all of a hit group are called with the payload of the same ray, whose
// type is one (VUID-RuntimeSpirv-OpTraceRayKHR-11855).
void expectGroups(const char *where, const VkRayTracingPipelineCreateInfoKHR &info,
                  const std::vector<KnownStage> &stages)
{
    constexpr VkShaderStageFlags kGeneral =
        VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_MISS_BIT_KHR | VK_SHADER_STAGE_CALLABLE_BIT_KHR;
    const auto expectStage = [&](uint32_t stage, VkShaderStageFlags allowed) {
        if (stage != VK_SHADER_UNUSED_KHR &&
            (stage >= stages.size() || (VkShaderStageFlags{stages[stage].stage} & allowed) == 0))
            report(std::string(where) + ": a group names stage " + std::to_string(stage) +
                   ", which is of another kind");
    };
    const auto payloadOf = [&](uint32_t stage) { return stage < stages.size() ? stages[stage].payload : std::nullopt; };
    for (const VkRayTracingShaderGroupCreateInfoKHR &group : std::span(info.pGroups, info.groupCount)) {
        if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR) {
            expectStage(group.generalShader, kGeneral);
            continue;
        }
        expectStage(group.closestHitShader, VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR);
        expectStage(group.anyHitShader, VK_SHADER_STAGE_ANY_HIT_BIT_KHR);
        expectStage(group.intersectionShader, VK_SHADER_STAGE_INTERSECTION_BIT_KHR);
        const auto anyHit = payloadOf(group.anyHitShader);
        const auto closestHit = payloadOf(group.closestHitShader);
        if (anyHit && closestHit && *anyHit != *closestHit)
            report(std::string(where) + ": a hit group whose shaders have payloads of different types");
    }
}

VKAPI_ATTR VkResult VKAPI_CALL createShaderModule(VkDevice handle, const VkShaderModuleCreateInfo *info,
                                                  const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    expectModule(keyOf(handle), "vkCreateShaderModule", info->pCode, info->codeSize);
    const VkResult result = SPY_NEXT(vkCreateShaderModule)(handle, info, allocator, module);
    if (result != VK_SUCCESS)
        return result;
    keepWords(*module, *info);
    const std::span words(info->pCode, info->codeSize / sizeof(uint32_t));
    // The validation layer of Debian 12 does not look at it.
    if (std::getenv("VELLUM_TEST_VULKAN") != nullptr && words[1] > vellum::spirv::kVersion14)
        report("vkCreateShaderModule: SPIR-V that is newer than the program's Vulkan 1.1 with VK_KHR_spirv_1_4 "
               "(VUID-VkShaderModuleCreateInfo-pCode-08737)");
    std::lock_guard lock(mutex);
    rayModules.erase(*module);
    if (vellum::spirv::scan(words).hasStages)
        rayModules[*module] = {words.begin(), words.end()};
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createComputePipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                      const VkComputePipelineCreateInfo *infos,
                                                      const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    for (const VkComputePipelineCreateInfo &info : std::span(infos, count)) {
        expectPromises("vkCreateComputePipelines", pipelineFlags(info.pNext, info.flags));
        expectStageModules(keyOf(handle), "vkCreateComputePipelines", {&info.stage, 1});
    }
    const VkResult result = SPY_NEXT(vkCreateComputePipelines)(handle, cache, count, infos, allocator, pipelines);
    for (uint32_t i = 0; i < count; ++i)
        lookInCache(cache, infos[i], pipelines[i]);
    return result;
}

// Of VK_NV_device_generated_commands_compute, which lavapipe has not.
VKAPI_ATTR void VKAPI_CALL getIndirectMemoryRequirements(VkDevice handle, const VkComputePipelineCreateInfo *info,
                                                         VkMemoryRequirements2 *requirements)
{
    expectPromises("vkGetPipelineIndirectMemoryRequirementsNV", pipelineFlags(info->pNext, info->flags));
    expectStageModules(keyOf(handle), "vkGetPipelineIndirectMemoryRequirementsNV", {&info->stage, 1});
    requirements->memoryRequirements = {256, 256, 1};
}

VKAPI_ATTR VkResult VKAPI_CALL createGraphicsPipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                       const VkGraphicsPipelineCreateInfo *infos,
                                                       const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    for (const VkGraphicsPipelineCreateInfo &info : std::span(infos, count)) {
        expectPromises("vkCreateGraphicsPipelines", pipelineFlags(info.pNext, info.flags));
        expectStageModules(keyOf(handle), "vkCreateGraphicsPipelines", {info.pStages, info.stageCount});
        if (const auto *groups = inChain<VkGraphicsPipelineShaderGroupsCreateInfoNV>(
                info.pNext, VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_SHADER_GROUPS_CREATE_INFO_NV))
            for (const VkGraphicsShaderGroupCreateInfoNV &group : std::span(groups->pGroups, groups->groupCount))
                expectStageModules(keyOf(handle), "VkGraphicsShaderGroupCreateInfoNV",
                                   {group.pStages, group.stageCount});
    }
    return SPY_NEXT(vkCreateGraphicsPipelines)(handle, cache, count, infos, allocator, pipelines);
}

struct ShaderCreateInfo { // VkShaderCreateInfoEXT, which older headers lack
    VkStructureType sType;
    const void *pNext;
    VkFlags flags;
    VkShaderStageFlagBits stage;
    VkShaderStageFlags nextStage;
    uint32_t codeType;
    size_t codeSize;
    const void *pCode;
    const char *pName;
    uint32_t setLayoutCount;
    const VkDescriptorSetLayout *pSetLayouts;
    uint32_t pushConstantRangeCount;
    const VkPushConstantRange *pPushConstantRanges;
    const VkSpecializationInfo *pSpecializationInfo;
};

VKAPI_ATTR VkResult VKAPI_CALL createShaders(VkDevice handle, uint32_t count, const ShaderCreateInfo *infos,
                                             const VkAllocationCallbacks *allocator, void *shaders)
{
    constexpr VkFlags disallowMixed = 1u << 12; // ..._OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT
    for (const ShaderCreateInfo &info : std::span(infos, count)) {
        if ((info.flags & disallowMixed) != 0)
            report("vkCreateShadersEXT: OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT");
        constexpr uint32_t spirv = 1; // VK_SHADER_CODE_TYPE_SPIRV_EXT
        if (info.codeType == spirv)
            expectModule(keyOf(handle), "vkCreateShadersEXT", info.pCode, info.codeSize);
    }
    const auto next = nextOfDevice<decltype(&createShaders)>(keyOf(handle), "vkCreateShadersEXT");
    return next(handle, count, infos, allocator, shaders);
}

// --- ray tracing pipelines ---

// The inputs of the specification's formula for the default stack size (raytracing.adoc, "Ray Tracing Pipeline Stack").
struct StackNeed {
    VkDeviceSize raygen = 0, miss = 0, closestHit = 0, anyHit = 0, intersection = 0, callable = 0;
    uint32_t depth = 0;

    void add(const StackNeed &other)
    {
        raygen = std::max(raygen, other.raygen);
        miss = std::max(miss, other.miss);
        closestHit = std::max(closestHit, other.closestHit);
        anyHit = std::max(anyHit, other.anyHit);
        intersection = std::max(intersection, other.intersection);
        callable = std::max(callable, other.callable);
    }
    [[nodiscard]] VkDeviceSize total() const
    {
        const VkDeviceSize hitOrMiss = std::max(closestHit, miss);
        return raygen + std::min(1u, depth) * std::max(hitOrMiss, intersection + anyHit) +
               (depth > 0 ? depth - 1 : 0) * hitOrMiss + 2 * callable;
    }
};
std::map<VkPipeline, StackNeed> stackNeeds;
std::map<VkCommandBuffer, VkPipeline> boundPipelines; // ray tracing

StackNeed stackNeed(VkDevice handle, const VkRayTracingPipelineCreateInfoKHR &info, VkPipeline pipeline,
                    const std::vector<KnownStage> &stages)
{
    const auto sizeOf = SPY_NEXT(vkGetRayTracingShaderGroupStackSizeKHR);
    StackNeed need;
    need.depth = info.maxPipelineRayRecursionDepth;
    for (uint32_t i = 0; i < info.groupCount; ++i) {
        const VkRayTracingShaderGroupCreateInfoKHR &group = info.pGroups[i];
        if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR) {
            const VkDeviceSize size = sizeOf(handle, pipeline, i, VK_SHADER_GROUP_SHADER_GENERAL_KHR);
            const VkShaderStageFlagBits stage =
                group.generalShader < stages.size() ? stages[group.generalShader].stage : VK_SHADER_STAGE_ALL;
            VkDeviceSize &part = stage == VK_SHADER_STAGE_RAYGEN_BIT_KHR ? need.raygen
                                 : stage == VK_SHADER_STAGE_MISS_BIT_KHR ? need.miss
                                                                         : need.callable;
            part = std::max(part, size);
            continue;
        }
        const auto add = [&](uint32_t shader, VkShaderGroupShaderKHR which, VkDeviceSize &part) {
            if (shader != VK_SHADER_UNUSED_KHR)
                part = std::max(part, sizeOf(handle, pipeline, i, which));
        };
        add(group.closestHitShader, VK_SHADER_GROUP_SHADER_CLOSEST_HIT_KHR, need.closestHit);
        add(group.anyHitShader, VK_SHADER_GROUP_SHADER_ANY_HIT_KHR, need.anyHit);
        if (group.type == VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR)
            add(group.intersectionShader, VK_SHADER_GROUP_SHADER_INTERSECTION_KHR, need.intersection);
    }
    std::lock_guard lock(mutex);
    for (uint32_t i = 0; info.pLibraryInfo != nullptr && i < info.pLibraryInfo->libraryCount; ++i)
        need.add(stackNeeds[info.pLibraryInfo->pLibraries[i]]);
    return need;
}

void expectPipeline(void *key, const VkRayTracingPipelineCreateInfoKHR &info)
{
    const VkFlags64 flags = pipelineFlags(info.pNext, info.flags);
    if (!knowsMicromaps(key) && (flags & VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT) != 0)
        report("vkCreateRayTracingPipelinesKHR: VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT");
    expectPromises("vkCreateRayTracingPipelinesKHR", flags);
    expectStageModules(key, "vkCreateRayTracingPipelinesKHR", {info.pStages, info.stageCount});
    if (const auto stages = stagesOf(info))
        expectGroups("vkCreateRayTracingPipelinesKHR", info, *stages);
}

VKAPI_ATTR VkResult VKAPI_CALL createRayTracingPipelines(VkDevice handle, VkDeferredOperationKHR operation,
                                                         VkPipelineCache cache, uint32_t count,
                                                         const VkRayTracingPipelineCreateInfoKHR *infos,
                                                         const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    for (uint32_t i = 0; i < count; ++i)
        expectPipeline(keyOf(handle), infos[i]);
    const VkResult result =
        SPY_NEXT(vkCreateRayTracingPipelinesKHR)(handle, operation, cache, count, infos, allocator, pipelines);
    if (result != VK_SUCCESS && result != VK_OPERATION_NOT_DEFERRED_KHR)
        return result;
    for (uint32_t i = 0; i < count; ++i) {
        lookInCache(cache, infos[i], pipelines[i]);
        const auto stages = stagesOf(infos[i]);
        const StackNeed need = stackNeed(handle, infos[i], pipelines[i], stages.value_or(std::vector<KnownStage>()));
        std::lock_guard lock(mutex);
        stackNeeds[pipelines[i]] = need;
        knownStages.erase(pipelines[i]); // of an earlier pipeline with that handle
        if (stages)
            knownStages.emplace(pipelines[i], *stages);
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL cmdBindPipeline(VkCommandBuffer handle, VkPipelineBindPoint point, VkPipeline pipeline)
{
    if (point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR) {
        std::lock_guard lock(mutex);
        boundPipelines[handle] = pipeline;
    }
    SPY_NEXT(vkCmdBindPipeline)(handle, point, pipeline);
}

// The tests set it after they have bound the pipeline that it is for.
VKAPI_ATTR void VKAPI_CALL cmdSetStackSize(VkCommandBuffer handle, uint32_t size)
{
    VkDeviceSize need = 0;
    {
        std::lock_guard lock(mutex);
        need = stackNeeds[boundPipelines[handle]].total();
    }
    if (size < need)
        report("vkCmdSetRayTracingPipelineStackSizeKHR: " + std::to_string(size) + " bytes where the pipeline needs " +
               std::to_string(need));
    SPY_NEXT(vkCmdSetRayTracingPipelineStackSizeKHR)(handle, size);
}

// --- traces ---

// The memory that the traces of a command buffer with SIMULTANEOUS_USE read. Two queues may execute it at once, so no
// other trace in it may have written the same memory.
struct TracedWith {
    std::vector<VkStridedDeviceAddressRegionKHR> hitTables;
    std::vector<VkDeviceAddress> commands;
    bool copied = false; // by vkCmdCopyBuffer, since the last trace
};
std::map<VkCommandBuffer, TracedWith> tracedWith;

VKAPI_ATTR void VKAPI_CALL cmdCopyBuffer(VkCommandBuffer handle, VkBuffer from, VkBuffer to, uint32_t count,
                                         const VkBufferCopy *regions)
{
    {
        std::lock_guard lock(mutex);
        if (const auto found = tracedWith.find(handle); found != tracedWith.end())
            found->second.copied = true;
    }
    SPY_NEXT(vkCmdCopyBuffer)(handle, from, to, count, regions);
}

VKAPI_ATTR void VKAPI_CALL cmdTraceRays(VkCommandBuffer handle, const VkStridedDeviceAddressRegionKHR *raygen,
                                        const VkStridedDeviceAddressRegionKHR *miss,
                                        const VkStridedDeviceAddressRegionKHR *hit,
                                        const VkStridedDeviceAddressRegionKHR *callable, uint32_t width,
                                        uint32_t height, uint32_t depth)
{
    {
        std::lock_guard lock(mutex);
        if (const auto found = tracedWith.find(handle); found != tracedWith.end()) {
            for (const VkStridedDeviceAddressRegionKHR &other : found->second.hitTables) {
                const bool overlaps = hit->deviceAddress < other.deviceAddress + other.size &&
                                      other.deviceAddress < hit->deviceAddress + hit->size;
                if (overlaps && (hit->deviceAddress != other.deviceAddress || hit->size != other.size))
                    report("vkCmdTraceRaysKHR: hit tables of a command buffer that may run twice at once overlap");
            }
            found->second.hitTables.push_back(*hit);
            // The copy has the application's null records, until a shader replaces them.
            if (std::exchange(found->second.copied, false))
                report("vkCmdTraceRaysKHR: a command buffer that may run twice at once copies a hit table as it is");
        }
    }
    SPY_NEXT(vkCmdTraceRaysKHR)(handle, raygen, miss, hit, callable, width, height, depth);
}

VKAPI_ATTR void VKAPI_CALL cmdTraceRaysIndirect2(VkCommandBuffer handle, VkDeviceAddress command)
{
    {
        std::lock_guard lock(mutex);
        if (const auto found = tracedWith.find(handle); found != tracedWith.end()) {
            if (std::ranges::find(found->second.commands, command) != found->second.commands.end())
                report("vkCmdTraceRaysIndirect2KHR: commands of a command buffer that may run twice at once are one");
            found->second.commands.push_back(command);
        }
    }
    SPY_NEXT(vkCmdTraceRaysIndirect2KHR)(handle, command);
}

} // namespace

void noteUsage(VkCommandBuffer commands, VkCommandBufferUsageFlags usage)
{
    std::lock_guard lock(mutex);
    tracedWith.erase(commands);
    if ((usage & VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT) != 0)
        tracedWith.try_emplace(commands);
}

std::span<const Row> pipelines()
{
    static const Row rows[]{
        {"vkCreateShaderModule", SPY_FUNCTION(createShaderModule)},
        {"vkCreateComputePipelines", SPY_FUNCTION(createComputePipelines)},
        {"vkGetPipelineIndirectMemoryRequirementsNV", SPY_FUNCTION(getIndirectMemoryRequirements), Row::Where::Always},
        {"vkCreateGraphicsPipelines", SPY_FUNCTION(createGraphicsPipelines)},
        {"vkCreateShadersEXT", SPY_FUNCTION(createShaders)},
        {"vkCreateRayTracingPipelinesKHR", SPY_FUNCTION(createRayTracingPipelines)},
        {"vkCmdBindPipeline", SPY_FUNCTION(cmdBindPipeline)},
        {"vkCmdSetRayTracingPipelineStackSizeKHR", SPY_FUNCTION(cmdSetStackSize)},
        {"vkCmdCopyBuffer", SPY_FUNCTION(cmdCopyBuffer)},
        {"vkCmdTraceRaysKHR", SPY_FUNCTION(cmdTraceRays)},
        {"vkCmdTraceRaysIndirect2KHR", SPY_FUNCTION(cmdTraceRaysIndirect2)},
    };
    return rows;
}

} // namespace spy
