// SPDX-License-Identifier: Apache-2.0
#include "check/gpu/pipeline_tracer.h"

#include <algorithm>
#include <array>

#include "shaders/pipeline_launcher.h"
#include "shaders/pipeline_tracer_any_hit.h"
#include "shaders/pipeline_tracer_closest_hit.h"
#include "shaders/pipeline_tracer_intersection.h"
#include "shaders/pipeline_tracer_miss.h"
#include "shaders/pipeline_tracer_raygen.h"

namespace vellum::check
{
namespace
{

constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

struct More {
    uint32_t visits, hitKind, record, invocations, intact, pad[3];
};
static_assert(sizeof(CandidateNote) == 16 && sizeof(BoxVisit) == 32 && sizeof(More) == 32);

MadePipeline makePipeline(Device &gpu, VkPipelineLayout layout, const PipelineTracerSetup &setup)
{
    const VkSpecializationMapEntry entry{0, 0, sizeof(uint32_t)};
    const uint32_t flags = setup.specializedFlags.value_or(0);
    const VkSpecializationInfo specialization{1, &entry, sizeof(flags), &flags};
    PipelineSetup pipeline;
    pipeline.stages = {
        {VK_SHADER_STAGE_RAYGEN_BIT_KHR,
         setup.raygen.empty() ? std::span<const uint32_t>(pipeline_tracer_raygen) : setup.raygen},
        {VK_SHADER_STAGE_MISS_BIT_KHR, pipeline_tracer_miss},
        {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pipeline_tracer_closest_hit},
        {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, pipeline_tracer_any_hit},
        {VK_SHADER_STAGE_INTERSECTION_BIT_KHR, pipeline_tracer_intersection},
        // For groups without any-hit shader: where two groups share an intersection stage, lavapipe (Mesa 25.0.7) runs
        // the any-hit shader of one of them for both.
        {VK_SHADER_STAGE_INTERSECTION_BIT_KHR, pipeline_tracer_intersection},
    };
    constexpr uint32_t kRelayStage = 6;
    // launcher.rgen, whose rays are to hit a triangle
    constexpr uint32_t kTriangle = 2;
    const VkSpecializationInfo toTriangle{1, &entry, sizeof(kTriangle), &kTriangle};
    PipelineStage *tracing = &pipeline.stages[0];
    if (!setup.relay.empty()) {
        pipeline.stages[0] = {VK_SHADER_STAGE_RAYGEN_BIT_KHR, pipeline_launcher, "main", &toTriangle};
        tracing = &pipeline.stages.emplace_back(VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, setup.relay);
        pipeline.recursion = 2;
    }
    if (setup.specializedFlags)
        tracing->specialization = &specialization;
    if (setup.unusedStage)
        pipeline.stages.push_back(PipelineStage(*tracing));
    for (PipelineStage &stage : pipeline.stages)
        stage.inlineModule = setup.inlineModules;
    pipeline.groups = {{.general = 0}, {.general = 1}};
    for (const TracerGroup &group : setup.groups)
        pipeline.groups.push_back({.closestHit = group.closestHit ? 2 : kUnused,
                                   .anyHit = group.anyHit ? 3 : kUnused,
                                   .intersection = !group.box     ? kUnused
                                                   : group.anyHit ? 4u
                                                                  : 5u});
    if (!setup.relay.empty())
        pipeline.groups.push_back({.closestHit = kRelayStage});
    pipeline.layout = layout;
    pipeline.flags = setup.flags.value_or(gpu.options().micromaps ? kMicromapBit : 0);
    pipeline.flags2 = setup.flags2;
    pipeline.dynamicStackSize = setup.dynamicStackSize;
    if (setup.make)
        return setup.make(gpu, pipeline);
    return {RayPipeline(gpu, pipeline), {}, {}};
}

} // namespace

PipelineTracer::PipelineTracer(Device &gpu, const PipelineTracerSetup &setup)
    : gpu_(gpu), pushSize_(setup.relay.empty() ? kPushSize : sizeof(Push)),
      resources_(gpu, 6, pushSize_, setup.otherPushConstants), pipeline_(makePipeline(gpu, resources_.layout(), setup)),
      groups_(setup.groups)
{
    std::vector<std::optional<uint32_t>> names = setup.records;
    for (uint32_t i = 0; setup.records.empty() && i < setup.groups.size(); ++i)
        names.emplace_back(i);
    BindingRecords &records = records_;
    records.raygen.group = placeOf(0);
    if (setup.missRecord)
        records.miss = {{placeOf(1), {50}}};
    else
        records.miss = {{std::nullopt, {}}};
    for (uint32_t i = 0; i < names.size(); ++i)
        records.hit.push_back({names[i] ? std::optional(placeOf(2 + *names[i])) : std::nullopt, {100 + i}});
    if (!setup.relay.empty()) {
        helper_ = std::make_unique<HelperScene>(gpu, static_cast<uint32_t>(records.hit.size()));
        records.hit.push_back({placeOf(2 + static_cast<uint32_t>(setup.groups.size())), {}});
        push_.helper = helper_->address();
    }
    table_ = std::make_unique<BindingTable>(gpu, pipeline_.pipeline, records);
    push_.sbtOffset = setup.sbtOffset;
    push_.sbtStride = setup.sbtStride;
}

void PipelineTracer::setLaunch(Launch launch, uint32_t recordPadding)
{
    launch_ = launch;
    if (records_.hitPadding == recordPadding)
        return;
    records_.hitPadding = recordPadding;
    table_ = std::make_unique<BindingTable>(gpu_, pipeline_.pipeline, records_);
}

uint32_t PipelineTracer::stackSize() const
{
    const RayPipeline &pipeline = pipeline_.pipeline;
    const auto sizeOf = [&](uint32_t group, VkShaderGroupShaderKHR shader) {
        return pipeline.stackSize(placeOf(group), shader);
    };
    const VkDeviceSize miss = sizeOf(1, VK_SHADER_GROUP_SHADER_GENERAL_KHR);
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
    if (helper_) {
        const auto relay = static_cast<uint32_t>(2 + groups_.size());
        closestHit = std::max(closestHit, sizeOf(relay, VK_SHADER_GROUP_SHADER_CLOSEST_HIT_KHR));
        size += std::max(closestHit, miss);
    }
    return static_cast<uint32_t>(size + std::max({closestHit, miss, intersection + anyHit}));
}

void PipelineTracer::prepare(const Structure &scene, std::span<const Ray> rays, uint32_t capacity)
{
    const size_t count = std::max<size_t>(rays.size(), 1);
    rays_ = gpu_.upload(rays, kStorage);
    results_ = Buffer(gpu_, count * sizeof(RawResult), kStorage);
    candidates_ = Buffer(gpu_, count * capacity * sizeof(Candidate), kStorage);
    notes_ = Buffer(gpu_, count * capacity * sizeof(CandidateNote), kStorage);
    visits_ = Buffer(gpu_, count * capacity * sizeof(BoxVisit), kStorage);
    mores_ = Buffer(gpu_, count * sizeof(More), kStorage);
    push_.rayCount = static_cast<uint32_t>(rays.size());
    push_.capacity = capacity;
    push_.scene = scene.address();
    table_->prepare(launch_, push_.rayCount);
    resources_.write(scene.handle(), buffers());
}

void PipelineTracer::bind(VkCommandBuffer commands) const
{
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline_.pipeline.handle());
    resources_.bind(commands);
    vkCmdPushConstants(commands, resources_.layout(), PipelineResources::kStages, 0, pushSize_, &push_);
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

} // namespace vellum::check
