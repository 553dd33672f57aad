// SPDX-License-Identifier: Apache-2.0
// Ray tracing pipelines and shader binding tables as an application makes them.
#pragma once

#include <cstdint>
#include <optional>

#include "gpu/launch.h"

namespace vellum::gpu
{

inline constexpr VkPipelineCreateFlags kMicromapBit = VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT;
inline constexpr uint32_t kUnused = VK_SHADER_UNUSED_KHR;

struct PipelineStage {
    VkShaderStageFlagBits stage;
    std::span<const uint32_t> words;
    const char *entry = "main";
    const VkSpecializationInfo *specialization = nullptr;
    bool inlineModule = false; // VkShaderModuleCreateInfo in the stage's pNext
};

// Indices of stages. A group with a general shader is a general one, with an intersection shader a procedural one,
// every other one is for triangles.
struct PipelineGroup {
    uint32_t general = kUnused;
    uint32_t closestHit = kUnused;
    uint32_t anyHit = kUnused;
    uint32_t intersection = kUnused;
};

enum PipelineCreation : uint32_t {
    kCreateDeferred = 1, // by a deferred operation
    kCreateCached = 2,   // twice with a pipeline cache; the first one is destroyed
    kCreateSeveral = 4,  // by a command that creates others with fewer groups and, without libraries, other flags
};

// Structures in the pNext chain of the create info, where the device has their extensions.
enum ChainedInfo : uint32_t {
    kChainFeedback = 1,   // VkPipelineCreationFeedbackCreateInfo, with feedback of each stage
    kChainRobustness = 2, // VkPipelineRobustnessCreateInfoEXT
    kChainFlagsFirst = 4, // VkPipelineCreateFlags2CreateInfo is before these, else behind them
};

struct PipelineSetup {
    std::vector<PipelineStage> stages;
    std::vector<PipelineGroup> groups;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkFlags64 flags = 0;
    bool flags2 = false;  // the flags come in VkPipelineCreateFlags2CreateInfo
    uint32_t chained = 0; // bits of ChainedInfo
    uint32_t recursion = 1;
    std::vector<VkPipeline> libraries;
    uint32_t payloadSize = 96;
    uint32_t attributeSize = 8;
    bool dynamicStackSize = false;
    bool sharedModules = false; // stages with the same words share one VkShaderModule
    uint32_t creation = 0;      // bits of PipelineCreation
};

// Everything that VkRayTracingPipelineCreateInfoKHR points to, on the heap, to be destroyed when the test says so.
class PipelineInfo
{
public:
    PipelineInfo(Device &gpu, const PipelineSetup &setup);
    PipelineInfo(const PipelineInfo &) = delete;
    PipelineInfo &operator=(const PipelineInfo &) = delete;
    ~PipelineInfo();
    [[nodiscard]] const VkRayTracingPipelineCreateInfoKHR &get() const { return info_; }
    [[nodiscard]] VkRayTracingPipelineCreateInfoKHR &get() { return info_; }
    // Overwrites every array and structure that the creation may have read, as an application may afterwards.
    void scribble();

private:
    void chainInfos(const PipelineSetup &setup);

    Device &gpu_;
    std::vector<std::vector<uint32_t>> words_;
    std::vector<VkShaderModuleCreateInfo> inlined_;
    std::vector<VkShaderModule> modules_;
    std::vector<std::string> names_;
    std::vector<VkPipelineShaderStageCreateInfo> stages_;
    std::vector<VkRayTracingShaderGroupCreateInfoKHR> groups_;
    std::vector<VkPipeline> libraries_;
    std::vector<VkDynamicState> states_;
    VkPipelineLibraryCreateInfoKHR libraryInfo_{};
    VkRayTracingPipelineInterfaceCreateInfoKHR interface_{};
    VkPipelineDynamicStateCreateInfo dynamic_{};
    VkPipelineCreateFlags2CreateInfoKHR flags2_{};
    VkPipelineCreationFeedback feedback_{};
    std::vector<VkPipelineCreationFeedback> feedbackOfStages_;
    VkPipelineCreationFeedbackCreateInfo feedbackInfo_{};
    VkPipelineRobustnessCreateInfoEXT robustness_{};
    VkRayTracingPipelineCreateInfoKHR info_{};
};

class RayPipeline
{
public:
    RayPipeline(Device &gpu, const PipelineSetup &setup);
    RayPipeline(Device &gpu, VkPipeline pipeline) : gpu_(&gpu), pipeline_(pipeline) {}
    RayPipeline(RayPipeline &&other) noexcept : gpu_(other.gpu_), pipeline_(other.pipeline_)
    {
        other.pipeline_ = VK_NULL_HANDLE;
    }
    RayPipeline &operator=(RayPipeline &&) = delete;
    ~RayPipeline();

    [[nodiscard]] VkPipeline handle() const { return pipeline_; }
    [[nodiscard]] std::vector<uint8_t> groupHandles(uint32_t first, uint32_t count = 1) const;
    [[nodiscard]] VkDeviceSize stackSize(uint32_t group, VkShaderGroupShaderKHR shader) const;

private:
    Device *gpu_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

// A record of a binding table: a group of the pipeline, or all zeros, and data for the shader.
struct BindingRecord {
    std::optional<uint32_t> group;
    std::vector<uint32_t> data;
};

// The positions of a table's regions in their buffer.
struct TableLayout {
    uint32_t before = 0;                      // multiples of shaderGroupBaseAlignment before the first region
    bool reversed = false;                    // callable, hit, miss, ray generation records
    uint32_t missPadding = 0, hitPadding = 0; // after each record, in multiples of shaderGroupHandleAlignment
    bool zeroStride = false;                  // of the hit region, whose first record is that of all hits
    bool cut = false;                         // miss and hit regions end with the data of their last records
    // Each trace follows one of no rays, whose hit region has the same address and size, and another stride.
    bool otherStride = false;
    bool operator==(const TableLayout &) const = default;
};

struct BindingRecords {
    BindingRecord raygen{0, {}};
    std::vector<BindingRecord> miss, hit, callable; // the callable records have the stride of the miss records
    uint32_t dataWords = 4;                         // space for data in each record
    TableLayout layout{};
};

// The barrier between the writes of a table and the trace that reads it; else one of the table's buffer, for
// VK_ACCESS_2_SHADER_READ_BIT.
enum TableBarrier : uint32_t {
    kBarrierForTables = 1, // for VK_ACCESS_2_SHADER_BINDING_TABLE_READ_BIT_KHR alone, where the device has it
    kBarrierOfMemory = 2,  // of all memory
};

class BindingTable
{
public:
    BindingTable(Device &gpu, const RayPipeline &pipeline, const BindingRecords &records);
    void trace(VkCommandBuffer commands, uint32_t width, uint32_t height = 1, uint32_t depth = 1) const;
    // Prepares a trace of at least that many rays. copy: a buffer (bufferForCopies) to which the trace copies the table
    // first, and with which it traces; it exists until the trace is recorded. barrier: bits of TableBarrier
    void prepare(const LaunchPlan &launch, uint32_t rays, const Buffer *copy = nullptr, uint32_t barrier = 0);
    void trace(VkCommandBuffer commands) const;
    // A buffer for copies of tables of at most that many bytes().
    static Buffer bufferForCopies(Device &gpu, VkDeviceSize bytes);
    [[nodiscard]] VkDeviceSize bytes() const { return buffer_.size(); }

    VkStridedDeviceAddressRegionKHR raygen{}, miss{}, hit{}, callable{};

private:
    struct Regions {
        VkStridedDeviceAddressRegionKHR raygen, miss, hit, callable;
    };
    // The regions, in copy_ if there is one.
    [[nodiscard]] Regions regions() const;

    Device &gpu_;
    VkDeviceSize alignment_ = 0; // of the buffer's content
    Buffer buffer_;
    const Buffer *copy_ = nullptr;
    uint32_t barrier_ = 0;
    bool otherStride_ = false;
    LaunchPlan launch_;
    uint32_t width_ = 0;
    IndirectCommand command_;
};

// A descriptor set layout, a pipeline layout with push constants for these stages, and a set: binding 0 an acceleration
// structure, bindings 1.. storage buffers.
class PipelineResources
{
public:
    PipelineResources(Device &gpu, uint32_t buffers, uint32_t pushSize,
                      std::span<const VkPushConstantRange> others = {}, VkShaderStageFlags stages = kStages);
    PipelineResources(const PipelineResources &) = delete;
    PipelineResources &operator=(const PipelineResources &) = delete;
    ~PipelineResources();
    void write(VkAccelerationStructureKHR scene, std::span<const Buffer *const> buffers) const;
    void bind(VkCommandBuffer commands, VkPipelineBindPoint point = VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR) const;

    static constexpr VkShaderStageFlags kStages =
        VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR | VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR |
        VK_SHADER_STAGE_MISS_BIT_KHR | VK_SHADER_STAGE_INTERSECTION_BIT_KHR | VK_SHADER_STAGE_CALLABLE_BIT_KHR;
    [[nodiscard]] VkPipelineLayout layout() const { return layout_; }
    [[nodiscard]] VkDescriptorSetLayout setLayout() const { return setLayout_; }
    [[nodiscard]] VkDescriptorSet set() const { return set_; }

private:
    Device &gpu_;
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    VkDescriptorSet set_ = VK_NULL_HANDLE;
};

} // namespace vellum::gpu
