// SPDX-License-Identifier: Apache-2.0
// Transform feedback.
#include "layer/validation/device_validation.h"
#include "layer/validation/ranges/ranges.h"
#include "layer/validation/traces/trace_commands.h"

namespace vellum::layer::validation
{
namespace
{

void checkBuffers(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                  const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdBindTransformFeedbackBuffers2EXT");
    const VkDeviceSize most = device.facts.maxTransformFeedbackBufferSize;
    for (uint32_t i = 0; i < count; ++i) {
        const Place info = command.element("pBindingInfos", i);
        if (infos[i].addressRange.size > most)
            ranges.fault(info.member("addressRange"), "VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13092",
                         std::to_string(infos[i].addressRange.size) + " bytes; maxTransformFeedbackBufferSize is " +
                             std::to_string(most));
        ranges.check(info, infos[i].addressRange, infos[i].addressFlags, flag_rules::kFeedbackBuffer,
                     {.usage = VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_BUFFER_BIT_EXT,
                      .usageRule = "VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13091",
                      .alignment = 4,
                      .alignmentRule = "VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13090"});
    }
}

// A range of size 0 is no counter.
void checkCounters(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *name, uint32_t count,
                   const VkBindTransformFeedbackBuffer2InfoEXT *infos, const char *sizeRule, const char *usageRule)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command(name);
    for (uint32_t i = 0; infos && i < count; ++i) {
        const Place info = command.element("pCounterInfos", i);
        const bool isNull = infos[i].addressRange.size == 0;
        ranges.check(info, infos[i].addressRange, infos[i].addressFlags, flag_rules::kFeedbackBuffer,
                     {.usage = VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_COUNTER_BUFFER_BIT_EXT,
                      .usageRule = usageRule,
                      .least = isNull ? 0 : sizeof(uint32_t),
                      .leastRule = sizeRule});
    }
}

void checkByteCount(DeviceValidation &device, VkCommandBuffer commandBuffer,
                    const VkBindTransformFeedbackBuffer2InfoEXT &info)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdDrawIndirectByteCount2EXT");
    ranges.check(command.member("pCounterInfo"), info.addressRange, info.addressFlags, flag_rules::kFeedbackBuffer,
                 {.usage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
                  .usageRule = "VUID-vkCmdDrawIndirectByteCount2EXT-pInfo-13061",
                  .alignment = 4,
                  .alignmentRule = "VUID-vkCmdDrawIndirectByteCount2EXT-pInfo-13062"});
}

} // namespace

void cmdBindTransformFeedbackBuffers2(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t first,
                                      uint32_t count, const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    if (device.checks.core)
        checkBuffers(device, commandBuffer, count, infos);
    device.next.CmdBindTransformFeedbackBuffers2EXT(commandBuffer, first, count, infos);
}

void cmdBeginTransformFeedback2(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
                                const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    if (device.checks.core)
        checkCounters(device, commandBuffer, "vkCmdBeginTransformFeedback2EXT", count, infos,
                      "VUID-vkCmdBeginTransformFeedback2EXT-pCounterInfos-13093",
                      "VUID-vkCmdBeginTransformFeedback2EXT-pCounterInfos-13094");
    device.next.CmdBeginTransformFeedback2EXT(commandBuffer, first, count, infos);
}

void cmdEndTransformFeedback2(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
                              const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    if (device.checks.core)
        checkCounters(device, commandBuffer, "vkCmdEndTransformFeedback2EXT", count, infos,
                      "VUID-vkCmdEndTransformFeedback2EXT-pCounterInfos-13095",
                      "VUID-vkCmdEndTransformFeedback2EXT-pCounterInfos-13096");
    device.next.CmdEndTransformFeedback2EXT(commandBuffer, first, count, infos);
}

void cmdDrawIndirectByteCount2(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t instanceCount,
                               uint32_t firstInstance, const VkBindTransformFeedbackBuffer2InfoEXT *info,
                               uint32_t counterOffset, uint32_t vertexStride)
{
    if (device.checks.core)
        checkByteCount(device, commandBuffer, *info);
    runTracing(device, commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS, "vkCmdDrawIndirectByteCount2EXT");
    device.next.CmdDrawIndirectByteCount2EXT(commandBuffer, instanceCount, firstInstance, info, counterOffset,
                                             vertexStride);
}

} // namespace vellum::layer::validation
