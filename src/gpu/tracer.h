// SPDX-License-Identifier: Apache-2.0
// Traces rays by ray queries with shaders/tracer.glsl and returns what the shader saw.
#pragma once

#include <cstdint>

#include "gpu/pipeline_builder.h"
#include "gpu/programs/stage_program.h"
#include "gpu/scene.h"

namespace vellum::gpu
{

// Ray flags of SPIR-V.
inline constexpr uint32_t kRayOpaque = 0x001;
inline constexpr uint32_t kRayNoOpaque = 0x002;
inline constexpr uint32_t kRayTerminateOnFirstHit = 0x004;
inline constexpr uint32_t kRaySkipClosestHit = 0x008;
inline constexpr uint32_t kRayCullBack = 0x010;
inline constexpr uint32_t kRayCullFront = 0x020;
inline constexpr uint32_t kRayCullOpaque = 0x040;
inline constexpr uint32_t kRayCullNoOpaque = 0x080;
inline constexpr uint32_t kRaySkipTriangles = 0x100;
inline constexpr uint32_t kRaySkipBoxes = 0x200;
inline constexpr uint32_t kRayForceTwoState = 0x400;

// If Vellum's layer emulates micromaps: in a pipeline with micromaps whose rays have different hidden flags,
// intersection shaders do not see these, nor does one of them skip the shaders (docs/limitations.md). Returns whether
// one may see `seen` of a ray's flags.
inline bool intersectionMaySee(uint32_t seen, uint32_t flags)
{
    return seen == flags || seen == (flags & ~(kRayOpaque | kRayCullNoOpaque | kRayForceTwoState));
}

// Returns whether an intersection shader may run for a box that is culled.
inline bool intersectionMayRunCulled(uint32_t flags)
{
    return (flags & kRayCullNoOpaque) != 0;
}

enum Rule : uint32_t {
    kNever = 0,
    kAlways = 1,
    kHash = 2,
    kTerminate = 3, // confirm the candidate and end the ray
};
// Returns whether the shader confirms a candidate under kHash.
bool hashConfirms(uint32_t customIndex, uint32_t instance, uint32_t geometry, uint32_t primitive);

struct Ray {
    Vec3 origin{};
    float tMin = 0;
    Vec3 direction{0, 0, -1};
    float tMax = 1000;
    uint32_t flags = 0;
    uint32_t cullMask = 0xff;
    uint32_t rule = kNever;
    float generate = 0;
};

struct Candidate {
    uint32_t customIndex, instance, geometry, primitive;
    uint32_t bits; // tracer.glsl
    float t, u, v;

    [[nodiscard]] bool box() const { return (bits & 1) != 0; }
    [[nodiscard]] bool boxOpaque() const { return (bits & 2) != 0; }
    [[nodiscard]] bool frontFace() const { return (bits & 4) != 0; }
    [[nodiscard]] bool confirmed() const { return (bits & 8) != 0; }
    // Returns whether origins, directions and transforms of ray queries are consistent, and the record offset.
    [[nodiscard]] bool consistent() const { return (bits & 16) == 0; }
    [[nodiscard]] uint32_t recordOffset() const { return bits >> 8; }
};

enum Committed : uint32_t { kNone = 0, kTriangle = 1, kGenerated = 2 };

struct RawResult {
    uint32_t candidateCount;
    uint32_t flags;
    uint32_t committed;
    uint32_t customIndex, instance, geometry, primitive;
    float t, u, v;
    float tMin;
    uint32_t frontFace; // ray.glsl
};

struct Result : RawResult {
    std::vector<Candidate> candidates;
};

struct TracerSetup {
    std::optional<uint32_t> specializedFlags; // specialization constant 0
    bool inlineModule = false;                // VkShaderModuleCreateInfo in the stage's pNext
    VkShaderStageFlagBits stage = VK_SHADER_STAGE_COMPUTE_BIT;
    std::optional<VkBool32> specializedMode;  // specialization constant kModeConstant
    std::optional<VkBool32> specializedOther; // the one behind it: Mode::Computed
    bool shaderObject = false;                // compute: VK_EXT_shader_object instead of a pipeline
    bool vertexBuffers = false;               // vertex: StageShader::vertexBuffers
    bool dynamicStrides = false;
};

// A pipeline whose shader, of any stage, has the bindings of tracer.glsl.
class Tracer
{
public:
    static constexpr uint32_t kModeConstant = 1; // the id of the one by which the execution mode is specialized

    Tracer(Device &gpu, std::span<const uint32_t> words, const TracerSetup &setup = {});
    explicit Tracer(Device &gpu); // compute, run-time ray flags, bound acceleration structure
    Tracer(const Tracer &) = delete;
    Tracer &operator=(const Tracer &) = delete;

    // Traces and waits. At most `capacity` candidates of each ray come back.
    std::vector<Result> trace(const Structure &scene, std::span<const Ray> rays, uint32_t capacity = 8);

    // Traces by that command from now on.
    void setLaunch(const LaunchPlan &launch) { launch_ = launch; }
    // Traces in steps, for tests that put other commands in between.
    void prepare(const Structure &scene, std::span<const Ray> rays, uint32_t capacity = 8);
    // Pipeline, descriptor set, push constants; maintenance6: the last two by the commands of VK_KHR_maintenance6.
    void bind(VkCommandBuffer commands, bool maintenance6 = false) const;
    // The parts of that.
    void bindProgram(VkCommandBuffer commands) const { program_->bind(commands); }
    void bindSet(VkCommandBuffer commands, bool maintenance6 = false) const;
    void dispatch(VkCommandBuffer commands) const;
    [[nodiscard]] std::vector<Result> results() const;
    [[nodiscard]] VkPipelineLayout layout() const { return resources_.layout(); }
    [[nodiscard]] VkDescriptorSetLayout setLayout() const { return resources_.setLayout(); }
    [[nodiscard]] VkDescriptorSet set() const { return resources_.set(); }
    void clearResults();

private:
    struct Push {
        uint32_t rayCount;
        uint32_t capacity;
        VkDeviceAddress scene;
        VkDeviceAddress helper;
    };

    Device &gpu_;
    VkShaderStageFlags pushStages_;
    PipelineResources resources_;
    std::unique_ptr<StageProgram> program_;
    LaunchPlan launch_;
    Buffer rays_, results_, candidates_;
    Push push_{};
};

// Traces what a Tracer or a PipelineTracer is prepared for, and waits.
template <class AnyTracer>
void traceAndWait(Device &gpu, const AnyTracer &tracer)
{
    gpu.submit([&tracer](VkCommandBuffer commands) {
        barrier(commands);
        tracer.bind(commands);
        tracer.dispatch(commands);
        barrier(commands);
    });
}

} // namespace vellum::gpu
