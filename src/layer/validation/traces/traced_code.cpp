// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/traces/traced_code.h"

#include <algorithm>

#include "layer/base/pipeline_info.h"
#include "layer/input/checked.h"
#include "layer/input/creations.h"
#include "spirv/module/micromap_mode.h"
#include "spirv/module/scan.h"

namespace vellum::layer
{
namespace
{

constexpr VkFlags64 kMixedPromise = VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;
// Flags of pipelines whose code is unchanged: the application would see that it differs, or its descriptors are not in
// sets.
constexpr VkFlags64 kUntouched = VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT |
                                 VK_PIPELINE_CREATE_RAY_TRACING_SHADER_GROUP_HANDLE_CAPTURE_REPLAY_BIT_KHR |
                                 VK_PIPELINE_CREATE_DESCRIPTOR_BUFFER_BIT_EXT |
                                 VK_PIPELINE_CREATE_2_DESCRIPTOR_HEAP_BIT_EXT |
                                 VkFlags64{0x80000000}      // CAPTURE_DATA_BIT_KHR
                                 | VkFlags64{0x4000000000}; // INDIRECT_BINDABLE_BIT_EXT

// One shader of a pipeline, or a shader object.
struct Stage {
    VkShaderStageFlagBits stage;
    std::span<const uint32_t> words;
    const char *name;
    const VkSpecializationInfo *specialization;
    VkFlags64 flags; // of the pipeline
};

// Returns whether the stage has the execution mode with a true operand; nothing if it is not known.
std::optional<bool> declaresMode(const Stage &stage, const spirv::StageName &name)
{
    std::string error;
    const auto entries = spirv::readEntryPoints(stage.words, error);
    if (!entries)
        return {};
    const auto entry = std::ranges::find_if(*entries, [&name](const spirv::EntryPoint &e) {
        return e.model == name.executionModel && e.name == name.entryPoint;
    });
    return entry == entries->end() ? std::nullopt : valueOf(entry->mode, stage.specialization);
}

// The rules that may be broken where a shader traces rays.
uint32_t rulesOf(const EnabledFeatures &enabled, bool query, bool hasMode, VkFlags64 flags)
{
    const bool hasBit = (flags & VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT) != 0;
    const bool uses = query ? enabled.everyQueryUsesMicromaps() || hasMode : hasBit;
    uint32_t rules = (flags & VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM) != 0 ? kRuleDisallowed : 0;
    if (!uses)
        rules |= query ? kRuleMode : kRulePipelineBit;
    else if ((flags & kMixedPromise) != 0)
        rules |= kRuleMixed;
    return rules;
}

// The trace sites of a shader, and the words of a copy of it with marks. No words: no rule that marks are for can be
// violated, or a violation cannot be found.
struct TracedStage {
    std::vector<TracingSite> sites;
    std::vector<uint32_t> words;
    // The shader stays as it is.
    void removeMarks()
    {
        words.clear();
        for (TracingSite &site : sites)
            site.mark.reset();
    }
};

bool canHaveMarks(const DeviceTraces &traces, const Stage &stage)
{
    return (traces.device.facts.storingStages & static_cast<VkShaderStageFlags>(stage.stage)) != 0 &&
           (stage.flags & kUntouched) == 0;
}

TracedStage tracedStage(DeviceTraces &traces, const Stage &stage)
{
    TracedStage traced;
    const auto model = executionModelOf(stage.stage);
    if (!traces.device.checks.gpu || !model)
        return traced;
    const spirv::StageName name{stage.name, *model};
    const std::vector<spirv::TraceSite> found = spirv::traceSites(stage.words, name);
    if (found.empty())
        return traced;
    const bool hasMode = declaresMode(stage, name).value_or(true), canMark = canHaveMarks(traces, stage);
    std::vector<uint32_t> marks;
    bool any = false;
    for (const spirv::TraceSite &site : found) {
        marks.push_back(UINT32_MAX);
        if (!site.binding)
            continue;
        const uint32_t rules = canMark ? rulesOf(traces.device.driver.enabled, site.query, hasMode, stage.flags) |
                                             (traces.deserializes ? kRuleDeserialized : 0)
                                       : 0;
        const auto mark = rules != 0 ? traces.marks.add(traces.device.buffers.gpu, rules) : nullptr;
        if (mark)
            marks.back() = mark->index();
        any = any || mark;
        traced.sites.push_back({mark, *site.binding, site.cullMask});
    }
    if (any)
        traced.words = spirv::markTraces(stage.words, name, traces.marks.address(), marks);
    if (traced.words.empty())
        traced.removeMarks();
    return traced;
}

} // namespace

MarkedPipelines::~MarkedPipelines()
{
    for (const VkShaderModule module : modules_)
        device_.next.DestroyShaderModule(device_.driver.handle, module, nullptr);
}

void MarkedPipelines::change(VkComputePipelineCreateInfo &info)
{
    begin(info.pNext, info.flags);
    change(info.stage);
}

void MarkedPipelines::change(VkGraphicsPipelineCreateInfo &info)
{
    begin(info.pNext, info.flags);
    if (hasShaderStages(info) && info.pStages)
        change(info.pStages, info.stageCount);
    addLibraries(
        findInChain<VkPipelineLibraryCreateInfoKHR>(info.pNext, VK_STRUCTURE_TYPE_PIPELINE_LIBRARY_CREATE_INFO_KHR));
}

void MarkedPipelines::change(VkRayTracingPipelineCreateInfoKHR &info)
{
    begin(info.pNext, info.flags);
    change(info.pStages, info.stageCount);
    addLibraries(info.pLibraryInfo);
}

void MarkedPipelines::prepare()
{
    for (Made &made : made_) {
        if (made.sites.empty())
            continue;
        made.code = std::make_shared<TracingCode>();
        made.code->sites = std::move(made.sites);
        made.entry = traces_.pipelines.entry(made.code);
    }
}

void MarkedPipelines::set(uint32_t count, const VkPipeline *pipelines)
{
    for (uint32_t i = 0; i < count; ++i) {
        if (!pipelines[i])
            continue;
        Made &made = made_[i];
        if (!made.code)
            continue;
        made.code->handle = {VK_OBJECT_TYPE_PIPELINE, reinterpret_cast<uint64_t>(pipelines[i])};
        traces_.pipelines.set(pipelines[i], std::move(made.entry));
    }
}

void MarkedPipelines::begin(const void *pNext, VkPipelineCreateFlags flags)
{
    made_.push_back({.flags = pipelineFlags(pNext, flags),
                     .binaries = findInChain(pNext, VK_STRUCTURE_TYPE_PIPELINE_BINARY_INFO_KHR) != nullptr,
                     .sites = {},
                     .code = {},
                     .entry = {}});
}

void MarkedPipelines::change(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count)
{
    auto &own = stages_.emplace_back(stages, stages + count);
    for (VkPipelineShaderStageCreateInfo &stage : own)
        change(stage);
    stages = own.data();
}

void MarkedPipelines::change(VkPipelineShaderStageCreateInfo &stage)
{
    Made &made = made_.back();
    const auto *inlined =
        findInChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    const auto known = stage.module ? device_.objects.modules.get(stage.module) : nullptr;
    if (made.binaries || (!known && (stage.module || !inlined)))
        return;
    const std::span<const uint32_t> words =
        known ? std::span(*known) : std::span(inlined->pCode, inlined->codeSize / 4);
    const Stage code{stage.stage, words, stage.pName, stage.pSpecializationInfo, made.flags};
    TracedStage traced = tracedStage(traces_, code);
    if (!traced.words.empty() && !useCopy(stage, words, traced.words))
        traced.removeMarks();
    made.sites.insert(made.sites.end(), traced.sites.begin(), traced.sites.end());
}

bool MarkedPipelines::useCopy(VkPipelineShaderStageCreateInfo &stage, std::span<const uint32_t> original,
                              std::span<const uint32_t> words)
{
    VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    info.codeSize = words.size_bytes();
    info.pCode = words.data();
    input::OriginalCode code{original}; // the implementation warns of each code once
    const input::Checked checked(info.pCode, code);
    VkShaderModule &module = modules_.emplace_back(VK_NULL_HANDLE);
    if (device_.next.CreateShaderModule(device_.driver.handle, &info, nullptr, &module) != VK_SUCCESS) {
        modules_.pop_back();
        return false;
    }
    stage.module = module;
    Chain &chain = chains_.emplace_back(stage.pNext);
    chain.remove(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    stage.pNext = chain.head();
    return true;
}

void MarkedPipelines::addLibraries(const VkPipelineLibraryCreateInfoKHR *libraries)
{
    std::vector<TracingSite> &sites = made_.back().sites;
    for (uint32_t i = 0; libraries && i < libraries->libraryCount; ++i)
        if (const auto code = traces_.pipelines.get(libraries->pLibraries[i]))
            sites.insert(sites.end(), code->sites.begin(), code->sites.end());
}

void MarkedShaders::change(VkShaderCreateInfoEXT &info)
{
    constexpr auto kPromise =
        static_cast<VkFlags>(VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT);
    auto &code = codes_.emplace_back();
    auto &entry = entries_.emplace_back();
    if (info.codeType != VK_SHADER_CODE_TYPE_SPIRV_EXT)
        return;
    const VkFlags64 flags = (info.flags & kPromise) != 0 ? kMixedPromise : 0;
    code = std::make_shared<TracingCode>();
    code->shaderObject = true;
    const std::span<const uint32_t> words(static_cast<const uint32_t *>(info.pCode), info.codeSize / 4);
    TracedStage traced = tracedStage(traces_, {info.stage, words, info.pName, info.pSpecializationInfo, flags});
    if (traced.sites.empty())
        return;
    code->sites = std::move(traced.sites);
    entry = traces_.shaders.entry(code);
    if (traced.words.empty())
        return;
    words_.push_back(std::move(traced.words));
    info.pCode = words_.back().data();
    info.codeSize = words_.back().size() * sizeof(uint32_t);
}

void MarkedShaders::set(uint32_t count, const VkShaderEXT *shaders)
{
    for (uint32_t i = 0; i < count; ++i) {
        if (!shaders[i] || entries_[i].empty())
            continue;
        codes_[i]->handle = {static_cast<VkObjectType>(1000482000), reinterpret_cast<uint64_t>(shaders[i])};
        traces_.shaders.set(shaders[i], std::move(entries_[i]));
    }
}

} // namespace vellum::layer
