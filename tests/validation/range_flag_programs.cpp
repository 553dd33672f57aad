// SPDX-License-Identifier: Apache-2.0
// Wrong flags of address ranges: the same programs for each command.
#include "range_commands.h"

namespace vt
{
namespace
{

enum class Fault {
    BothStorage,
    BothFeedback,
    NotBound,
    ProtectedBuffer,
    PlainBuffer,
    Storage,
    NoStorage,
    Feedback,
    NoFeedback
};

struct Wrong {
    VkBufferUsageFlags usage = 0;
    VkBufferCreateFlags flags = 0;
    VkAddressCommandFlagsKHR right = kUnknownUsage, wrong = kUnknownUsage;
    bool rightIsPlain = false; // the right program has a buffer without `flags`
};

constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
constexpr VkBufferUsageFlags kFeedback = VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_BUFFER_BIT_EXT;
constexpr VkAddressCommandFlagsKHR kIsStorage = VK_ADDRESS_COMMAND_STORAGE_BUFFER_USAGE_BIT_KHR;
constexpr VkAddressCommandFlagsKHR kIsFeedback = VK_ADDRESS_COMMAND_TRANSFORM_FEEDBACK_BUFFER_USAGE_BIT_KHR;
constexpr VkAddressCommandFlagsKHR kUnknownStorage = VK_ADDRESS_COMMAND_UNKNOWN_STORAGE_BUFFER_USAGE_BIT_KHR;
constexpr VkAddressCommandFlagsKHR kUnknownFeedback =
    VK_ADDRESS_COMMAND_UNKNOWN_TRANSFORM_FEEDBACK_BUFFER_USAGE_BIT_KHR;
constexpr VkAddressCommandFlagsKHR kBound = kUnknownUsage | VK_ADDRESS_COMMAND_FULLY_BOUND_BIT_KHR;

constexpr Wrong wrongOf(Fault fault)
{
    switch (fault) {
    case Fault::BothStorage: return {.usage = kStorage, .wrong = kUnknownUsage | kIsStorage};
    case Fault::BothFeedback: return {.usage = kFeedback, .wrong = kUnknownUsage | kIsFeedback};
    case Fault::NotBound: return {.flags = VK_BUFFER_CREATE_SPARSE_BINDING_BIT, .right = kBound, .wrong = kBound};
    case Fault::ProtectedBuffer: return {.flags = VK_BUFFER_CREATE_PROTECTED_BIT, .rightIsPlain = true};
    case Fault::PlainBuffer: return {.wrong = kUnknownUsage | VK_ADDRESS_COMMAND_PROTECTED_BIT_KHR};
    case Fault::Storage: return {.usage = kStorage, .right = kIsStorage | kUnknownFeedback, .wrong = kUnknownFeedback};
    case Fault::NoStorage: return {.right = kUnknownFeedback, .wrong = kIsStorage | kUnknownFeedback};
    case Fault::Feedback: return {.usage = kFeedback, .right = kIsFeedback | kUnknownStorage, .wrong = kUnknownStorage};
    case Fault::NoFeedback: break;
    }
    return {.right = kUnknownStorage, .wrong = kIsFeedback | kUnknownStorage};
}

template <const RangeCommand &command, Fault fault>
void flags(Gpu &gpu, bool wrong)
{
    constexpr Wrong state = wrongOf(fault);
    const VkBufferCreateFlags created = state.rightIsPlain && !wrong ? 0 : state.flags;
    const bool isProtected = (created & VK_BUFFER_CREATE_PROTECTED_BIT) != 0;
    RangeBuffer buffer(gpu, isProtected ? protectedUsage(command.usage) : command.usage | state.usage, created);
    const auto record = [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {buffer.address(), command.size}, wrong ? state.wrong : state.right);
    };
    if (fault != Fault::NotBound)
        return recordOnly(gpu, record);
    if (!wrong)
        buffer.bind();
    gpu.submit(record);
}

constexpr WrongProgram kPrograms[] = {
    {"VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13097", Api::Khr, kNeedsAddressCommands,
     flags<kFeedbackBuffer, Fault::NotBound>},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13097", Api::Khr, kNeedsAddressCommands | kNeedsMarkers,
     flags<kMarker, Fault::NotBound>},
    {"VUID-VkDeviceMemoryCopyKHR-srcFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kCopySource, Fault::BothStorage>},
    {"VUID-VkDeviceMemoryCopyKHR-srcFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kCopySource, Fault::BothFeedback>},
    {"VUID-VkDeviceMemoryCopyKHR-srcRange-13097", Api::Khr, kNeedsAddressCommands, flags<kCopySource, Fault::NotBound>},
    {"VUID-VkDeviceMemoryCopyKHR-srcRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kCopySource, Fault::ProtectedBuffer>},
    {"VUID-VkDeviceMemoryCopyKHR-srcRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kCopySource, Fault::PlainBuffer>, "", "VUID-vkCmdCopyMemoryKHR-commandBuffer-13012"},
    {"VUID-VkDeviceMemoryCopyKHR-srcRange-13122", Api::Khr, kNeedsAddressCommands, flags<kCopySource, Fault::Storage>},
    {"VUID-VkDeviceMemoryCopyKHR-srcRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kCopySource, Fault::NoStorage>},
    {"VUID-VkDeviceMemoryCopyKHR-srcRange-13124", Api::Khr, kNeedsAddressCommands, flags<kCopySource, Fault::Feedback>},
    {"VUID-VkDeviceMemoryCopyKHR-srcRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kCopySource, Fault::NoFeedback>},
    {"VUID-VkDeviceMemoryCopyKHR-dstFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kCopyTarget, Fault::BothStorage>},
    {"VUID-VkDeviceMemoryCopyKHR-dstFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kCopyTarget, Fault::BothFeedback>},
    {"VUID-VkDeviceMemoryCopyKHR-dstRange-13097", Api::Khr, kNeedsAddressCommands, flags<kCopyTarget, Fault::NotBound>},
    {"VUID-VkDeviceMemoryCopyKHR-dstRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kCopyTarget, Fault::ProtectedBuffer>},
    {"VUID-VkDeviceMemoryCopyKHR-dstRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kCopyTarget, Fault::PlainBuffer>, "", "VUID-vkCmdCopyMemoryKHR-commandBuffer-13013"},
    {"VUID-VkDeviceMemoryCopyKHR-dstRange-13122", Api::Khr, kNeedsAddressCommands, flags<kCopyTarget, Fault::Storage>},
    {"VUID-VkDeviceMemoryCopyKHR-dstRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kCopyTarget, Fault::NoStorage>},
    {"VUID-VkDeviceMemoryCopyKHR-dstRange-13124", Api::Khr, kNeedsAddressCommands, flags<kCopyTarget, Fault::Feedback>},
    {"VUID-VkDeviceMemoryCopyKHR-dstRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kCopyTarget, Fault::NoFeedback>},
    {"VUID-VkDeviceMemoryImageCopyKHR-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kImageCopy, Fault::BothStorage>},
    {"VUID-VkDeviceMemoryImageCopyKHR-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kImageCopy, Fault::BothFeedback>},
    {"VUID-VkDeviceMemoryImageCopyKHR-addressRange-13097", Api::Khr, kNeedsAddressCommands,
     flags<kImageCopy, Fault::NotBound>},
    {"VUID-VkDeviceMemoryImageCopyKHR-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kImageCopy, Fault::ProtectedBuffer>},
    {"VUID-VkDeviceMemoryImageCopyKHR-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kImageCopy, Fault::PlainBuffer>, "", "VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13102"},
    {"VUID-VkDeviceMemoryImageCopyKHR-addressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kImageCopy, Fault::Storage>},
    {"VUID-VkDeviceMemoryImageCopyKHR-addressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kImageCopy, Fault::NoStorage>},
    {"VUID-VkDeviceMemoryImageCopyKHR-addressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kImageCopy, Fault::Feedback>},
    {"VUID-VkDeviceMemoryImageCopyKHR-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kImageCopy, Fault::NoFeedback>},
    {"VUID-vkCmdFillMemoryKHR-dstFlags-13100", Api::Khr, kNeedsAddressCommands, flags<kFill, Fault::BothStorage>},
    {"VUID-vkCmdFillMemoryKHR-dstFlags-13101", Api::Khr, kNeedsAddressCommands, flags<kFill, Fault::BothFeedback>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13097", Api::Khr, kNeedsAddressCommands, flags<kFill, Fault::NotBound>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13098", Api::Khr, kNeedsAddressCommands, flags<kFill, Fault::ProtectedBuffer>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13099", Api::Khr, kNeedsAddressCommands, flags<kFill, Fault::PlainBuffer>, "",
     "VUID-vkCmdFillMemoryKHR-commandBuffer-13003"},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13122", Api::Khr, kNeedsAddressCommands, flags<kFill, Fault::Storage>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13123", Api::Khr, kNeedsAddressCommands, flags<kFill, Fault::NoStorage>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13124", Api::Khr, kNeedsAddressCommands, flags<kFill, Fault::Feedback>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13125", Api::Khr, kNeedsAddressCommands, flags<kFill, Fault::NoFeedback>},
    {"VUID-vkCmdUpdateMemoryKHR-dstFlags-13100", Api::Khr, kNeedsAddressCommands, flags<kUpdate, Fault::BothStorage>},
    {"VUID-vkCmdUpdateMemoryKHR-dstFlags-13101", Api::Khr, kNeedsAddressCommands, flags<kUpdate, Fault::BothFeedback>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13097", Api::Khr, kNeedsAddressCommands, flags<kUpdate, Fault::NotBound>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kUpdate, Fault::ProtectedBuffer>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13099", Api::Khr, kNeedsAddressCommands, flags<kUpdate, Fault::PlainBuffer>,
     "", "VUID-vkCmdUpdateMemoryKHR-commandBuffer-13010"},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13122", Api::Khr, kNeedsAddressCommands, flags<kUpdate, Fault::Storage>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13123", Api::Khr, kNeedsAddressCommands, flags<kUpdate, Fault::NoStorage>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13124", Api::Khr, kNeedsAddressCommands, flags<kUpdate, Fault::Feedback>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13125", Api::Khr, kNeedsAddressCommands, flags<kUpdate, Fault::NoFeedback>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-dstFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kQueryResults, Fault::BothStorage>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-dstFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kQueryResults, Fault::BothFeedback>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13097", Api::Khr, kNeedsAddressCommands,
     flags<kQueryResults, Fault::NotBound>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kQueryResults, Fault::ProtectedBuffer>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kQueryResults, Fault::PlainBuffer>, "", "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-dstFlags-13085"},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kQueryResults, Fault::Storage>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kQueryResults, Fault::NoStorage>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kQueryResults, Fault::Feedback>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kQueryResults, Fault::NoFeedback>},
    {"VUID-VkMemoryMarkerInfoAMD-dstFlags-13100", Api::Khr, kNeedsAddressCommands | kNeedsMarkers,
     flags<kMarker, Fault::BothStorage>},
    {"VUID-VkMemoryMarkerInfoAMD-dstFlags-13101", Api::Khr, kNeedsAddressCommands | kNeedsMarkers,
     flags<kMarker, Fault::BothFeedback>},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13098", Api::Khr, kNeedsAddressCommands | kNeedsMarkers,
     flags<kMarker, Fault::ProtectedBuffer>, "", "VUID-vkCmdWriteMarkerToMemoryAMD-pInfo-13047"},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13099", Api::Khr, kNeedsAddressCommands | kNeedsMarkers,
     flags<kMarker, Fault::PlainBuffer>, "",
     "VUID-vkCmdWriteMarkerToMemoryAMD-commandBuffer-13044 VUID-vkCmdWriteMarkerToMemoryAMD-pInfo-13046"},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13122", Api::Khr, kNeedsAddressCommands | kNeedsMarkers,
     flags<kMarker, Fault::Storage>},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13123", Api::Khr, kNeedsAddressCommands | kNeedsMarkers,
     flags<kMarker, Fault::NoStorage>},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13124", Api::Khr, kNeedsAddressCommands | kNeedsMarkers,
     flags<kMarker, Fault::Feedback>},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13125", Api::Khr, kNeedsAddressCommands | kNeedsMarkers,
     flags<kMarker, Fault::NoFeedback>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kIndexBuffer, Fault::BothStorage>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kIndexBuffer, Fault::BothFeedback>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13097", Api::Khr, kNeedsAddressCommands,
     flags<kIndexBuffer, Fault::NotBound>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kIndexBuffer, Fault::ProtectedBuffer>, "", "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13051"},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kIndexBuffer, Fault::PlainBuffer>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kIndexBuffer, Fault::Storage>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kIndexBuffer, Fault::NoStorage>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kIndexBuffer, Fault::Feedback>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kIndexBuffer, Fault::NoFeedback>},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kVertexBuffer, Fault::BothStorage>},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kVertexBuffer, Fault::BothFeedback>},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressRange-13097", Api::Khr, kNeedsAddressCommands,
     flags<kVertexBuffer, Fault::NotBound>},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kVertexBuffer, Fault::ProtectedBuffer>, "", "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13074"},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kVertexBuffer, Fault::PlainBuffer>},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kVertexBuffer, Fault::Storage>},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kVertexBuffer, Fault::NoStorage>},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kVertexBuffer, Fault::Feedback>},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kVertexBuffer, Fault::NoFeedback>},
    {"VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kFeedbackCounter, Fault::BothStorage>},
    {"VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kFeedbackCounter, Fault::BothFeedback>},
    {"VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kFeedbackCounter, Fault::ProtectedBuffer>, "", "VUID-vkCmdBeginTransformFeedback2EXT-pCounterInfos-13094"},
    {"VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kFeedbackCounter, Fault::PlainBuffer>},
    {"VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kFeedbackCounter, Fault::Storage>},
    {"VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kFeedbackCounter, Fault::NoStorage>},
    {"VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kFeedbackCounter, Fault::Feedback>},
    {"VUID-VkBindTransformFeedbackBuffer2InfoEXT-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kFeedbackCounter, Fault::NoFeedback>},
    {"VUID-VkDrawIndirect2InfoKHR-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kDraw, Fault::BothStorage>},
    {"VUID-VkDrawIndirect2InfoKHR-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kDraw, Fault::BothFeedback>},
    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kDraw, Fault::ProtectedBuffer>, "",
     "VUID-VkDrawIndirect2InfoKHR-protectedNoFault-13108 VUID-VkDrawIndirect2InfoKHR-addressRange-13107"},
    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kDraw, Fault::PlainBuffer>},
    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13122", Api::Khr, kNeedsAddressCommands, flags<kDraw, Fault::Storage>},
    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13123", Api::Khr, kNeedsAddressCommands, flags<kDraw, Fault::NoStorage>},
    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13124", Api::Khr, kNeedsAddressCommands, flags<kDraw, Fault::Feedback>},
    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kDraw, Fault::NoFeedback>},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kCountedDraw, Fault::BothStorage>},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kCountedDraw, Fault::BothFeedback>},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kCountedDraw, Fault::ProtectedBuffer>, "",
     "VUID-VkDrawIndirectCount2InfoKHR-protectedNoFault-13108 VUID-VkDrawIndirectCount2InfoKHR-addressRange-13107"},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kCountedDraw, Fault::PlainBuffer>},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kCountedDraw, Fault::Storage>},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kCountedDraw, Fault::NoStorage>},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kCountedDraw, Fault::Feedback>},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kCountedDraw, Fault::NoFeedback>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kDrawCount, Fault::BothStorage>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kDrawCount, Fault::BothFeedback>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kDrawCount, Fault::ProtectedBuffer>, "", "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13114"},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kDrawCount, Fault::PlainBuffer>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kDrawCount, Fault::Storage>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kDrawCount, Fault::NoStorage>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kDrawCount, Fault::Feedback>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kDrawCount, Fault::NoFeedback>},
    {"VUID-VkDispatchIndirect2InfoKHR-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kDispatch, Fault::BothStorage>},
    {"VUID-VkDispatchIndirect2InfoKHR-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kDispatch, Fault::BothFeedback>},
    {"VUID-VkDispatchIndirect2InfoKHR-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kDispatch, Fault::ProtectedBuffer>, "",
     "VUID-VkDispatchIndirect2InfoKHR-protectedNoFault-13108 VUID-VkDispatchIndirect2InfoKHR-addressRange-13107"},
    {"VUID-VkDispatchIndirect2InfoKHR-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kDispatch, Fault::PlainBuffer>},
    {"VUID-VkDispatchIndirect2InfoKHR-addressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kDispatch, Fault::Storage>},
    {"VUID-VkDispatchIndirect2InfoKHR-addressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kDispatch, Fault::NoStorage>},
    {"VUID-VkDispatchIndirect2InfoKHR-addressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kDispatch, Fault::Feedback>},
    {"VUID-VkDispatchIndirect2InfoKHR-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kDispatch, Fault::NoFeedback>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kCondition, Fault::BothStorage>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kCondition, Fault::BothFeedback>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13097", Api::Khr, kNeedsAddressCommands,
     flags<kCondition, Fault::NotBound>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kCondition, Fault::ProtectedBuffer>, "", "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13064"},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kCondition, Fault::PlainBuffer>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kCondition, Fault::Storage>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kCondition, Fault::NoStorage>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kCondition, Fault::Feedback>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kCondition, Fault::NoFeedback>},
    {"VUID-VkMemoryRangeBarrierKHR-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kBarrier, Fault::BothStorage>},
    {"VUID-VkMemoryRangeBarrierKHR-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kBarrier, Fault::BothFeedback>},
    {"VUID-VkMemoryRangeBarrierKHR-addressRange-13097", Api::Khr, kNeedsAddressCommands,
     flags<kBarrier, Fault::NotBound>},
    {"VUID-VkMemoryRangeBarrierKHR-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kBarrier, Fault::ProtectedBuffer>},
    {"VUID-VkMemoryRangeBarrierKHR-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kBarrier, Fault::PlainBuffer>},
    {"VUID-VkMemoryRangeBarrierKHR-addressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kBarrier, Fault::Storage>},
    {"VUID-VkMemoryRangeBarrierKHR-addressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kBarrier, Fault::NoStorage>},
    {"VUID-VkMemoryRangeBarrierKHR-addressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kBarrier, Fault::Feedback>},
    {"VUID-VkMemoryRangeBarrierKHR-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kBarrier, Fault::NoFeedback>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressFlags-13100", Api::Khr, kNeedsAddressCommands,
     flags<kCreation, Fault::BothStorage>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressFlags-13101", Api::Khr, kNeedsAddressCommands,
     flags<kCreation, Fault::BothFeedback>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13097", Api::Khr, kNeedsAddressCommands,
     flags<kCreation, Fault::NotBound>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13098", Api::Khr, kNeedsAddressCommands,
     flags<kCreation, Fault::ProtectedBuffer>, "", "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603"},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13099", Api::Khr, kNeedsAddressCommands,
     flags<kCreation, Fault::PlainBuffer>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13122", Api::Khr, kNeedsAddressCommands,
     flags<kCreation, Fault::Storage>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13123", Api::Khr, kNeedsAddressCommands,
     flags<kCreation, Fault::NoStorage>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13124", Api::Khr, kNeedsAddressCommands,
     flags<kCreation, Fault::Feedback>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-13125", Api::Khr, kNeedsAddressCommands,
     flags<kCreation, Fault::NoFeedback>},
};

} // namespace

std::span<const WrongProgram> rangeFlagPrograms()
{
    return kPrograms;
}

} // namespace vt
