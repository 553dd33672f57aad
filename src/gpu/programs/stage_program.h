// SPDX-License-Identifier: Apache-2.0
// A pipeline that runs one shader, of any stage, once for each of a number of rays.
#pragma once

#include "gpu/launch.h"

#include <memory>

namespace vellum::gpu
{

struct StageShader {
    VkShaderStageFlagBits stage = VK_SHADER_STAGE_COMPUTE_BIT;
    std::span<const uint32_t> words;
    const VkSpecializationInfo *specialization = nullptr;
    bool inlineModule = false; // VkShaderModuleCreateInfo in the stage's pNext
    // Compute: not null: a shader object (VK_EXT_shader_object) with that set, and push constants of that size.
    VkDescriptorSetLayout objectLayout = VK_NULL_HANDLE;
    uint32_t pushSize = 0;
    bool vertexBuffers = false; // vertex shader: gets its number from vertex buffers (tracer.glsl, BUFFERS)
    bool dynamicStrides = false;
};

class StageProgram
{
public:
    static constexpr uint32_t kMostRays = 4096; // the least that a device may limit the width of an image to

    StageProgram() = default;
    StageProgram(const StageProgram &) = delete;
    StageProgram &operator=(const StageProgram &) = delete;
    virtual ~StageProgram() = default;

    [[nodiscard]] virtual VkPipelineBindPoint point() const = 0;
    // Binds it, and buffers that its commands read.
    virtual void bind(VkCommandBuffer commands) const = 0;
    // The next launches run the shader for each number below `count`, for some perhaps repeatedly. The commands are
    // dispatches, draws or traces: direct ones, indirect ones, or with Launch::Indirect2 vkCmdTraceRaysIndirect2KHR and
    // those of VK_KHR_device_address_commands.
    virtual void prepare(const LaunchPlan &launch, uint32_t count) = 0;
    virtual void launch(VkCommandBuffer commands) const = 0;
    // The scene that launcher.rgen traces; 0 if none.
    [[nodiscard]] virtual VkDeviceAddress helperScene() const { return 0; }
};

// Stages that use push constants of a program whose shader is of that stage.
VkShaderStageFlags pushStages(VkShaderStageFlagBits stage);

std::unique_ptr<StageProgram> makeStageProgram(Device &gpu, VkPipelineLayout layout, const StageShader &shader);

} // namespace vellum::gpu
