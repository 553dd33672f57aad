// SPDX-License-Identifier: Apache-2.0
// Tracer's twin: traces rays with a ray tracing pipeline (shaders/pipeline_tracer.glsl) and returns what its shaders
// saw.
#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/pipeline_builder.h"
#include "gpu/programs/helper_scene.h"
#include "gpu/tracer.h"

namespace vellum::gpu
{

inline constexpr uint32_t kUnknownResult = 0xffffffff; // neither closest-hit nor miss shader ran
inline constexpr uint32_t kDecoyVisit = 0x100000;      // that the decoy of an intersection shader adds to visitCount
inline constexpr uint32_t kHitKindFront = 0xfe;
inline constexpr uint32_t kHitKindBack = 0xff;
// The kind that intersection shaders report: any of 0 to 127.
constexpr uint32_t hitKindOfBox(uint32_t primitive, uint32_t geometry)
{
    return (0x10 + 29 * primitive + 51 * geometry) & 0x7f;
}

struct CandidateNote { // of an any-hit invocation
    uint32_t flags, hitKind, record, intact;
};

struct BoxVisit { // an invocation of an intersection shader
    uint32_t customIndex, instance, geometry, primitive;
    uint32_t flags, record, reported;
    float tMin;
};

// candidates: the invocations of any-hit shaders. flags: as closest-hit or miss shader read them.
struct PipelineResult : Result {
    std::vector<CandidateNote> notes; // one for each candidate
    std::vector<BoxVisit> visits;
    uint32_t visitCount;
    uint32_t hitKind;
    uint32_t record; // of the closest-hit or miss shader: RecordData
    uint32_t invocations;
    uint32_t called; // the callable shader: the data of its record; with PipelineTracerSetup::callables
    bool intact;     // the payload, where no shader writes
};

struct TracerGroup {
    bool box = false;
    bool anyHit = true;
    bool closestHit = true;
};

// Shaders read the data of their records as kUnknownResult where they have no words, or where words 1 to 3 do not fit
// to word 0.
enum class RecordData : uint32_t { None = 0, Word = 1, Words = 4 };

// A binding table of the tracer.
struct TracerTable {
    std::vector<std::optional<uint32_t>> hit; // groups of the setup, nothing: a zero record
    std::vector<bool> miss{true};             // false: a zero record
    RecordData content = RecordData::Word;
    // Added to that of all records: 100 + i for hit record i, 50 + i for miss record i, 40 + i for callable record i.
    uint32_t data = 0;
    TableLayout layout;
    bool operator==(const TracerTable &) const = default;
};

// The parameters of traceRayEXT that name records.
struct TraceParameters {
    uint32_t recordOffset = 0, recordStride = 0, missIndex = 0;
    bool operator==(const TraceParameters &) const = default;
};

struct MadePipeline {
    RayPipeline pipeline;
    std::vector<uint32_t> groups;         // where each group of the setup is in the pipeline; empty: at the same place
    std::vector<RayPipeline> libraries{}; // libraries of the pipeline
};

// The type of hit attributes: a vec2; a structure of two floats; an array of two; a structure of a vec2 and six floats,
// which shaders of boxes use.
enum class HitAttributes { Vec2, Scalars, Array, Wide };

struct PipelineTracerSetup {
    std::span<const uint32_t> raygen; // empty: run-time flags
    // If not empty: a closest-hit or miss shader that traces the rays instead, in recursion.
    std::span<const uint32_t> relay;
    VkShaderStageFlagBits relayStage = VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR;
    std::optional<uint32_t> specializedFlags; // specialization constant 0 of either
    bool specializedParameters = false;       // specialization constants 1 to 3: TraceParameters
    std::vector<TracerGroup> groups{{}, {.box = true}};
    // Hit records: the group of `groups` that each names, nothing for a zero record. Empty: one for each group.
    std::vector<std::optional<uint32_t>> records;
    HitAttributes attributes = HitAttributes::Vec2;
    uint32_t sbtOffset = 0, sbtStride = 0, missIndex = 0;
    bool missRecord = true;
    std::optional<VkPipelineCreateFlags> flags; // else the micromap bit, where the device has micromaps enabled
    bool flags2 = false;
    uint32_t chained = 0; // bits of ChainedInfo
    bool inlineModules = false;
    bool dynamicStackSize = false;
    bool unusedStage = false; // a stage that no group uses
    uint32_t creation = 0;    // bits of PipelineCreation
    // The ray generation shader executes a callable shader, by one of kCallables records.
    bool callables = false;
    std::vector<VkPushConstantRange> otherPushConstants; // in the layout, for other stages
    // Shaders that must not run, in groups that no record names: a closest-hit, an any-hit, an intersection and a miss
    // shader.
    bool decoys = false;
    // Makes the pipeline in another way, without callables: stages are ray generation, miss, closest-hit, any-hit,
    // intersection for groups with and without any-hit shader, the decoys, and the relay; groups are ray generation,
    // miss, `groups`, those of decoys (closest-hit; closest-hit and any-hit; all three; miss), and the relay's.
    std::function<MadePipeline(Device &, const PipelineSetup &)> make;
};

class PipelineTracer
{
public:
    static constexpr uint32_t kPushSize = 32;
    static constexpr uint32_t kCallables = 3;
    static constexpr uint32_t kFirstHitData = 100; // data of hit records: TracerTable::data + this + number

    explicit PipelineTracer(Device &gpu, const PipelineTracerSetup &setup = {});
    // Uses the pipeline of `other`, which lives as long as one of the tracers. The setup is that of the other.
    PipelineTracer(const PipelineTracer &other, const PipelineTracerSetup &setup);

    std::vector<PipelineResult> trace(const Structure &scene, std::span<const Ray> rays, uint32_t capacity = 8);

    // Traces by that command from now on.
    void setLaunch(const LaunchPlan &launch) { launch_ = launch; }
    // Traces with that table from now on.
    void setTable(const TracerTable &table);

    // Traces in steps. tableCopy, tableBarrier: BindingTable::prepare
    void prepare(const Structure &scene, std::span<const Ray> rays, uint32_t capacity = 8,
                 const Buffer *tableCopy = nullptr, uint32_t tableBarrier = 0);
    // As those of Tracer.
    void bind(VkCommandBuffer commands, bool maintenance6 = false) const;
    void bindProgram(VkCommandBuffer commands) const;
    void bindSet(VkCommandBuffer commands, bool maintenance6 = false) const;
    void dispatch(VkCommandBuffer commands) const;
    [[nodiscard]] std::vector<PipelineResult> results() const;
    void clearResults();
    [[nodiscard]] const RayPipeline &pipeline() const { return pipeline_->pipeline; }
    [[nodiscard]] const BindingTable &table() const { return *table_; }
    [[nodiscard]] const PipelineResources &resources() const { return resources_; }
    // The stack size that an application computes for it ("Ray Tracing Pipeline Stack").
    [[nodiscard]] uint32_t stackSize() const;
    [[nodiscard]] uint32_t rayCount() const { return push_.rayCount; }
    // The buffers of bindings 1 and up.
    [[nodiscard]] std::array<const Buffer *, 6> buffers() const
    {
        return {&rays_, &results_, &candidates_, &notes_, &visits_, &mores_};
    }

private:
    struct Push {
        uint32_t rayCount, capacity, sbtOffset, sbtStride, missIndex;
        RecordData content;
        VkDeviceAddress scene;
        VkDeviceAddress helper; // only in recursion
    };
    static_assert(offsetof(Push, helper) == kPushSize);

    Device &gpu_;
    uint32_t pushSize_;
    std::unique_ptr<HelperScene> helper_;
    PipelineResources resources_;
    [[nodiscard]] uint32_t placeOf(uint32_t group) const
    {
        return pipeline_->groups.empty() ? group : pipeline_->groups[group];
    }
    void setUp(const PipelineTracerSetup &setup);

    std::shared_ptr<MadePipeline> pipeline_;
    std::vector<TracerGroup> groups_;
    uint32_t relayGroup_ = 0; // of the setup
    bool relayMisses_ = false;
    std::optional<uint32_t> callableGroup_; // of the setup
    LaunchPlan launch_;
    std::optional<TracerTable> content_; // of table_
    std::unique_ptr<BindingTable> table_;
    Buffer rays_, results_, candidates_, notes_, visits_, mores_;
    Push push_{};
};

} // namespace vellum::gpu
