// SPDX-License-Identifier: Apache-2.0
#include "gpu/pipeline_tracer.h"

#include <algorithm>
#include <array>

#include "gpu/launch.h"
#include "shaders/pipeline_decoy_any_hit.h"
#include "shaders/pipeline_decoy_closest_hit.h"
#include "shaders/pipeline_decoy_intersection.h"
#include "shaders/pipeline_decoy_miss.h"
#include "shaders/pipeline_launcher.h"
#include "shaders/pipeline_tracer_any_hit.h"
#include "shaders/pipeline_tracer_array_any_hit.h"
#include "shaders/pipeline_tracer_array_closest_hit.h"
#include "shaders/pipeline_tracer_array_intersection.h"
#include "shaders/pipeline_tracer_callable.h"
#include "shaders/pipeline_tracer_closest_hit.h"
#include "shaders/pipeline_tracer_intersection.h"
#include "shaders/pipeline_tracer_miss.h"
#include "shaders/pipeline_tracer_raygen.h"
#include "shaders/pipeline_tracer_scalars_any_hit.h"
#include "shaders/pipeline_tracer_scalars_closest_hit.h"
#include "shaders/pipeline_tracer_scalars_intersection.h"
#include "shaders/pipeline_tracer_wide_any_hit.h"
#include "shaders/pipeline_tracer_wide_closest_hit.h"
#include "shaders/pipeline_tracer_wide_intersection.h"

namespace vellum::gpu
{
namespace
{

constexpr VkBufferUsageFlags kStorageWithAddress =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

struct More {
    uint32_t visits, hitKind, record, invocations, intact, called, pad[2];
};
static_assert(sizeof(CandidateNote) == 16 && sizeof(BoxVisit) == 32 && sizeof(More) == 32);

// Miss records before those of the tracer: that of a relay.
uint32_t missesBefore(const PipelineTracerSetup &setup)
{
    return !setup.relay.empty() && setup.relayStage == VK_SHADER_STAGE_MISS_BIT_KHR ? 1 : 0;
}

std::vector<uint32_t> recordData(RecordData content, uint32_t first)
{
    std::vector<uint32_t> words{first, ~first, first * 0x9e3779b1u, first ^ 0x5bd1e995u};
    words.resize(static_cast<size_t>(content));
    return words;
}

struct HitModules {
    std::span<const uint32_t> closestHit, anyHit, intersection;
};

HitModules hitModules(HitAttributes attributes)
{
#define MODULES(name)                                                                                                  \
    {                                                                                                                  \
        name##_closest_hit, name##_any_hit, name##_intersection                                                        \
    }
    switch (attributes) {
    case HitAttributes::Scalars: return MODULES(pipeline_tracer_scalars);
    case HitAttributes::Array: return MODULES(pipeline_tracer_array);
    case HitAttributes::Wide: return MODULES(pipeline_tracer_wide);
    default: return MODULES(pipeline_tracer);
    }
#undef MODULES
}

MadePipeline makePipeline(Device &gpu, VkPipelineLayout layout, const PipelineTracerSetup &setup)
{
    static constexpr std::array<VkSpecializationMapEntry, 4> kEntries{{{0, 0, 4}, {1, 4, 4}, {2, 8, 4}, {3, 12, 4}}};
    const std::array<uint32_t, 4> constants{setup.specializedFlags.value_or(0), setup.sbtOffset, setup.sbtStride,
                                            setup.missIndex + missesBefore(setup)};
    const bool flags = setup.specializedFlags.has_value();
    const VkSpecializationInfo specialization{(flags ? 1u : 0u) + (setup.specializedParameters ? 3u : 0u),
                                              kEntries.data() + (flags ? 0 : 1), sizeof constants, constants.data()};
    const HitModules modules = hitModules(setup.attributes);
    PipelineSetup pipeline;
    if (setup.attributes == HitAttributes::Wide)
        pipeline.attributeSize = 8 * sizeof(float);
    pipeline.stages = {
        {VK_SHADER_STAGE_RAYGEN_BIT_KHR,
         setup.raygen.empty() ? std::span<const uint32_t>(pipeline_tracer_raygen) : setup.raygen},
        {VK_SHADER_STAGE_MISS_BIT_KHR, pipeline_tracer_miss},
        {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, modules.closestHit},
        {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, modules.anyHit},
        {VK_SHADER_STAGE_INTERSECTION_BIT_KHR, modules.intersection},
        // For groups without any-hit shader: if two groups share an intersection stage, lavapipe (Mesa 25.0.7) runs the
        // any-hit shader of one of them for both.
        {VK_SHADER_STAGE_INTERSECTION_BIT_KHR, modules.intersection},
    };
    if (setup.decoys) {
        pipeline.stages.emplace_back(VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pipeline_decoy_closest_hit);
        pipeline.stages.emplace_back(VK_SHADER_STAGE_ANY_HIT_BIT_KHR, pipeline_decoy_any_hit);
        pipeline.stages.emplace_back(VK_SHADER_STAGE_INTERSECTION_BIT_KHR, pipeline_decoy_intersection);
        pipeline.stages.emplace_back(VK_SHADER_STAGE_MISS_BIT_KHR, pipeline_decoy_miss);
    }
    constexpr uint32_t kDecoys = 6;
    const auto relayStage = static_cast<uint32_t>(pipeline.stages.size());
    const bool relayMisses = missesBefore(setup) > 0;
    // launcher.rgen, whose rays are to miss or to hit a triangle
    const uint32_t target = relayMisses ? 0 : 2;
    const VkSpecializationInfo toTarget{1, kEntries.data(), sizeof target, &target};
    PipelineStage *tracing = &pipeline.stages[0];
    if (!setup.relay.empty()) {
        pipeline.stages[0] = {VK_SHADER_STAGE_RAYGEN_BIT_KHR, pipeline_launcher, "main", &toTarget};
        tracing = &pipeline.stages.emplace_back(setup.relayStage, setup.relay);
        pipeline.recursion = 2;
    }
    if (specialization.mapEntryCount > 0)
        tracing->specialization = &specialization;
    if (setup.unusedStage)
        pipeline.stages.push_back(PipelineStage(*tracing));
    pipeline.groups = {{.general = 0}, {.general = 1}};
    for (const TracerGroup &group : setup.groups)
        pipeline.groups.push_back({.closestHit = group.closestHit ? 2 : kUnused,
                                   .anyHit = group.anyHit ? 3 : kUnused,
                                   .intersection = !group.box     ? kUnused
                                                   : group.anyHit ? 4u
                                                                  : 5u});
    if (setup.decoys) {
        pipeline.groups.push_back({.closestHit = kDecoys});
        pipeline.groups.push_back({.closestHit = kDecoys, .anyHit = kDecoys + 1});
        pipeline.groups.push_back({.closestHit = kDecoys, .anyHit = kDecoys + 1, .intersection = kDecoys + 2});
        pipeline.groups.push_back({.general = kDecoys + 3});
    }
    if (!setup.relay.empty())
        pipeline.groups.push_back(relayMisses ? PipelineGroup{.general = relayStage}
                                              : PipelineGroup{.closestHit = relayStage});
    if (setup.callables) {
        pipeline.groups.push_back({.general = static_cast<uint32_t>(pipeline.stages.size())});
        pipeline.stages.emplace_back(VK_SHADER_STAGE_CALLABLE_BIT_KHR, pipeline_tracer_callable);
    }
    for (PipelineStage &stage : pipeline.stages)
        stage.inlineModule = setup.inlineModules;
    pipeline.layout = layout;
    pipeline.flags = setup.flags.value_or(gpu.options().micromaps ? kMicromapBit : 0);
    // VUID-VkRayTracingPipelineCreateInfoKHR-flags-03470 and 03471: such groups of decoys and relays would be invalid.
    for (PipelineGroup &group : pipeline.groups) {
        if (group.general != kUnused)
            continue;
        if ((pipeline.flags & VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR) != 0 &&
            group.anyHit == kUnused)
            group.anyHit = group.closestHit == kDecoys ? kDecoys + 1 : 3;
    }
    pipeline.flags2 = setup.flags2;
    pipeline.chained = setup.chained;
    pipeline.creation = setup.creation;
    pipeline.dynamicStackSize = setup.dynamicStackSize;
    if (setup.make)
        return setup.make(gpu, pipeline);
    return {RayPipeline(gpu, pipeline), {}, {}};
}

} // namespace

PipelineTracer::PipelineTracer(Device &gpu, const PipelineTracerSetup &setup)
    : gpu_(gpu), pushSize_(setup.relay.empty() ? kPushSize : sizeof(Push)),
      resources_(gpu, 6, pushSize_, setup.otherPushConstants),
      pipeline_(std::make_shared<MadePipeline>(makePipeline(gpu, resources_.layout(), setup)))
{
    setUp(setup);
}

PipelineTracer::PipelineTracer(const PipelineTracer &other, const PipelineTracerSetup &setup)
    : gpu_(other.gpu_), pushSize_(other.pushSize_), resources_(gpu_, 6, pushSize_, setup.otherPushConstants),
      pipeline_(other.pipeline_)
{
    setUp(setup);
}

void PipelineTracer::setUp(const PipelineTracerSetup &setup)
{
    groups_ = setup.groups;
    push_.sbtOffset = setup.sbtOffset;
    push_.sbtStride = setup.sbtStride;
    push_.missIndex = setup.missIndex + missesBefore(setup);
    TracerTable table{.hit = setup.records, .miss = {setup.missRecord}};
    for (uint32_t i = 0; setup.records.empty() && i < setup.groups.size(); ++i)
        table.hit.emplace_back(i);
    if (!setup.relay.empty()) {
        relayGroup_ = static_cast<uint32_t>(2 + setup.groups.size() + (setup.decoys ? 4 : 0));
        relayMisses_ = missesBefore(setup) > 0;
    }
    if (setup.callables)
        callableGroup_ =
            static_cast<uint32_t>(2 + setup.groups.size() + (setup.decoys ? 4 : 0) + (relayGroup_ > 0 ? 1 : 0));
    setTable(table);
}

void PipelineTracer::setTable(const TracerTable &table)
{
    if (content_ == table)
        return;
    content_ = table;
    push_.content = table.content;
    BindingRecords records{.dataWords = static_cast<uint32_t>(table.content), .layout = table.layout};
    records.raygen.group = placeOf(0);
    if (relayMisses_)
        records.miss.push_back({placeOf(relayGroup_), {}});
    for (uint32_t i = 0; i < table.miss.size(); ++i)
        records.miss.push_back(
            {table.miss[i] ? std::optional(placeOf(1)) : std::nullopt, recordData(table.content, table.data + 50 + i)});
    for (uint32_t i = 0; i < table.hit.size(); ++i)
        records.hit.push_back({table.hit[i] ? std::optional(placeOf(2 + *table.hit[i])) : std::nullopt,
                               recordData(table.content, table.data + PipelineTracer::kFirstHitData + i)});
    for (uint32_t i = 0; callableGroup_ && i < kCallables; ++i)
        records.callable.push_back({placeOf(*callableGroup_), recordData(table.content, table.data + 40 + i)});
    if (relayGroup_ > 0) {
        // The relay's record is behind those of the table.
        helper_ = std::make_unique<HelperScene>(gpu_, static_cast<uint32_t>(records.hit.size()));
        if (!relayMisses_)
            records.hit.push_back({placeOf(relayGroup_), {}});
        push_.helper = helper_->address();
    }
    table_ = std::make_unique<BindingTable>(gpu_, pipeline_->pipeline, records);
}

uint32_t PipelineTracer::stackSize() const
{
    const RayPipeline &pipeline = pipeline_->pipeline;
    const auto sizeOf = [&](uint32_t group, VkShaderGroupShaderKHR shader) {
        return pipeline.stackSize(placeOf(group), shader);
    };
    VkDeviceSize miss = sizeOf(1, VK_SHADER_GROUP_SHADER_GENERAL_KHR);
    VkDeviceSize closestHit = 0, anyHit = 0, intersection = 0;
    for (uint32_t i = 0; i < groups_.size(); ++i) {
        if (groups_[i].closestHit)
            closestHit = std::max(closestHit, sizeOf(2 + i, VK_SHADER_GROUP_SHADER_CLOSEST_HIT_KHR));
        if (groups_[i].anyHit)
            anyHit = std::max(anyHit, sizeOf(2 + i, VK_SHADER_GROUP_SHADER_ANY_HIT_KHR));
        if (groups_[i].box)
            intersection = std::max(intersection, sizeOf(2 + i, VK_SHADER_GROUP_SHADER_INTERSECTION_KHR));
    }
    VkDeviceSize size = sizeOf(0, VK_SHADER_GROUP_SHADER_GENERAL_KHR);
    if (relayMisses_)
        miss = std::max(miss, sizeOf(relayGroup_, VK_SHADER_GROUP_SHADER_GENERAL_KHR));
    else if (relayGroup_ > 0)
        closestHit = std::max(closestHit, sizeOf(relayGroup_, VK_SHADER_GROUP_SHADER_CLOSEST_HIT_KHR));
    if (relayGroup_ > 0)
        size += std::max(closestHit, miss);
    if (callableGroup_)
        size += 2 * sizeOf(*callableGroup_, VK_SHADER_GROUP_SHADER_GENERAL_KHR);
    return static_cast<uint32_t>(size + std::max({closestHit, miss, intersection + anyHit}));
}

void PipelineTracer::prepare(const Structure &scene, std::span<const Ray> rays, uint32_t capacity,
                             const Buffer *tableCopy, uint32_t tableBarrier)
{
    const size_t count = std::max<size_t>(rays.size(), 1);
    rays_ = gpu_.upload(rays, kStorageWithAddress);
    results_ = Buffer(gpu_, count * sizeof(RawResult), kStorageWithAddress);
    candidates_ = Buffer(gpu_, count * capacity * sizeof(Candidate), kStorageWithAddress);
    notes_ = Buffer(gpu_, count * capacity * sizeof(CandidateNote), kStorageWithAddress);
    visits_ = Buffer(gpu_, count * capacity * sizeof(BoxVisit), kStorageWithAddress);
    mores_ = Buffer(gpu_, count * sizeof(More), kStorageWithAddress);
    push_.rayCount = static_cast<uint32_t>(rays.size());
    push_.capacity = capacity;
    push_.scene = scene.address();
    table_->prepare(launch_, push_.rayCount, tableCopy, tableBarrier);
    resources_.write(scene.handle(), buffers());
}

void PipelineTracer::bind(VkCommandBuffer commands, bool maintenance6) const
{
    bindProgram(commands);
    bindSet(commands, maintenance6);
}

void PipelineTracer::bindProgram(VkCommandBuffer commands) const
{
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline_->pipeline.handle());
}

void PipelineTracer::bindSet(VkCommandBuffer commands, bool maintenance6) const
{
    recordBindings(gpu_, commands,
                   {VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, resources_.layout(), resources_.set(),
                    PipelineResources::kStages, std::as_bytes(std::span(&push_, 1)).first(pushSize_)},
                   maintenance6);
}

void PipelineTracer::dispatch(VkCommandBuffer commands) const
{
    table_->trace(commands);
}

void PipelineTracer::clearResults()
{
    for (const Buffer *buffer : {&results_, &candidates_, &notes_, &visits_, &mores_})
        std::memset(buffer->bytes(), 0xcc, static_cast<size_t>(buffer->size()));
}

std::vector<PipelineResult> PipelineTracer::results() const
{
    std::vector<PipelineResult> results(push_.rayCount);
    for (size_t i = 0; i < results.size(); ++i) {
        PipelineResult &r = results[i];
        static_cast<RawResult &>(r) = results_.as<RawResult>()[i];
        const More more = mores_.as<More>()[i];
        r.visitCount = more.visits;
        r.hitKind = more.hitKind;
        r.record = more.record;
        r.invocations = more.invocations;
        r.called = more.called;
        r.intact = more.intact == 1;
        const size_t first = i * push_.capacity;
        const size_t kept = std::min(r.candidateCount, push_.capacity);
        const auto candidates = candidates_.as<Candidate>().subspan(first, kept);
        const auto notes = notes_.as<CandidateNote>().subspan(first, kept);
        const auto visits = visits_.as<BoxVisit>().subspan(first, std::min(r.visitCount, push_.capacity));
        r.candidates.assign(candidates.begin(), candidates.end());
        r.notes.assign(notes.begin(), notes.end());
        r.visits.assign(visits.begin(), visits.end());
    }
    return results;
}

std::vector<PipelineResult> PipelineTracer::trace(const Structure &scene, std::span<const Ray> rays, uint32_t capacity)
{
    prepare(scene, rays, capacity);
    traceAndWait(gpu_, *this);
    return results();
}

} // namespace vellum::gpu
