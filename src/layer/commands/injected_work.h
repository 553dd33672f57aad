// GPU work that the layer adds to the application's command buffers.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>

#include <vulkan/vulkan.h>

#include "layer/commands/command_state.h"
#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

struct DeviceCommands;

enum class InjectedShader {
    BlasRecords,
    TlasInstances,
    HitRecords,
    StructureCopy,
    StructureSave,
    StructureRestore,
    StructureSize,
    TopSave,
    MicromapClear,
    MicromapStay,
    MicromapCheck,
    MicromapAnalyse,
    MicromapParts,
    MicromapShare,
    MicromapSums,
    MicromapScan,
    MicromapPlace,
    MicromapFold,
    MicromapOwners,
    MicromapLossy,
    MicromapLossyParts,
    MicromapLossyChoose,
    MicromapMove,
    QueryValue,
    MicromapTriangles,
    WideIndices,
    MarkedSize,
    Count
};

// Push constants of the shaders: the structures match the `Push` blocks in src/shaders.
struct MicromapPush {
    VkDeviceAddress micromap, triangleArray, data, scratch, log;
    uint64_t object;
    uint32_t triangleArrayStride, triangleCount, readable, dataBytes, capacityUnits, partCapacity, tableMask, flags;
    uint32_t alike, lastOffset, staysPerInvocation, unused;
};
struct MicromapMovePush {
    VkDeviceAddress micromap, serialized, log;
    uint64_t object, micromapBytes, serializedBytes;
    uint32_t driverUuid[4];
    VkDeviceAddress root;
    uint32_t mode, invocations;
};
struct QueryValuePush {
    VkDeviceAddress target, micromap;
    uint64_t micromapBytes;
    uint32_t kind, padding;
};
struct BlasRecordsPush {
    VkDeviceAddress tail, micromap, indices, cell, log, range;
    uint64_t object;
    VkDeviceAddress source, sourceBegin, begin;
    uint32_t triangleCount, indexBytes, indexStride, readable, baseTriangle, geometryWord, geometryCount, tailUnits,
        geometry, named, micromapSize, commonUnits;
};
enum class InstancesFrom : uint32_t { Array, Pointers, Structure, Serialized };
struct TlasInstancesPush {
    VkDeviceAddress source, target, root, tail, cell;
    VkDeviceAddress range; // of an indirect build, a VkAccelerationStructureBuildRangeInfoKHR; 0: it is not indirect
    uint32_t count, firstSlot;
    InstancesFrom from;
    uint32_t pass;
};
struct StructureCopyPush {
    VkDeviceAddress sourceCell, targetCell, sourceBegin, targetBegin, root;
    uint32_t sourceUnits, targetUnits, compact, whole;
};
struct StructureSavePush {
    VkDeviceAddress cell, begin, staging, blob, root;
    uint32_t structureUnits, stagingUnits, leastUnits, capacity, wholeCopies, pass, blocks, padding;
};
enum class RestorePass : uint32_t { Check, AddUp, Decide, Stage, Finish, Keep, GiveBack, GiveBackLast };
struct StructureRestorePush {
    VkDeviceAddress blob, staging, cell, begin, root, blank, kept;
    uint32_t blankUnits, capacity, stagingUnits, targetUnits, kind, keptUnits, blankBuiltUnits, topWay;
    RestorePass pass;
    uint32_t serial; // of this command: what the cell says once the device has carried it out
};
struct StructureSizePush {
    VkDeviceAddress cell, begin, value;
    uint32_t structureUnits, property, wholeCopies;
};
struct TopSavePush {
    VkDeviceAddress cell, begin, blob, root, blank;
    uint32_t structureUnits, leastUnits, capacity, pass;
};
struct HitRecordsPush {
    VkDeviceAddress source, target, command, commandCopy;
    uint32_t size, stride;
    uint32_t handle[8];
};
struct MicromapTrianglesPush {
    VkDeviceAddress source, target;
    uint32_t stride, count, readable, shift;
};
struct MarkedSizePush {
    VkDeviceAddress value;
};
struct WideIndicesPush {
    VkDeviceAddress source, target;
    uint32_t stride, count, readable, padding;
};
inline constexpr uint32_t kPushBytes = 128; // the least that every device has

// The compute pipelines of the injected work; each is made when it is needed first.
class InjectedPipelines
{
public:
    ~InjectedPipelines();
    // `pushBytes`: of the layout, kPushBytes or more.
    VkResult create(const GpuContext &context, uint32_t pushBytes);
    // VK_NULL_HANDLE where the driver could not make it.
    VkPipeline get(InjectedShader shader);
    [[nodiscard]] VkPipelineLayout layout() const { return layout_; }
    [[nodiscard]] uint32_t pushBytes() const { return pushBytes_; }

private:
    GpuContext context_;
    uint32_t pushBytes_ = kPushBytes;
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
    InjectedWork(DeviceCommands &device, VkCommandBuffer commandBuffer);
    ~InjectedWork();
    InjectedWork(const InjectedWork &) = delete;
    InjectedWork &operator=(const InjectedWork &) = delete;

    // True, with a message, where `command` cannot be carried out because a secondary command buffer inherits
    // conditional rendering: it cannot be suspended there, and would discard the layer's dispatches but not the
    // driver's builds.
    static bool refusedIn(const DeviceCommands &device, VkCommandBuffer commandBuffer, const char *command);

    // Runs at least `invocations` invocations of a shader. Returns false, and reports, where it has no pipeline.
    template <typename Push>
    bool dispatch(InjectedShader shader, const Push &push, uint64_t invocations, uint32_t groupSize)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return run(shader, &push, sizeof(Push), groupsOf(invocations, groupSize));
    }
    template <typename Push>
    bool dispatch(InjectedShader shader, const Push &push, const VkDispatchIndirectCommand &groups)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return run(shader, &push, sizeof(Push), groups);
    }
    // The same with a number of groups that a VkDispatchIndirectCommand says.
    template <typename Push>
    bool dispatchIndirect(InjectedShader shader, const Push &push, VkBuffer buffer, VkDeviceSize offset)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return runIndirect(shader, &push, sizeof(Push), buffer, offset);
    }
    // How the invocations of a dispatch are laid out, in groups.
    static VkDispatchIndirectCommand groupsOf(uint64_t invocations, uint32_t groupSize);
    // Orders what came before in the command buffer, ours and the application's, before what comes after; and before
    // what the host reads.
    void barrier(bool forHost = false);

private:
    bool run(InjectedShader shader, const void *push, uint32_t pushBytes, const VkDispatchIndirectCommand &groups);
    bool runIndirect(InjectedShader shader, const void *push, uint32_t pushBytes, VkBuffer buffer, VkDeviceSize offset);
    void uploadPushConstants();
    // Makes ready for a dispatch of the shader.
    bool bind(InjectedShader shader, const void *push, uint32_t pushBytes);

    DeviceCommands &device_;
    VkCommandBuffer commandBuffer_;
    CommandState *state_; // null of a command buffer that is not the application's
    bool disturbed_ = false;
};

} // namespace vellum::layer
