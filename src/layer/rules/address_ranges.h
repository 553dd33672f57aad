// SPDX-License-Identifier: Apache-2.0
// Requirements of the address ranges of VK_KHR_device_address_commands, as rows: validation evaluates them, and the
// layer's own commands find buffers by them.
#pragma once

#include <algorithm>

#include "layer/rules/rule.h"

namespace vellum::layer::rules
{

// The part of a range that a command accesses.
enum class Part {
    All,
    Least,   // Range::least
    UpToEnd, // any bytes, but none beyond the range
};

// A range. A null id: there is no such rule.
struct Range {
    VkFlags64 usage;     // of its buffer
    const char *usageId; // no buffer of the range has the usage
    const char *leastId = nullptr;
    VkDeviceSize least = 0;     // bytes; 0: what the command states
    VkDeviceSize alignment = 1; // of the address
    const char *alignmentId = nullptr;
    Part part = Part::All;
};

// A range that is smaller than the command needs, that does not lie in one buffer, or whose stride is wrong is harmless
// if everything that the command accesses is in one buffer.
inline Severity ofSmallRange(const AddressMap &addresses, const VkDeviceAddressRangeKHR &range, VkDeviceSize least)
{
    return range.size > 0 && addresses.covering(range.address, least, 0).buffer ? Severity::Tolerate : Severity::Reject;
}
inline Severity ofSplitRange(const AddressMap &addresses, const VkDeviceAddressRangeKHR &range, const Range &need,
                             VkDeviceSize least)
{
    const bool reached = need.part != Part::All &&
                         addresses.covering(range.address, std::max(least, VkDeviceSize{1}), need.usage).buffer;
    return reached ? Severity::Tolerate : Severity::Reject;
}
inline Severity ofStride(uint32_t draws)
{
    return draws > 1 ? Severity::Reject : Severity::Tolerate;
}

// The ids of all ranges of a structure.
struct AnyRange {
    const char *null;   // it has bytes, but no address
    const char *buffer; // it does not lie in one buffer
};
inline constexpr AnyRange kAnyRange{"VUID-VkDeviceAddressRangeKHR-size-11411",
                                    "VUID-VkDeviceAddressRangeKHR-address-11365"};
inline constexpr AnyRange kAnyStridedRange{"VUID-VkStridedDeviceAddressRangeKHR-size-11411",
                                           "VUID-VkStridedDeviceAddressRangeKHR-address-11365"};

inline constexpr VkFlags64 kSource = VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
inline constexpr VkFlags64 kTarget = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
inline constexpr VkFlags64 kIndirect = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
inline constexpr VkFlags64 kCounter = VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_COUNTER_BUFFER_BIT_EXT;

// --- copies
inline constexpr Range kCopySource{.usage = kSource, .usageId = "VUID-VkDeviceMemoryCopyKHR-srcRange-13017"};
inline constexpr Range kCopyTarget{.usage = kTarget, .usageId = "VUID-VkDeviceMemoryCopyKHR-dstRange-13018"};
inline constexpr const char *kCopySizeId = "VUID-VkDeviceMemoryCopyKHR-size-13016";
inline constexpr Range kToImage{.usage = kSource, .usageId = "VUID-vkCmdCopyMemoryToImageKHR-addressRange-13128"};
inline constexpr Range kFromImage{.usage = kTarget, .usageId = "VUID-vkCmdCopyImageToMemoryKHR-addressRange-13129"};
inline constexpr Range kUpdated{.usage = kTarget,
                                .usageId = "VUID-vkCmdUpdateMemoryKHR-dstRange-13005",
                                .leastId = "VUID-vkCmdUpdateMemoryKHR-dataSize-13008",
                                .alignment = 4,
                                .alignmentId = "VUID-vkCmdUpdateMemoryKHR-pDstRange-13006",
                                .part = Part::Least};
inline constexpr Range kFilled{.usage = kTarget,
                               .usageId = "VUID-vkCmdFillMemoryKHR-dstRange-13000",
                               .alignment = 4,
                               .alignmentId = "VUID-vkCmdFillMemoryKHR-pDstRange-13001"};
inline constexpr Range kQueryResults{.usage = kTarget,
                                     .usageId = "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13080",
                                     .leastId = "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13079",
                                     .part = Part::Least};
inline constexpr Range kMarker{.usage = kTarget,
                               .usageId = "VUID-VkMemoryMarkerInfoAMD-dstRange-13039",
                               .leastId = "VUID-VkMemoryMarkerInfoAMD-dstRange-13041",
                               .least = sizeof(uint32_t),
                               .alignment = 4,
                               .alignmentId = "VUID-VkMemoryMarkerInfoAMD-dstRange-13040",
                               .part = Part::Least};

// --- bindings and draws. A range of size 0 has no address.
inline constexpr Range kIndexBuffer{.usage = VK_BUFFER_USAGE_INDEX_BUFFER_BIT,
                                    .usageId = "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13051",
                                    .leastId = "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13056",
                                    .alignmentId = "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13052",
                                    .part = Part::UpToEnd};
inline constexpr Range kVertexBuffer{.usage = VK_BUFFER_USAGE_VERTEX_BUFFER_BIT,
                                     .usageId = "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13074",
                                     .leastId = "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13075",
                                     .part = Part::UpToEnd};
inline constexpr Range kDraws{.usage = kIndirect,
                              .usageId = "VUID-VkDrawIndirect2InfoKHR-addressRange-13107",
                              .alignment = 4,
                              .alignmentId = "VUID-VkDrawIndirect2InfoKHR-addressRange-13109",
                              .part = Part::Least};
inline constexpr Range kCountedDraws{.usage = kIndirect,
                                     .usageId = "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13107",
                                     .alignment = 4,
                                     .alignmentId = "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13109",
                                     .part = Part::Least};
inline constexpr Range kDrawCount{.usage = kIndirect,
                                  .usageId = "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13114",
                                  .leastId = "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13117",
                                  .least = sizeof(uint32_t),
                                  .alignment = 4,
                                  .alignmentId = "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13115",
                                  .part = Part::Least};
inline constexpr Range kDispatch{.usage = kIndirect,
                                 .usageId = "VUID-VkDispatchIndirect2InfoKHR-addressRange-13107",
                                 .leastId = "VUID-vkCmdDispatchIndirect2KHR-pInfo-13050",
                                 .least = sizeof(VkDispatchIndirectCommand),
                                 .alignment = 4,
                                 .alignmentId = "VUID-VkDispatchIndirect2InfoKHR-addressRange-13109",
                                 .part = Part::Least};
inline constexpr Range kCondition{.usage = VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT,
                                  .usageId = "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13064",
                                  .leastId = "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13066",
                                  .least = sizeof(uint32_t),
                                  .alignment = 4,
                                  .alignmentId = "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13065",
                                  .part = Part::Least};

// --- transform feedback
inline constexpr Range kFeedbackBuffer{.usage = VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_BUFFER_BIT_EXT,
                                       .usageId = "VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13091",
                                       .alignment = 4,
                                       .alignmentId = "VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13090",
                                       .part = Part::UpToEnd};
inline constexpr Range kBeginCounter{.usage = kCounter,
                                     .usageId = "VUID-vkCmdBeginTransformFeedback2EXT-pCounterInfos-13094",
                                     .leastId = "VUID-vkCmdBeginTransformFeedback2EXT-pCounterInfos-13093",
                                     .least = sizeof(uint32_t),
                                     .part = Part::Least};
inline constexpr Range kEndCounter{.usage = kCounter,
                                   .usageId = "VUID-vkCmdEndTransformFeedback2EXT-pCounterInfos-13096",
                                   .leastId = "VUID-vkCmdEndTransformFeedback2EXT-pCounterInfos-13095",
                                   .least = sizeof(uint32_t),
                                   .part = Part::Least};
inline constexpr Range kByteCount{.usage = kIndirect,
                                  .usageId = "VUID-vkCmdDrawIndirectByteCount2EXT-pInfo-13061",
                                  .alignment = 4,
                                  .alignmentId = "VUID-vkCmdDrawIndirectByteCount2EXT-pInfo-13062",
                                  .part = Part::Least};

// --- the commands in the ranges of indirect draws
struct IndirectDraws {
    const char *command;
    VkDeviceSize bytes; // bytes that the device reads for each draw
    // Ids for a range that is too small, and for a stride that is 0 for several draws, is smaller than `bytes`, or is
    // not a multiple of 4.
    const char *size, *noStride, *smallStride, *unalignedStride;
    bool isValidated = true; // the registry has these rules of mesh tasks in other commands only
};
inline constexpr IndirectDraws kDrawIndirect{
    "vkCmdDrawIndirect2KHR",
    sizeof(VkDrawIndirectCommand),
    "VUID-vkCmdDrawIndirect2KHR-pInfo-13110",
    "VUID-vkCmdDrawIndirect2KHR-pInfo-13111",
    "VUID-vkCmdDrawIndirect2KHR-pInfo-13112",
    "VUID-vkCmdDrawIndirect2KHR-pInfo-13113",
};
inline constexpr IndirectDraws kDrawIndexedIndirect{
    "vkCmdDrawIndexedIndirect2KHR",
    sizeof(VkDrawIndexedIndirectCommand),
    "VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13110",
    "VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13111",
    "VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13112",
    "VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13113",
};
inline constexpr IndirectDraws kDrawMeshTasks{
    "vkCmdDrawMeshTasksIndirect2EXT",
    sizeof(VkDrawMeshTasksIndirectCommandEXT),
    "VUID-vkCmdDrawMeshTasksIndirect2EXT-pInfo-13110",
    "VUID-vkCmdDrawMeshTasksIndirect2EXT-pInfo-13111",
    "VUID-vkCmdDrawMeshTasksIndirect2EXT-pInfo-13112",
    "VUID-vkCmdDrawMeshTasksIndirect2EXT-pInfo-13113",
    false,
};
inline constexpr IndirectDraws kDrawIndirectCount{
    "vkCmdDrawIndirectCount2KHR",
    sizeof(VkDrawIndirectCommand),
    "VUID-vkCmdDrawIndirectCount2KHR-pInfo-13110",
    "VUID-vkCmdDrawIndirectCount2KHR-pInfo-13111",
    "VUID-vkCmdDrawIndirectCount2KHR-pInfo-13112",
    "VUID-vkCmdDrawIndirectCount2KHR-pInfo-13113",
};
inline constexpr IndirectDraws kDrawIndexedIndirectCount{
    "vkCmdDrawIndexedIndirectCount2KHR",
    sizeof(VkDrawIndexedIndirectCommand),
    "VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13110",
    "VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13111",
    "VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13112",
    "VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13113",
};
inline constexpr IndirectDraws kDrawMeshTasksCount{
    "vkCmdDrawMeshTasksIndirectCount2EXT",
    sizeof(VkDrawMeshTasksIndirectCommandEXT),
    "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-pInfo-13110",
    "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-pInfo-13111",
    "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-pInfo-13112",
    "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-pInfo-13113",
    false,
};
inline constexpr const char *kDrawCountFeatureId = "VUID-vkCmdDrawIndirectCount2KHR-drawIndirectCount-13119";

} // namespace vellum::layer::rules
