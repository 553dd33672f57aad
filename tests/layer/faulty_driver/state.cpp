// SPDX-License-Identifier: Apache-2.0
// Faults in what commands leave to those that follow, and in the parameters that the device reads.
#include "faulty_driver/faults.h"

#include <map>
#include <set>

namespace faults
{
namespace
{

constexpr Level kLevel = Level::State;

std::mutex mutex;

// --- "build-clears-push-constants" ---

struct Pushed {
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkShaderStageFlags stages = 0;
};
std::map<VkCommandBuffer, Pushed> pushed;

VKAPI_ATTR void VKAPI_CALL pushConstants(VkCommandBuffer handle, VkPipelineLayout layout, VkShaderStageFlags stages,
                                         uint32_t offset, uint32_t size, const void *values)
{
    if (offset == 0) {
        std::lock_guard lock(mutex);
        pushed[handle] = {layout, stages};
    }
    DRIVER_NEXT(vkCmdPushConstants)(handle, layout, stages, offset, size, values);
}

void clearPushConstants(VkCommandBuffer handle)
{
    Pushed last;
    {
        std::lock_guard lock(mutex);
        if (const auto found = pushed.find(handle); found != pushed.end())
            last = found->second;
    }
    const uint32_t zero = 0;
    if (last.layout != VK_NULL_HANDLE && has(keyOf(handle), "build-clears-push-constants"))
        DRIVER_NEXT(vkCmdPushConstants)(handle, last.layout, last.stages, 0, sizeof zero, &zero);
}

// --- "build-under-predicate" ---

std::set<VkCommandBuffer> conditional;

VKAPI_ATTR void VKAPI_CALL beginConditional(VkCommandBuffer handle, const VkConditionalRenderingBeginInfoEXT *info)
{
    {
        std::lock_guard lock(mutex);
        conditional.insert(handle);
    }
    DRIVER_NEXT(vkCmdBeginConditionalRenderingEXT)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL endConditional(VkCommandBuffer handle)
{
    {
        std::lock_guard lock(mutex);
        conditional.erase(handle);
    }
    DRIVER_NEXT(vkCmdEndConditionalRenderingEXT)(handle);
}

// Whatever the predicate is.
bool discards(VkCommandBuffer handle)
{
    std::lock_guard lock(mutex);
    return conditional.contains(handle) && has(keyOf(handle), "build-under-predicate");
}

VKAPI_ATTR VkResult VKAPI_CALL begin(VkCommandBuffer handle, const VkCommandBufferBeginInfo *info)
{
    {
        std::lock_guard lock(mutex);
        pushed.erase(handle);
        conditional.erase(handle);
    }
    return DRIVER_NEXT(vkBeginCommandBuffer)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL buildMicromaps(VkCommandBuffer handle, uint32_t count, const VkMicromapBuildInfoEXT *infos)
{
    if (!discards(handle))
        DRIVER_NEXT(vkCmdBuildMicromapsEXT)(handle, count, infos);
    clearPushConstants(handle);
}

VKAPI_ATTR void VKAPI_CALL build(VkCommandBuffer handle, uint32_t count, const BuildInfo *infos,
                                 const RangeInfo *const *ranges)
{
    if (!discards(handle))
        DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, count, infos, ranges);
    clearPushConstants(handle);
}

// --- "indirect-trace-hit-stride" ---

VKAPI_ATTR void VKAPI_CALL traceRaysIndirect2(VkCommandBuffer handle, VkDeviceAddress address)
{
    if (has(keyOf(handle), "indirect-trace-hit-stride")) {
        const Memory memory = memoryFor(handle, sizeof(VkTraceRaysIndirectCommand2KHR));
        beforeExecution(handle, [memory, address] {
            VkTraceRaysIndirectCommand2KHR command;
            std::memcpy(&command, hostPointer<const void>(address), sizeof command);
            command.hitShaderBindingTableStride = 0;
            std::memcpy(memory.bytes, &command, sizeof command);
        });
        address = memory.address;
    }
    DRIVER_NEXT(vkCmdTraceRaysIndirect2KHR)(handle, address);
}

// --- "deferred-copies-forgotten", "every-version-accepted" ---

VKAPI_ATTR VkResult VKAPI_CALL copyOnHost(VkDevice handle, VkDeferredOperationKHR operation,
                                          const VkCopyMicromapInfoEXT *info)
{
    if (operation != VK_NULL_HANDLE && has(keyOf(handle), "deferred-copies-forgotten"))
        return VK_OPERATION_NOT_DEFERRED_KHR;
    return DRIVER_NEXT(vkCopyMicromapEXT)(handle, operation, info);
}

VKAPI_ATTR void VKAPI_CALL micromapCompatibility(VkDevice handle, const VkMicromapVersionInfoEXT *info,
                                                 VkAccelerationStructureCompatibilityKHR *compatibility)
{
    DRIVER_NEXT(vkGetDeviceMicromapCompatibilityEXT)(handle, info, compatibility);
    if (has(keyOf(handle), "every-version-accepted"))
        *compatibility = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
}

VKAPI_ATTR void VKAPI_CALL structureCompatibility(VkDevice handle, const VkAccelerationStructureVersionInfoKHR *info,
                                                  VkAccelerationStructureCompatibilityKHR *compatibility)
{
    DRIVER_NEXT(vkGetDeviceAccelerationStructureCompatibilityKHR)(handle, info, compatibility);
    if (has(keyOf(handle), "every-version-accepted"))
        *compatibility = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
}

} // namespace

LevelRows stateRows()
{
    static const Row device[]{
        {"vkBeginCommandBuffer", DRIVER_FUNCTION(begin)},
        {"vkCmdPushConstants", DRIVER_FUNCTION(pushConstants)},
        {"vkCmdBeginConditionalRenderingEXT", DRIVER_FUNCTION(beginConditional)},
        {"vkCmdEndConditionalRenderingEXT", DRIVER_FUNCTION(endConditional)},
        {"vkCmdBuildMicromapsEXT", DRIVER_FUNCTION(buildMicromaps)},
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(build)},
        {"vkCmdTraceRaysIndirect2KHR", DRIVER_FUNCTION(traceRaysIndirect2)},
        {"vkCopyMicromapEXT", DRIVER_FUNCTION(copyOnHost)},
        {"vkGetDeviceMicromapCompatibilityEXT", DRIVER_FUNCTION(micromapCompatibility)},
        {"vkGetDeviceAccelerationStructureCompatibilityKHR", DRIVER_FUNCTION(structureCompatibility)},
    };
    return {device, {}};
}

} // namespace faults
