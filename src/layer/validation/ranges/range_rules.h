// SPDX-License-Identifier: Apache-2.0
// The rules that every address range with flags has, by the ids that they have for each range.
#pragma once

namespace vellum::layer
{

struct RangeFlagRules {
    const char *range; // names of the members or parameters
    const char *flags;
    const char *bothStorage;       // both flags about storage usage
    const char *bothFeedback;      // both flags about transform feedback usage
    const char *notBound;          // FULLY_BOUND, for a range that is not
    const char *protectedBuffer;   // no PROTECTED, for a protected buffer
    const char *unprotectedBuffer; // PROTECTED, for a buffer that is not
    const char *storage;           // no flag about storage usage, for a buffer with the usage
    const char *noStorage;         // STORAGE_BUFFER_USAGE, for a buffer without the usage
    const char *feedback;          // no flag about transform feedback usage, for a buffer with the usage
    const char *noFeedback;        // TRANSFORM_FEEDBACK_BUFFER_USAGE, for a buffer without the usage
};

namespace flag_rules
{

inline constexpr RangeFlagRules kCopySource{"srcRange",
                                            "srcFlags",
                                            "VUID-VkDeviceMemoryCopyKHR-srcFlags-13100",
                                            "VUID-VkDeviceMemoryCopyKHR-srcFlags-13101",
                                            "VUID-VkDeviceMemoryCopyKHR-srcRange-13097",
                                            "VUID-VkDeviceMemoryCopyKHR-srcRange-13098",
                                            "VUID-VkDeviceMemoryCopyKHR-srcRange-13099",
                                            "VUID-VkDeviceMemoryCopyKHR-srcRange-13122",
                                            "VUID-VkDeviceMemoryCopyKHR-srcRange-13123",
                                            "VUID-VkDeviceMemoryCopyKHR-srcRange-13124",
                                            "VUID-VkDeviceMemoryCopyKHR-srcRange-13125"};
inline constexpr RangeFlagRules kCopyTarget{"dstRange",
                                            "dstFlags",
                                            "VUID-VkDeviceMemoryCopyKHR-dstFlags-13100",
                                            "VUID-VkDeviceMemoryCopyKHR-dstFlags-13101",
                                            "VUID-VkDeviceMemoryCopyKHR-dstRange-13097",
                                            "VUID-VkDeviceMemoryCopyKHR-dstRange-13098",
                                            "VUID-VkDeviceMemoryCopyKHR-dstRange-13099",
                                            "VUID-VkDeviceMemoryCopyKHR-dstRange-13122",
                                            "VUID-VkDeviceMemoryCopyKHR-dstRange-13123",
                                            "VUID-VkDeviceMemoryCopyKHR-dstRange-13124",
                                            "VUID-VkDeviceMemoryCopyKHR-dstRange-13125"};
inline constexpr RangeFlagRules kImageCopy{"addressRange",
                                           "addressFlags",
                                           "VUID-VkDeviceMemoryImageCopyKHR-addressFlags-13100",
                                           "VUID-VkDeviceMemoryImageCopyKHR-addressFlags-13101",
                                           "VUID-VkDeviceMemoryImageCopyKHR-addressRange-13097",
                                           "VUID-VkDeviceMemoryImageCopyKHR-addressRange-13098",
                                           "VUID-VkDeviceMemoryImageCopyKHR-addressRange-13099",
                                           "VUID-VkDeviceMemoryImageCopyKHR-addressRange-13122",
                                           "VUID-VkDeviceMemoryImageCopyKHR-addressRange-13123",
                                           "VUID-VkDeviceMemoryImageCopyKHR-addressRange-13124",
                                           "VUID-VkDeviceMemoryImageCopyKHR-addressRange-13125"};
inline constexpr RangeFlagRules kFill{"pDstRange",
                                      "dstFlags",
                                      "VUID-vkCmdFillMemoryKHR-dstFlags-13100",
                                      "VUID-vkCmdFillMemoryKHR-dstFlags-13101",
                                      "VUID-vkCmdFillMemoryKHR-pDstRange-13097",
                                      "VUID-vkCmdFillMemoryKHR-pDstRange-13098",
                                      "VUID-vkCmdFillMemoryKHR-pDstRange-13099",
                                      "VUID-vkCmdFillMemoryKHR-pDstRange-13122",
                                      "VUID-vkCmdFillMemoryKHR-pDstRange-13123",
                                      "VUID-vkCmdFillMemoryKHR-pDstRange-13124",
                                      "VUID-vkCmdFillMemoryKHR-pDstRange-13125"};
inline constexpr RangeFlagRules kUpdate{"pDstRange",
                                        "dstFlags",
                                        "VUID-vkCmdUpdateMemoryKHR-dstFlags-13100",
                                        "VUID-vkCmdUpdateMemoryKHR-dstFlags-13101",
                                        "VUID-vkCmdUpdateMemoryKHR-pDstRange-13097",
                                        "VUID-vkCmdUpdateMemoryKHR-pDstRange-13098",
                                        "VUID-vkCmdUpdateMemoryKHR-pDstRange-13099",
                                        "VUID-vkCmdUpdateMemoryKHR-pDstRange-13122",
                                        "VUID-vkCmdUpdateMemoryKHR-pDstRange-13123",
                                        "VUID-vkCmdUpdateMemoryKHR-pDstRange-13124",
                                        "VUID-vkCmdUpdateMemoryKHR-pDstRange-13125"};
inline constexpr RangeFlagRules kQueryResults{"pDstRange",
                                              "dstFlags",
                                              "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-dstFlags-13100",
                                              "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-dstFlags-13101",
                                              "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13097",
                                              "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13098",
                                              "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13099",
                                              "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13122",
                                              "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13123",
                                              "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13124",
                                              "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13125"};
inline constexpr RangeFlagRules kMarker{"dstRange",
                                        "dstFlags",
                                        "VUID-VkMemoryMarkerInfoAMD-dstFlags-13100",
                                        "VUID-VkMemoryMarkerInfoAMD-dstFlags-13101",
                                        "VUID-VkMemoryMarkerInfoAMD-dstRange-13097",
                                        "VUID-VkMemoryMarkerInfoAMD-dstRange-13098",
                                        "VUID-VkMemoryMarkerInfoAMD-dstRange-13099",
                                        "VUID-VkMemoryMarkerInfoAMD-dstRange-13122",
                                        "VUID-VkMemoryMarkerInfoAMD-dstRange-13123",
                                        "VUID-VkMemoryMarkerInfoAMD-dstRange-13124",
                                        "VUID-VkMemoryMarkerInfoAMD-dstRange-13125"};
inline constexpr RangeFlagRules kIndexBuffer{"addressRange",
                                             "addressFlags",
                                             "VUID-VkBindIndexBuffer3InfoKHR-addressFlags-13100",
                                             "VUID-VkBindIndexBuffer3InfoKHR-addressFlags-13101",
                                             "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13097",
                                             "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13098",
                                             "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13099",
                                             "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13122",
                                             "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13123",
                                             "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13124",
                                             "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13125"};
inline constexpr RangeFlagRules kVertexBuffer{"addressRange",
                                              "addressFlags",
                                              "VUID-VkBindVertexBuffer3InfoKHR-addressFlags-13100",
                                              "VUID-VkBindVertexBuffer3InfoKHR-addressFlags-13101",
                                              "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13097",
                                              "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13098",
                                              "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13099",
                                              "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13122",
                                              "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13123",
                                              "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13124",
                                              "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13125"};
inline constexpr RangeFlagRules kFeedbackBuffer{"addressRange",
                                                "addressFlags",
                                                "VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressFlags-13100",
                                                "VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressFlags-13101",
                                                "VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13097",
                                                "VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13098",
                                                "VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13099",
                                                "VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13122",
                                                "VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13123",
                                                "VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13124",
                                                "VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13125"};
inline constexpr RangeFlagRules kDraw{"addressRange",
                                      "addressFlags",
                                      "VUID-VkDrawIndirect2InfoKHR-addressFlags-13100",
                                      "VUID-VkDrawIndirect2InfoKHR-addressFlags-13101",
                                      "VUID-VkDrawIndirect2InfoKHR-addressRange-13097",
                                      "VUID-VkDrawIndirect2InfoKHR-addressRange-13098",
                                      "VUID-VkDrawIndirect2InfoKHR-addressRange-13099",
                                      "VUID-VkDrawIndirect2InfoKHR-addressRange-13122",
                                      "VUID-VkDrawIndirect2InfoKHR-addressRange-13123",
                                      "VUID-VkDrawIndirect2InfoKHR-addressRange-13124",
                                      "VUID-VkDrawIndirect2InfoKHR-addressRange-13125"};
inline constexpr RangeFlagRules kCountedDraw{"addressRange",
                                             "addressFlags",
                                             "VUID-VkDrawIndirectCount2InfoKHR-addressFlags-13100",
                                             "VUID-VkDrawIndirectCount2InfoKHR-addressFlags-13101",
                                             "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13097",
                                             "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13098",
                                             "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13099",
                                             "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13122",
                                             "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13123",
                                             "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13124",
                                             "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13125"};
inline constexpr RangeFlagRules kDrawCount{"countAddressRange",
                                           "countAddressFlags",
                                           "VUID-VkDrawIndirectCount2InfoKHR-countAddressFlags-13100",
                                           "VUID-VkDrawIndirectCount2InfoKHR-countAddressFlags-13101",
                                           "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13097",
                                           "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13098",
                                           "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13099",
                                           "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13122",
                                           "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13123",
                                           "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13124",
                                           "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13125"};
inline constexpr RangeFlagRules kDispatch{"addressRange",
                                          "addressFlags",
                                          "VUID-VkDispatchIndirect2InfoKHR-addressFlags-13100",
                                          "VUID-VkDispatchIndirect2InfoKHR-addressFlags-13101",
                                          "VUID-VkDispatchIndirect2InfoKHR-addressRange-13097",
                                          "VUID-VkDispatchIndirect2InfoKHR-addressRange-13098",
                                          "VUID-VkDispatchIndirect2InfoKHR-addressRange-13099",
                                          "VUID-VkDispatchIndirect2InfoKHR-addressRange-13122",
                                          "VUID-VkDispatchIndirect2InfoKHR-addressRange-13123",
                                          "VUID-VkDispatchIndirect2InfoKHR-addressRange-13124",
                                          "VUID-VkDispatchIndirect2InfoKHR-addressRange-13125"};
inline constexpr RangeFlagRules kCondition{"addressRange",
                                           "addressFlags",
                                           "VUID-VkConditionalRenderingBeginInfo2EXT-addressFlags-13100",
                                           "VUID-VkConditionalRenderingBeginInfo2EXT-addressFlags-13101",
                                           "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13097",
                                           "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13098",
                                           "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13099",
                                           "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13122",
                                           "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13123",
                                           "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13124",
                                           "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13125"};
inline constexpr RangeFlagRules kBarrier{"addressRange",
                                         "addressFlags",
                                         "VUID-VkMemoryRangeBarrierKHR-addressFlags-13100",
                                         "VUID-VkMemoryRangeBarrierKHR-addressFlags-13101",
                                         "VUID-VkMemoryRangeBarrierKHR-addressRange-13097",
                                         "VUID-VkMemoryRangeBarrierKHR-addressRange-13098",
                                         "VUID-VkMemoryRangeBarrierKHR-addressRange-13099",
                                         "VUID-VkMemoryRangeBarrierKHR-addressRange-13122",
                                         "VUID-VkMemoryRangeBarrierKHR-addressRange-13123",
                                         "VUID-VkMemoryRangeBarrierKHR-addressRange-13124",
                                         "VUID-VkMemoryRangeBarrierKHR-addressRange-13125"};
inline constexpr RangeFlagRules kCreation{"addressRange",
                                          "addressFlags",
                                          "VUID-VkAccelerationStructureCreateInfo2KHR-addressFlags-13100",
                                          "VUID-VkAccelerationStructureCreateInfo2KHR-addressFlags-13101",
                                          "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13097",
                                          "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13098",
                                          "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13099",
                                          "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13122",
                                          "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13123",
                                          "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13124",
                                          "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13125"};

} // namespace flag_rules
} // namespace vellum::layer
