// SPDX-License-Identifier: Apache-2.0
// Rules about acceleration structures that rays meet. Each place of a shader that traces rays and that a rule may be
// broken at has a mark, which the shader sets when it gets there. A rule is broken where the mark is set and each
// structure that was bound for it since the mark was clear breaks the rule. Nothing is reported of structures, or of
// contents of structures, that are not known.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/input/builds.h"
#include "layer/memory/gpu_memory.h"
#include "layer/memory/kept_addresses.h"
#include "layer/validation/model/device_model.h"
#include "spirv/sites/trace_sites.h"

namespace vellum::layer
{

// Rules that a place of a shader can break, as bits.
inline constexpr uint32_t kRuleMode = 1;        // 11636: ray queries without the execution mode meet no micromaps
inline constexpr uint32_t kRulePipelineBit = 2; // 11640: nor do rays of pipelines without the bit
inline constexpr uint32_t kRuleMixed = 4;       // 11638, 11639: no mixed special indices, where that is promised
// VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM: no micromaps
inline constexpr uint32_t kRuleDisallowed = 8;
inline constexpr uint32_t kRuleDeserialized = 16; // 11637: no structure without the micromaps it was serialized with

class TraceMarks;

// A mark in memory. Its destructor releases it. Must not outlive the marks.
class TraceMark
{
public:
    TraceMark(TraceMarks &marks, uint32_t index) : marks_(marks), index_(index) {}
    ~TraceMark();
    TraceMark(const TraceMark &) = delete;
    TraceMark &operator=(const TraceMark &) = delete;
    [[nodiscard]] uint32_t index() const { return index_; }

private:
    TraceMarks &marks_;
    uint32_t index_;
};

// A place where the shader of a pipeline or a shader object traces rays in a structure of a descriptor.
struct TracingSite {
    std::shared_ptr<const TraceMark> mark; // a library's mark is also that of pipelines made of it; null: no mark
    spirv::StructureBinding binding;
    std::optional<uint32_t> cullMask; // as of spirv::TraceSite
};

// The code of a pipeline or shader object, as far as rules are about it.
struct TracingCode {
    ObjectHandle handle;
    bool shaderObject = false;
    std::vector<TracingSite> sites;
};

// A structure for which a site may have traced rays, in a command that was submitted.
struct TraceUse {
    const char *command = nullptr;
    ObjectHandle code; // a pipeline or shader object
    bool shaderObject = false;
    std::optional<uint32_t> cullMask;                  // of the rays; nothing: it is computed
    std::shared_ptr<ValidatedStructure> structure;     // null: unknown
    std::shared_ptr<const StructureContents> contents; // at that time; null: unknown
    uint64_t number = 0;                               // DeviceModel::numbers at that time
    VkQueue queue = VK_NULL_HANDLE;                    // and batch, as in Submission
    uint64_t batch = 0;
};

// A geometry below a top-level structure.
struct MetGeometry {
    std::shared_ptr<ValidatedStructure> structure; // null: none
    uint32_t index = 0;
    std::string wrong{}; // kRuleDeserialized: what is wrong
};

// The rules that are broken by tracing rays in a top-level structure, and the first geometries they are broken by.
struct BrokenRules {
    uint32_t rules = 0;
    MetGeometry micromap, mixed, deserialized;
};

class TraceMarks
{
public:
    // A mark for a site with these rules; null if all are in use.
    std::shared_ptr<const TraceMark> add(const GpuContext &context, uint32_t rules);
    [[nodiscard]] VkDeviceAddress address() const { return memory_.address(); }
    // The use is submitted.
    void use(uint32_t mark, TraceUse use);
    // Reports what is certain now. `idle`: the device executes nothing. Returns the number of sites it has looked at.
    size_t report(DeviceModel &device, bool idle);

private:
    friend TraceMark;
    struct Site {
        uint32_t rules = 0;
        uint32_t broken = 0; // by all uses so far
        bool frozen = false; // it was executed: later uses are not considered
        bool reported = false;
        bool watched = false; // it has uses
        bool unused = false;  // its mark was released while it was watched
        std::optional<TraceUse> first;
        BrokenRules byFirst;
        std::vector<TraceUse> uses; // of which it is not known yet what they break
    };
    void start(Site &site) const;
    void giveBack(uint32_t index);
    // Stops watching a site. Its mark is free if it was released. Returns true, for std::erase_if.
    bool forget(uint32_t index);
    // Considers the uses of which it is known what they break. Returns whether none is left.
    static bool fold(const DeviceModel &device, Site &site);
    static void reportSite(DeviceModel &device, const Site &site);

    std::atomic<bool> any_ = false; // sites are watched; read without the mutex
    std::mutex mutex_;
    FixedMemory fixed_; // of `memory_` where that is possible: shaders with marks have the same words in every run
    GpuBuffer memory_;
    std::vector<Site> sites_;       // by mark
    std::vector<uint32_t> free_;    // marks
    std::vector<uint32_t> watched_; // marks whose sites were used, and of which more can become certain
};

// Top-level structures that shaders may trace rays in, whose instances or their micromaps may have been destroyed.
class TracedStructures
{
public:
    // The use is submitted. CommandLogs::submissions is held. `isOrdered`: what the structure holds then is known.
    void use(DeviceModel &device, const TraceUse &use, bool isOrdered);
    // Reports structures of which the instances are known now.
    void report(DeviceModel &device);

private:
    struct Traced {
        TraceUse use;
        uint64_t built = 0; // ValidatedStructure::built of the structure at that time
    };
    static void check(const DeviceModel &device, const Traced &traced, std::span<const VkDeviceAddress> references);

    std::atomic<bool> any_ = false; // read without the mutex
    std::mutex mutex_;
    std::vector<Traced> traced_; // traces whose instances are not known yet
};

// Submitted commands that trace rays and may not be complete, to find what they use below top-level structures.
// CommandLogs::submissions is held.
class PendingTraces
{
public:
    using IsPending = std::function<bool(VkQueue queue, uint64_t batch)>;
    // `isOrdered`: what structures hold when the command is executed is known.
    void add(const DeviceModel &device, TraceUse use, bool isOrdered);
    // Before an object is destroyed: reports a command that may still use it by way of a top-level structure: a
    // bottom-level structure, a micromap, or the buffer of one. `rule`: that commands which refer to it are complete.
    void check(const DeviceModel &device, const Place &command, const char *rule, const ReferredObject &object,
               const IsPending &isPending);
    void forgetComplete(const DeviceModel &device, const IsPending &isPending);

private:
    using Numbers = std::unordered_set<uint64_t>;
    struct Trace {
        TraceUse use;
        bool isOrdered = true;
        uint64_t constructions = 0;       // ValidatedObjects::constructions when it was submitted
        std::optional<Numbers> reached{}; // numbers of objects, once someone asks
        std::vector<std::function<void()>>
            faults{}; // if it is not ordered, and nothing was built before it is complete
    };
    static std::optional<Numbers> reachedBy(const DeviceModel &device, const TraceUse &use);
    std::map<std::pair<const StructureContents *, VkQueue>, Trace> traces_; // the last of each
};

// The check of what rays meet, a part of the check `gpu`.
struct DeviceTraces {
    DeviceModel &device;
    TraceMarks marks{};
    TracedStructures traced{};
    PendingTraces pending{};
    std::atomic<bool> deserializes = false; // a structure was deserialized
    HandleMap<VkPipeline, std::shared_ptr<const TracingCode>> pipelines{};
    HandleMap<VkShaderEXT, std::shared_ptr<const TracingCode>> shaders{};
};

void bindTracingPipeline(DeviceTraces &traces, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                         VkPipeline pipeline);
void bindTracingShaders(DeviceTraces &traces, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkShaderStageFlagBits *stages, const VkShaderEXT *shaders);
// `command` runs what is bound. Other bind points than those that the model knows run no traces.
void runTracing(DeviceTraces &traces, VkCommandBuffer commandBuffer, VkPipelineBindPoint point, const char *command);

// Records the commands that fill the contents of a structure, which a direct build constructs, beyond what the host
// knows.
void captureContents(DeviceModel &device, VkCommandBuffer commandBuffer, const input::StructureBuild &build,
                     StructureContents &contents);

} // namespace vellum::layer
