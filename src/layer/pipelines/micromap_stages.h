// SPDX-License-Identifier: Apache-2.0
// Stages and groups of ray tracing pipelines that use micromaps, as the driver gets them: each stage is rewritten for
// the groups that use it, and every hit group has an any-hit shader.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/pipelines/driver_stages.h"
#include "layer/pipelines/ray_tracing_pipeline.h"
#include "spirv/payload_types.h"
#include "spirv/rewrite.h"

namespace vellum::layer
{

struct DevicePipelines;

// Rewritten code of stages, and the modules that hold it.
class RewrittenModules
{
public:
    explicit RewrittenModules(DevicePipelines &device) : device_(device), inlined_(device) {}
    ~RewrittenModules();
    RewrittenModules(const RewrittenModules &) = delete;
    RewrittenModules &operator=(const RewrittenModules &) = delete;

    // Replaces the code of a stage. VK_PIPELINE_COMPILE_REQUIRED if the stage has a module identifier and no code.
    VkResult rewrite(VkPipelineShaderStageCreateInfo &stage, spirv::Prologue prologue,
                     const spirv::HiddenFlags &hidden);
    // The layer's any-hit shader, for hit groups without one. VK_NULL_HANDLE if the driver could not create it, after a
    // message.
    VkShaderModule ownAnyHit(spirv::Prologue prologue, const spirv::HiddenFlags &hidden);

private:
    VkResult create(std::span<const uint32_t> words, VkShaderModule &module);
    using Key = std::tuple<VkShaderModule, VkShaderStageFlagBits, spirv::Prologue, spirv::HiddenFlags, std::string>;

    DevicePipelines &device_;
    DriverStages inlined_;
    std::map<Key, VkShaderModule> modules_;
};

// Payload types that the stages of a pipeline and its libraries declare (spirv/payload_types.h). `incoming`: per stage,
// those of libraries last, the type of the payload that it is called with, if it declares one; left empty if groups
// must not differ by it.
spirv::PayloadTypes payloadTypes(const DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
                                 std::vector<std::optional<spirv::TypeWords>> &incoming);

// The rewrite parameters of the stages of one pipeline.
struct StageRewrite {
    spirv::HiddenFlags hidden;                             // its payload: that of rays whose group declares none
    std::vector<std::optional<spirv::TypeWords>> payloads; // payloadTypes()
    bool hasCode = true;                                   // false for pipelines of binaries
    bool forLibrary = false;                               // groups of other pipelines may name the stages
};

// The stages and groups of one pipeline. The driver's groups name the driver's stages: those of the pipeline, and then
// those of its libraries, which "are treated as if they were defined as additional entries in pStages"
// (VkRayTracingPipelineCreateInfoKHR). A library has each stage of the application in a form that fits all groups.
class MicromapStages
{
public:
    MicromapStages(DevicePipelines &device, RewrittenModules &modules, StageRewrite rewrite)
        : device_(device), modules_(modules), rewrite_(std::move(rewrite))
    {
    }
    VkResult add(const VkRayTracingPipelineCreateInfoKHR &info, bool addNullGroup);
    // Notes in the record of a library which stages groups of other pipelines may name.
    void noteStages(RayTracingPipeline &library) const;

    std::vector<VkPipelineShaderStageCreateInfo> stages;
    std::vector<VkRayTracingShaderGroupCreateInfoKHR> groups;
    std::vector<uint32_t> ownAnyHitGroups; // groups whose any-hit shader is the layer's

private:
    // The source of a driver's stage: the application's stage, the code before it, and the payload type that it gets if
    // it declares none.
    using Key = std::tuple<uint32_t, spirv::Prologue, spirv::TypeWords>;

    [[nodiscard]] spirv::TypeWords payloadOf(const VkRayTracingShaderGroupCreateInfoKHR &group) const;
    [[nodiscard]] Key keyOf(uint32_t stage, spirv::Prologue prologue,
                            const VkRayTracingShaderGroupCreateInfoKHR &group) const;
    [[nodiscard]] spirv::HiddenFlags hiddenFor(const Key &key) const;
    [[nodiscard]] spirv::Prologue anyHitPrologue(const VkRayTracingShaderGroupCreateInfoKHR &group) const;
    VkResult addStages(const VkRayTracingPipelineCreateInfoKHR &info);
    void addLibraries(const VkRayTracingPipelineCreateInfoKHR &info);
    bool addOwnAnyHit(const Key &key);
    bool setShaders(VkRayTracingShaderGroupCreateInfoKHR &group) const;

    DevicePipelines &device_;
    RewrittenModules &modules_;
    StageRewrite rewrite_;
    std::map<Key, uint32_t> index_;         // into stages
    std::vector<LibraryStage> namedStages_; // stages that groups may name: the application's, then those of libraries
    uint32_t driverStages_ = 0;             // including those of libraries
};

} // namespace vellum::layer
