// SPDX-License-Identifier: Apache-2.0
// The check of address ranges: those of VK_KHR_device_address_commands, and barriers.
#pragma once

#include "layer/input/checked.h"
#include "layer/rules/address_ranges.h"
#include "layer/validation/model/device_model.h"

namespace vellum::layer
{

// An address range with flags: the structure or command that has it, and the names of its members or parameters. In
// the specification each has a copy of the rules that RangeCheck::checkFlags() checks ("commonvalidity"), with ids that
// differ in these names.
struct FlaggedRange {
    const char *owner, *range, *flags;
    // Ids of rules that are named after the range, and after the flags.
    [[nodiscard]] std::string ofRange(const char *number) const { return idOf(range, number); }
    [[nodiscard]] std::string ofFlags(const char *number) const { return idOf(flags, number); }

private:
    [[nodiscard]] std::string idOf(const char *member, const char *number) const
    {
        return std::string("VUID-") + owner + "-" + member + "-" + number;
    }
};

// Checks the ranges of one command.
class RangeCheck
{
public:
    RangeCheck(DeviceModel &device, VkCommandBuffer commandBuffer, const char *command)
        : device_(device), commandBuffer_(commandBuffer), command_(command)
    {
    }
    [[nodiscard]] DeviceModel &device() const { return device_; }
    [[nodiscard]] VkCommandBuffer commandBuffer() const { return commandBuffer_; }
    [[nodiscard]] const Place &command() const { return command_; }
    // `place`: of the structure or command that has the range. Returns the only buffer there; null if that is not
    // known.
    VkBuffer check(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                   const FlaggedRange &names, const rules::Range &need) const;
    void check(const Place &place, const VkStridedDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
               const FlaggedRange &names, const rules::Range &need) const;
    // The rules of the flags only.
    void checkFlags(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                    const FlaggedRange &names) const;
    // `severity`: where the layer carries the command out.
    void fault(const Place &place, const char *vuid, const std::string &text,
               Severity severity = Severity::Reject) const;
    [[nodiscard]] bool isKept() const { return kept_; } // no fault was found

    // Ids for the flag PROTECTED in a command buffer that is not protected, and for its absence in one that is.
    void checkProtection(const Place &place, const char *member, VkAddressCommandFlagsKHR flags,
                         const char *unprotectedRule, const char *protectedRule) const;
    // The buffer at the address must not be protected.
    void checkUnprotected(const Place &place, VkDeviceAddress address, const char *rule) const;
    [[nodiscard]] bool isProtected() const; // the command buffer

private:
    // The buffer of a range that obviously keeps all rules, in one ordinary buffer. Most do, and take one look-up.
    [[nodiscard]] VkBuffer soundBuffer(const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                                       const rules::Range &need) const;
    VkBuffer check(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                   const FlaggedRange &names, const rules::Range &need, const rules::AnyRange &ids) const;
    void checkUsageFlags(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                         const FlaggedRange &names) const;
    void checkBinding(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                      const FlaggedRange &names) const;

    DeviceModel &device_;
    VkCommandBuffer commandBuffer_;
    Place command_;
    mutable bool kept_ = true;
};

// The check of a command's ranges, `check(ranges)`, until the implementation below, which does not report them again,
// has recorded it.
class CheckedRanges
{
public:
    template <typename Check>
    CheckedRanges(DeviceModel &device, VkCommandBuffer commandBuffer, const char *command, Check check)
        : checked_(commandBuffer, ranges_)
    {
        if (!device.checks.core)
            return;
        const RangeCheck ranges(device, commandBuffer, command);
        check(ranges);
        ranges_.reported = !ranges.isKept();
    }

private:
    input::CheckedRanges ranges_;
    input::Checked<input::CheckedRanges> checked_;
};

// For example "0x1000 + 64 bytes".
std::string textOf(const VkDeviceAddressRangeKHR &range);

namespace flagged
{

inline constexpr FlaggedRange kCopySource{"VkDeviceMemoryCopyKHR", "srcRange", "srcFlags"};
inline constexpr FlaggedRange kCopyTarget{"VkDeviceMemoryCopyKHR", "dstRange", "dstFlags"};
inline constexpr FlaggedRange kImageCopy{"VkDeviceMemoryImageCopyKHR", "addressRange", "addressFlags"};
inline constexpr FlaggedRange kFill{"vkCmdFillMemoryKHR", "pDstRange", "dstFlags"};
inline constexpr FlaggedRange kUpdate{"vkCmdUpdateMemoryKHR", "pDstRange", "dstFlags"};
inline constexpr FlaggedRange kQueryResults{"vkCmdCopyQueryPoolResultsToMemoryKHR", "pDstRange", "dstFlags"};
inline constexpr FlaggedRange kMarker{"VkMemoryMarkerInfoAMD", "dstRange", "dstFlags"};
inline constexpr FlaggedRange kIndexBuffer{"VkBindIndexBuffer3InfoKHR", "addressRange", "addressFlags"};
inline constexpr FlaggedRange kVertexBuffer{"VkBindVertexBuffer3InfoKHR", "addressRange", "addressFlags"};
inline constexpr FlaggedRange kFeedbackBuffer{"VkBindTransformFeedbackBuffer2InfoEXT", "addressRange", "addressFlags"};
inline constexpr FlaggedRange kDraw{"VkDrawIndirect2InfoKHR", "addressRange", "addressFlags"};
inline constexpr FlaggedRange kCountedDraw{"VkDrawIndirectCount2InfoKHR", "addressRange", "addressFlags"};
inline constexpr FlaggedRange kDrawCount{"VkDrawIndirectCount2InfoKHR", "countAddressRange", "countAddressFlags"};
inline constexpr FlaggedRange kDispatch{"VkDispatchIndirect2InfoKHR", "addressRange", "addressFlags"};
inline constexpr FlaggedRange kCondition{"VkConditionalRenderingBeginInfo2EXT", "addressRange", "addressFlags"};
inline constexpr FlaggedRange kBarrier{"VkMemoryRangeBarrierKHR", "addressRange", "addressFlags"};
inline constexpr FlaggedRange kCreation{"VkAccelerationStructureCreateInfo2KHR", "addressRange", "addressFlags"};

} // namespace flagged

namespace ranges
{

// The check of a command gets the command's arguments.
template <typename Command>
struct CheckOf;
template <typename... Arguments>
struct CheckOf<void(VKAPI_PTR *)(VkCommandBuffer, Arguments...)> {
    using Type = void(const RangeCheck &, Arguments...);
};
#define VELLUM_RANGES(command, scope, implementation, function, ...) CheckOf<PFN_vk##command>::Type function;
#define VELLUM_RANGES_DRAW VELLUM_RANGES
#define VELLUM_RANGES_DISPATCH VELLUM_RANGES
#include "layer/base/commands.inc"
CheckOf<PFN_vkCmdCopyMemoryKHR>::Type cmdCopyMemory;
CheckOf<PFN_vkCmdUpdateMemoryKHR>::Type cmdUpdateMemory;
CheckOf<PFN_vkCmdFillMemoryKHR>::Type cmdFillMemory;
CheckOf<PFN_vkCmdCopyQueryPoolResultsToMemoryKHR>::Type cmdCopyQueryPoolResultsToMemory;
CheckOf<PFN_vkCmdBeginConditionalRendering2EXT>::Type cmdBeginConditionalRendering2;

// The flags of the range, and the feature. The rules of micromaps and of other members are checked elsewhere.
void checkCreation(DeviceModel &, const VkAccelerationStructureCreateInfo2KHR &);

// Stages and accesses of micromap builds in all barriers, events, submissions and timestamps, and barriers of ranges.
void checkStage(DeviceModel &, const Place &, VkPipelineStageFlags2, const char *rule, ObjectHandle = {});
void checkDependency(const RangeCheck &, const Place &, const VkDependencyInfo &);
void checkSubmission(DeviceModel &, const Place &, const VkSubmitInfo2 &);

} // namespace ranges
} // namespace vellum::layer
