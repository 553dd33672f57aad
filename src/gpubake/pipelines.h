// SPDX-License-Identifier: Apache-2.0
// The GPU baker's compute pipelines, all with one layout: an image in set 0, and push constants.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vulkan/vulkan.h>

namespace vellum::gpubake
{

// The Vulkan functions that the GPU baker calls, from the application's vkGetDeviceProcAddr.
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

// In the order in which they run.
enum class Shader : uint8_t {
    Params,
    Begin,
    Cells,
    Blocks,
    Plan,
    Count,
    Scan,
    Place,
    Probe,
    Measure,
    Write,
    Records,
};
inline constexpr size_t kShaders = 12;

// Push constants are at most what every device has.
inline constexpr uint32_t kPushBytes = 128;

class Pipelines
{
public:
    Pipelines(VkDevice device, const VkAllocationCallbacks *allocator) : device_(device), allocator_(allocator) {}
    ~Pipelines();
    Pipelines(const Pipelines &) = delete;
    Pipelines &operator=(const Pipelines &) = delete;

    VkResult create(PFN_vkGetDeviceProcAddr getDeviceProcAddr, VkPipelineCache cache);

    [[nodiscard]] VkDevice device() const { return device_; }
    [[nodiscard]] const VkAllocationCallbacks *allocator() const { return allocator_; }
    [[nodiscard]] const Functions &functions() const { return functions_; }
    [[nodiscard]] VkDescriptorSetLayout setLayout() const { return setLayout_; }
    [[nodiscard]] VkPipelineLayout layout() const { return layout_; }
    [[nodiscard]] VkPipeline operator[](Shader shader) const { return pipelines_[static_cast<size_t>(shader)]; }

private:
    VkResult createLayouts();

    VkDevice device_;
    const VkAllocationCallbacks *allocator_;
    bool loaded_ = false;
    Functions functions_;
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    std::array<VkPipeline, kShaders> pipelines_{};
};

} // namespace vellum::gpubake
