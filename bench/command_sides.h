// SPDX-License-Identifier: Apache-2.0
// Devices that record the same commands: on the driver alone, below the layer that provides nothing, and below the
// layer that provides micromaps.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "gpu/device.h"
#include "vk/vk_init.h"

namespace vellum::bench
{

#define VELLUM_BENCH_COMMANDS(X)                                                                                       \
    X(DestroyDevice)                                                                                                   \
    X(DeviceWaitIdle)                                                                                                  \
    X(GetDeviceQueue)                                                                                                  \
    X(QueueSubmit)                                                                                                     \
    X(QueueSubmit2)                                                                                                    \
    X(CreateCommandPool)                                                                                               \
    X(DestroyCommandPool)                                                                                              \
    X(AllocateCommandBuffers)                                                                                          \
    X(FreeCommandBuffers)                                                                                              \
    X(BeginCommandBuffer)                                                                                              \
    X(EndCommandBuffer)                                                                                                \
    X(ResetCommandPool)                                                                                                \
    X(CreateFence)                                                                                                     \
    X(DestroyFence)                                                                                                    \
    X(GetFenceStatus)                                                                                                  \
    X(WaitForFences)                                                                                                   \
    X(CreateEvent)                                                                                                     \
    X(DestroyEvent)                                                                                                    \
    X(CreateBuffer)                                                                                                    \
    X(DestroyBuffer)                                                                                                   \
    X(GetBufferMemoryRequirements)                                                                                     \
    X(AllocateMemory)                                                                                                  \
    X(FreeMemory)                                                                                                      \
    X(BindBufferMemory)                                                                                                \
    X(MapMemory)                                                                                                       \
    X(UnmapMemory)                                                                                                     \
    X(GetBufferDeviceAddress)                                                                                          \
    X(CreateQueryPool)                                                                                                 \
    X(DestroyQueryPool)                                                                                                \
    X(GetQueryPoolResults)                                                                                             \
    X(CreateDescriptorSetLayout)                                                                                       \
    X(DestroyDescriptorSetLayout)                                                                                      \
    X(CreatePipelineLayout)                                                                                            \
    X(DestroyPipelineLayout)                                                                                           \
    X(CreateShaderModule)                                                                                              \
    X(DestroyShaderModule)                                                                                             \
    X(CreateComputePipelines)                                                                                          \
    X(CreateGraphicsPipelines)                                                                                         \
    X(CreateRayTracingPipelinesKHR)                                                                                    \
    X(DestroyPipeline)                                                                                                 \
    X(CreatePrivateDataSlot)                                                                                           \
    X(DestroyPrivateDataSlot)                                                                                          \
    X(SetPrivateData)                                                                                                  \
    X(GetPrivateData)                                                                                                  \
    X(CreateAccelerationStructureKHR)                                                                                  \
    X(DestroyAccelerationStructureKHR)                                                                                 \
    X(GetAccelerationStructureBuildSizesKHR)                                                                           \
    X(GetAccelerationStructureDeviceAddressKHR)                                                                        \
    X(CmdBuildAccelerationStructuresKHR)                                                                               \
    X(CmdBindPipeline)                                                                                                 \
    X(CmdPushConstants)                                                                                                \
    X(CmdDispatch)                                                                                                     \
    X(CmdDispatchIndirect)                                                                                             \
    X(CmdCopyBuffer)                                                                                                   \
    X(CmdBindIndexBuffer)                                                                                              \
    X(CmdPipelineBarrier)                                                                                              \
    X(CmdPipelineBarrier2)                                                                                             \
    X(CmdSetEvent2)                                                                                                    \
    X(CmdResetEvent2)                                                                                                  \
    X(CmdWaitEvents2)                                                                                                  \
    X(CmdWriteTimestamp2)                                                                                              \
    X(CmdResetQueryPool)                                                                                               \
    X(CmdCopyQueryPoolResults)                                                                                         \
    X(CmdExecuteCommands)                                                                                              \
    X(CmdTraceRaysKHR)                                                                                                 \
    X(CmdSetRayTracingPipelineStackSizeKHR)

// Null on devices that lack their extension.
#define VELLUM_BENCH_OPTIONAL_COMMANDS(X)                                                                              \
    X(CmdBeginConditionalRenderingEXT)                                                                                 \
    X(CmdEndConditionalRenderingEXT)                                                                                   \
    X(CmdCopyMemoryKHR)                                                                                                \
    X(CmdDispatchIndirect2KHR)                                                                                         \
    X(CmdBindIndexBuffer3KHR)

struct CommandTable {
#define VELLUM_MEMBER(name) PFN_vk##name name = nullptr;
    VELLUM_BENCH_COMMANDS(VELLUM_MEMBER)
    VELLUM_BENCH_OPTIONAL_COMMANDS(VELLUM_MEMBER)
#undef VELLUM_MEMBER
};

struct BenchBuffer {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkDeviceAddress address = 0;
};

// A device, everything that the measured commands name, and commands straight from vkGetDeviceProcAddr, without the
// loader's trampolines.
class CommandSide
{
public:
    // `objects`: so many buffers, command buffers and acceleration structures are there besides those that are used.
    CommandSide(std::string name, const gpu::DeviceInfo &info, std::optional<gpu::Api> api, uint32_t objects);
    ~CommandSide();
    CommandSide(const CommandSide &) = delete;
    CommandSide &operator=(const CommandSide &) = delete;

    [[nodiscard]] VkCommandPool makePool() const;
    [[nodiscard]] VkCommandBuffer allocate(VkCommandPool pool, VkCommandBufferLevel level) const;
    void begin(VkCommandBuffer commands, VkCommandBufferUsageFlags flags = 0) const;
    [[nodiscard]] BenchBuffer makeBuffer(VkDeviceSize bytes, VkBufferUsageFlags usage) const;
    void destroy(const BenchBuffer &buffer) const;
    [[nodiscard]] VkShaderModule makeModule(const uint32_t *words, size_t bytes) const;
    [[nodiscard]] VkPipeline makeCompute(VkShaderModule module) const;
    [[nodiscard]] VkPipeline makeGraphics() const;
    [[nodiscard]] VkPipeline makeRayTracing(bool micromaps) const;

    std::string name;
    std::optional<gpu::Api> api; // the layer provides it
    VkDevice device = VK_NULL_HANDLE;
    VkQueue queue = VK_NULL_HANDLE;
    CommandTable vk;

    VkCommandPool secondaryPool = VK_NULL_HANDLE;
    VkCommandBuffer secondary = VK_NULL_HANDLE; // recorded
    VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkShaderModule plain = VK_NULL_HANDLE, queries = VK_NULL_HANDLE, vertex = VK_NULL_HANDLE, fragment = VK_NULL_HANDLE;
    VkShaderModule raygen = VK_NULL_HANDLE, miss = VK_NULL_HANDLE, closestHit = VK_NULL_HANDLE, anyHit = VK_NULL_HANDLE;
    VkPipeline compute = VK_NULL_HANDLE, graphics = VK_NULL_HANDLE, rayTracing = VK_NULL_HANDLE;
    BenchBuffer buffer, other, storage;
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    VkQueryPool timestamps = VK_NULL_HANDLE;
    VkEvent event = VK_NULL_HANDLE;
    VkFence fence = VK_NULL_HANDLE; // signaled
    VkPrivateDataSlot slot = VK_NULL_HANDLE;

private:
    void createDevice(const gpu::DeviceInfo &info);
    void createObjects(uint32_t objects);

    VkPhysicalDevice physical_ = VK_NULL_HANDLE;
    std::vector<VkCommandPool> pools_;
    std::vector<BenchBuffer> buffers_;
    BenchBuffer manyStorage_; // of the structures
    std::vector<VkAccelerationStructureKHR> structures_;
};

} // namespace vellum::bench
