// SPDX-License-Identifier: Apache-2.0
// Creation of ray tracing pipelines: checks, flags and structures that the driver must not get, and what is kept of
// pipelines that use micromaps. Their stages are those of micromap_stages.h.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"
#include "layer/command_buffer/deferred_operation.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/driver_stages.h"
#include "layer/pipelines/micromap_stages.h"
#include "layer/pipelines/module_identifiers.h"

namespace vellum::layer
{

// The create infos of one vkCreateRayTracingPipelinesKHR as the driver gets them. Must live as long as the driver may
// read them.
class PipelineCreation : public DeferredWork
{
public:
    // `pipelines`: the application's array, which stays valid until a deferred operation is complete; null if no
    // pipeline is created, but its key or binaries.
    PipelineCreation(DevicePipelines &device, VkPipeline *pipelines);

    // Adds a pipeline. Returns the result of its creation if that fails before the driver is called. `accepted`: by the
    // check of the rules.
    VkResult add(const VkRayTracingPipelineCreateInfoKHR &info, bool accepted);
    // The driver's.
    [[nodiscard]] const std::vector<VkRayTracingPipelineCreateInfoKHR> &infos() const { return infos_; }
    // How the ray flags of the last pipeline are passed.
    [[nodiscard]] HiddenInBinary hidden() const;
    // Returns whether the driver's create infos differ from the application's, or finish() has anything to do.
    [[nodiscard]] bool changed() const;

    // Allocates what finish() needs, which must not fail.
    void reserve();
    // Called once the driver has created the pipelines, or failed to.
    void finish() noexcept override;

private:
    using RecordEntry = decltype(DevicePipelines::rayTracingPipelines)::Entry;

    // Kept of a pipeline once it is created.
    struct Kept {
        std::shared_ptr<RayTracingPipeline> record; // null without micromaps
        RecordEntry entry;                          // of the record
        // A library's pipeline for use in pipelines without micromaps, kept in librariesWithoutMicromaps.
        DevicePipelines::Flagged::Entry withoutMicromaps;
        std::vector<uint32_t> ownAnyHitGroups;
    };
    // Feedback that the driver writes, and the application's, which gets the first part of it.
    struct Feedback {
        VkPipelineCreationFeedback *application = nullptr;
        uint32_t count = 0;
        std::vector<VkPipelineCreationFeedback> own;
    };

    [[nodiscard]] std::string message(const std::string &text) const;
    VkResult chooseAsLibraries(const VkRayTracingPipelineCreateInfoKHR &info, bool &usesMicromaps);
    void warnOfTracing(const VkRayTracingPipelineCreateInfoKHR &info);

    VkResult passOn(VkRayTracingPipelineCreateInfoKHR &info);
    bool changeFlags(VkRayTracingPipelineCreateInfoKHR &info, VkFlags64 removed, VkFlags64 added);
    VkResult replaceIdentifiers(VkRayTracingPipelineCreateInfoKHR &info);

    VkResult addMicromapPipeline(VkRayTracingPipelineCreateInfoKHR &info);
    spirv::TracedFlags traceStages(const VkRayTracingPipelineCreateInfoKHR &info, RayTracingPipeline &record);
    spirv::HiddenFlags hiddenFlags(const VkRayTracingPipelineCreateInfoKHR &info, const spirv::TracedFlags &traced);
    void widenInterface(VkRayTracingPipelineCreateInfoKHR &info, const spirv::HiddenFlags &hidden);
    VkResult reserveFeedback(VkRayTracingPipelineCreateInfoKHR &info);

    DevicePipelines &device_;
    VkPipeline *pipelines_;
    std::vector<VkRayTracingPipelineCreateInfoKHR> infos_;
    std::vector<Kept> kept_; // one for each of the infos
    bool changed_ = false;   // by anything but the following

    // The infos point to these.
    DriverStages stages_;      // of pipelines without micromaps
    RewrittenModules modules_; // of pipelines with them
    std::deque<MicromapStages> micromapStages_;
    std::deque<Chain> chains_;
    std::deque<DriverIdentifiers> identifiers_;
    std::deque<VkRayTracingPipelineInterfaceCreateInfoKHR> interfaces_;
    std::deque<Feedback> feedback_;
};

// Calls `use` with the driver's create info. VK_PIPELINE_COMPILE_REQUIRED if code that must be rewritten is missing.
VkResult
withDriverInfo(DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
               const std::function<VkResult(const VkRayTracingPipelineCreateInfoKHR &, const HiddenInBinary &)> &use);

} // namespace vellum::layer
