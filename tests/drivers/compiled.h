// SPDX-License-Identifier: Apache-2.0
// Pipelines that are made to see what a driver's compiler makes of their shaders, and never run.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "gpu/pipeline_builder.h"
#include "harness/harness.h"
#include "modules.h"

namespace vellum::test
{

// Drivers that compile for GPUs that are not there: Mesa's for GPUs of AMD, Intel and Qualcomm.
enum class Driver { Radv, Anv, Turnip };
Driver driverOf(const std::string &gpu);

// Lets this process have a GPU that is not there (kernel/absent_gpu.h), use its driver without its cache on disk, and
// the layers of this build, from the next instance on. Gives back why it cannot; nothing if it can.
std::string useGpu(const std::string &gpu, vt::Options &options);

// One shader as reported by VK_KHR_pipeline_executable_properties.
struct Executable {
    std::string name;
    VkShaderStageFlags stages = 0;
    std::map<std::string, uint64_t> statistics;
};

// A pipeline layout with every binding that some modules have, and push constants for all stages.
class Layout
{
public:
    Layout(vt::Device &gpu, const std::vector<ModuleFacts> &modules);
    Layout(const Layout &) = delete;
    Layout &operator=(const Layout &) = delete;
    ~Layout();
    [[nodiscard]] VkPipelineLayout handle() const { return layout_; }

private:
    vt::Device &gpu_;
    std::vector<VkDescriptorSetLayout> sets_;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
};

class Compiled
{
public:
    // A compute pipeline of one entry point of a module.
    static Compiled compute(vt::Device &gpu, std::span<const uint32_t> words, const std::string &entry = "main");
    // A fragment shader behind a vertex shader that writes nothing that it reads.
    static Compiled graphics(vt::Device &gpu, std::span<const uint32_t> vertex, std::span<const uint32_t> fragment);
    // If `setup` has no layout, creates one for its stages.
    static Compiled rays(vt::Device &gpu, vt::PipelineSetup setup);

    Compiled(Compiled &&other) noexcept;
    Compiled &operator=(Compiled &&) = delete;
    ~Compiled();
    [[nodiscard]] VkPipeline handle() const { return pipeline_; }
    [[nodiscard]] std::vector<Executable> executables() const;

private:
    explicit Compiled(vt::Device &gpu) : gpu_(&gpu) {}

    vt::Device *gpu_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

} // namespace vellum::test
