// SPDX-License-Identifier: Apache-2.0
// The Vulkan functions that the GPU baker calls, from the application's vkGetDeviceProcAddr.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::gpubake
{

#define VELLUM_GPU_BAKE_FUNCTIONS(X)                                                                                   \
    X(AllocateDescriptorSets)                                                                                          \
    X(CmdBindDescriptorSets)                                                                                           \
    X(CmdBindPipeline)                                                                                                 \
    X(CmdDispatch)                                                                                                     \
    X(CmdDispatchIndirect)                                                                                             \
    X(CmdPipelineBarrier)                                                                                              \
    X(CmdPushConstants)                                                                                                \
    X(CreateComputePipelines)                                                                                          \
    X(CreateDescriptorPool)                                                                                            \
    X(CreateDescriptorSetLayout)                                                                                       \
    X(CreatePipelineLayout)                                                                                            \
    X(CreateShaderModule)                                                                                              \
    X(DestroyDescriptorPool)                                                                                           \
    X(DestroyDescriptorSetLayout)                                                                                      \
    X(DestroyPipeline)                                                                                                 \
    X(DestroyPipelineLayout)                                                                                           \
    X(DestroyShaderModule)                                                                                             \
    X(UpdateDescriptorSets)

struct Functions {
    // False where one is missing.
    bool load(VkDevice device, PFN_vkGetDeviceProcAddr getDeviceProcAddr);

#define VELLUM_GPU_BAKE_MEMBER(name) PFN_vk##name name = nullptr;
    VELLUM_GPU_BAKE_FUNCTIONS(VELLUM_GPU_BAKE_MEMBER)
#undef VELLUM_GPU_BAKE_MEMBER
};

} // namespace vellum::gpubake
