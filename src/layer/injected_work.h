// GPU work that the layer adds to the application's command buffers.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>

#include <vulkan/vulkan.h>

#include "layer/command_state.h"
#include "layer/gpu_memory.h"

namespace vellum::layer
{

struct Device;

enum class InjectedShader {
    MicromapClear,
    MicromapCheck,
    MicromapAnalyse,
    MicromapParts,
    MicromapShare,
    MicromapSums,
    MicromapScan,
    MicromapPlace,
    MicromapFold,
    MicromapOwners,
    MicromapMove,
    QueryValue,
    QueryCopy,
    BlasRecords,
    TlasInstances,
    RayFlagProbe,
    Count
};

// Push constants of the shaders: the structures match the `Push` blocks in src/shaders.
struct MicromapPush {
    VkDeviceAddress micromap, triangleArray, data, scratch, log;
    uint64_t object;
    uint32_t triangleArrayStride, triangleCount, readable, dataBytes, capacityUnits, partCapacity, tableMask, flags;
};
struct MicromapMovePush {
    VkDeviceAddress micromap, serialized, log;
    uint64_t object, micromapBytes, serializedBytes;
    uint32_t driverUuid[4];
    uint32_t mode, invocations;
};
struct QueryValuePush {
    VkDeviceAddress target, source;
    uint64_t constant, sourceBytes;
    uint32_t kind, padding;
};
struct QueryCopyPush {
    VkDeviceAddress values, availability, target;
    uint32_t count, flags;
};
struct BlasRecordsPush {
    VkDeviceAddress geometryRecord, triangleRecords, micromap, indices, cell, firstGeometryRecord;
    uint32_t triangleCount, indexBytes, indexStride, readable, baseTriangle, geometryWord;
};
struct TlasInstancesPush {
    VkDeviceAddress source, target, root;
    uint32_t count, firstSlot, arrayOfPointers;
};
struct RayFlagProbePush {
    VkDeviceAddress scene, result;
    uint32_t rayFlags, padding;
};
inline constexpr uint32_t kPushBytes = 128; // the least that every device has

// The compute pipelines of the injected work; each is made when it is needed first.
class InjectedPipelines
{
public:
    ~InjectedPipelines();
    VkResult create(const GpuContext &context);
    // VK_NULL_HANDLE where the driver could not make it.
    VkPipeline get(InjectedShader shader);
    [[nodiscard]] VkPipelineLayout layout() const { return layout_; }

private:
    GpuContext context_;
    std::mutex mutex_;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    std::array<VkPipeline, static_cast<size_t>(InjectedShader::Count)> pipelines_{};
};

// One stretch of injected work. At its end the command buffer's compute pipeline or shader, push constants and
// conditional rendering are as the application set them.
//
// Barriers are full ones (all commands before -> compute -> all commands after): what the application ordered against
// acceleration structure or micromap builds is ordered against the injected dispatches too.
class InjectedWork
{
public:
    InjectedWork(Device &device, VkCommandBuffer commandBuffer);
    ~InjectedWork();
    InjectedWork(const InjectedWork &) = delete;
    InjectedWork &operator=(const InjectedWork &) = delete;

    // True, with a message, where `command` cannot be carried out because a secondary command buffer inherits
    // conditional rendering: it cannot be suspended there, and would discard the layer's dispatches but not the
    // driver's builds.
    static bool refusedIn(const Device &device, VkCommandBuffer commandBuffer, const char *command);

    // Runs at least `invocations` invocations of a shader. Returns false, and reports, where it has no pipeline.
    template <typename Push>
    bool dispatch(InjectedShader shader, const Push &push, uint64_t invocations, uint32_t groupSize)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return run(shader, &push, sizeof(Push), (invocations + groupSize - 1) / groupSize);
    }
    // Orders what came before in the command buffer, ours and the application's, before what comes after; and before
    // what the host reads.
    void barrier(bool forHost = false);
    // Keeps a buffer for as long as what is recorded in the command buffer may run.
    void keep(GpuBuffer buffer);

private:
    bool run(InjectedShader shader, const void *push, uint32_t pushBytes, uint64_t groups);

    Device &device_;
    VkCommandBuffer commandBuffer_;
    std::shared_ptr<CommandState> state_;
    bool disturbed_ = false;
};

} // namespace vellum::layer
