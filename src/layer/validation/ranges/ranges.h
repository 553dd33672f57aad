// SPDX-License-Identifier: Apache-2.0
// Address ranges of VK_KHR_device_address_commands, and the commands that take them.
#pragma once

#include "layer/validation/objects.h"
#include "layer/validation/place.h"
#include "layer/validation/ranges/range_rules.h"

namespace vellum::layer
{

// What a command requires of a range, beyond the rules of its flags. Without an id there is no such rule.
struct RangeNeed {
    VkFlags64 usage = 0; // of the buffer
    const char *usageRule = nullptr;
    VkDeviceSize alignment = 1; // of the address
    const char *alignmentRule = nullptr;
    VkDeviceSize least = 0; // size
    const char *leastRule = nullptr;
};

// Checks the ranges of one command.
class RangeCheck
{
public:
    RangeCheck(DeviceValidation &device, VkCommandBuffer commandBuffer) : device_(device), commandBuffer_(commandBuffer)
    {
    }
    // `place`: of the structure or command that has the range.
    void check(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
               const RangeFlagRules &rules, const RangeNeed &need) const;
    void check(const Place &place, const VkStridedDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
               const RangeFlagRules &rules, const RangeNeed &need) const;
    // The rules of the flags only.
    void checkFlags(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                    const RangeFlagRules &rules) const;
    void fault(const Place &place, const char *vuid, const std::string &text) const;

    // Ids for the flag PROTECTED in a command buffer that is not protected, and for its absence in one that is.
    void checkProtection(const Place &place, const char *member, VkAddressCommandFlagsKHR flags,
                         const char *unprotectedRule, const char *protectedRule) const;
    [[nodiscard]] bool isProtected() const; // the command buffer

private:
    struct Ids {
        const char *null, *buffer;
    };
    void check(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
               const RangeFlagRules &rules, const RangeNeed &need, const Ids &ids) const;
    void checkUsageFlags(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                         const RangeFlagRules &rules) const;
    void checkBinding(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                      const RangeFlagRules &rules) const;

    DeviceValidation &device_;
    VkCommandBuffer commandBuffer_;
};

// Such as "0x1000 + 64 bytes".
std::string textOf(const VkDeviceAddressRangeKHR &range);

namespace validation
{

VkResult queueBindSparse(DeviceValidation &, VkQueue, uint32_t, const VkBindSparseInfo *, VkFence);

// range_copies.cpp
void cmdCopyMemory(DeviceValidation &, VkCommandBuffer, const VkCopyDeviceMemoryInfoKHR *);
void cmdUpdateMemory(DeviceValidation &, VkCommandBuffer, const VkDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                     VkDeviceSize, const void *);
void cmdFillMemory(DeviceValidation &, VkCommandBuffer, const VkDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                   uint32_t);
void cmdCopyQueryPoolResultsToMemory(DeviceValidation &, VkCommandBuffer, VkQueryPool, uint32_t, uint32_t,
                                     const VkStridedDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                                     VkQueryResultFlags);
void cmdWriteMarkerToMemory(DeviceValidation &, VkCommandBuffer, const VkMemoryMarkerInfoAMD *);

// image_copies.cpp
void cmdCopyMemoryToImage(DeviceValidation &, VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR *);
void cmdCopyImageToMemory(DeviceValidation &, VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR *);

// range_draws.cpp
void cmdBindIndexBuffer3(DeviceValidation &, VkCommandBuffer, const VkBindIndexBuffer3InfoKHR *);
void cmdBindVertexBuffers3(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t, const VkBindVertexBuffer3InfoKHR *);
void cmdDrawIndirect2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
void cmdDrawIndexedIndirect2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
void cmdDrawMeshTasksIndirect2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
void cmdDrawIndirectCount2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
void cmdDrawIndexedIndirectCount2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
void cmdDrawMeshTasksIndirectCount2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
void cmdDispatchIndirect2(DeviceValidation &, VkCommandBuffer, const VkDispatchIndirect2InfoKHR *);
void cmdBeginConditionalRendering2(DeviceValidation &, VkCommandBuffer, const VkConditionalRenderingBeginInfo2EXT *);

// range_feedback.cpp
void cmdBindTransformFeedbackBuffers2(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t,
                                      const VkBindTransformFeedbackBuffer2InfoEXT *);
void cmdBeginTransformFeedback2(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t,
                                const VkBindTransformFeedbackBuffer2InfoEXT *);
void cmdEndTransformFeedback2(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t,
                              const VkBindTransformFeedbackBuffer2InfoEXT *);
void cmdDrawIndirectByteCount2(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t,
                               const VkBindTransformFeedbackBuffer2InfoEXT *, uint32_t, uint32_t);

// The flags of the range, and the feature. The rules of micromaps and of other members are checked elsewhere.
void checkCreation(DeviceValidation &, const Place &command, const VkAccelerationStructureCreateInfo2KHR &);

// range_barriers.cpp
void checkDependency(DeviceValidation &, const Place &, const VkDependencyInfo &, VkCommandBuffer);
void checkSubmission(DeviceValidation &, const Place &, const VkSubmitInfo2 &);
void cmdPipelineBarrier2(DeviceValidation &, VkCommandBuffer, const VkDependencyInfo *);
void cmdSetEvent2(DeviceValidation &, VkCommandBuffer, VkEvent, const VkDependencyInfo *);
void cmdWaitEvents2(DeviceValidation &, VkCommandBuffer, uint32_t, const VkEvent *, const VkDependencyInfo *);
void cmdResetEvent2(DeviceValidation &, VkCommandBuffer, VkEvent, VkPipelineStageFlags2);
void cmdWriteTimestamp2(DeviceValidation &, VkCommandBuffer, VkPipelineStageFlags2, VkQueryPool, uint32_t);
void cmdWriteBufferMarker2(DeviceValidation &, VkCommandBuffer, VkPipelineStageFlags2, VkBuffer, VkDeviceSize,
                           uint32_t);

} // namespace validation
} // namespace vellum::layer
