// SPDX-License-Identifier: Apache-2.0
// The check of address ranges: those of VK_KHR_device_address_commands, and barriers.
#pragma once

#include "layer/input/checked.h"
#include "layer/rules/address_ranges.h"
#include "layer/validation/model/device_model.h"
#include "layer/validation/ranges/range_rules.h"

namespace vellum::layer
{

// Checks the ranges of one command.
class RangeCheck
{
public:
    RangeCheck(DeviceModel &device, VkCommandBuffer commandBuffer) : device_(device), commandBuffer_(commandBuffer) {}
    // `place`: of the structure or command that has the range. Returns the only buffer there; null if that is not
    // known.
    VkBuffer check(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                   const RangeFlagRules &flagRules, const rules::Range &need) const;
    void check(const Place &place, const VkStridedDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
               const RangeFlagRules &flagRules, const rules::Range &need) const;
    // The rules of the flags only.
    void checkFlags(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                    const RangeFlagRules &rules) const;
    // `severity`: where the layer carries the command out.
    void fault(const Place &place, const char *vuid, const std::string &text,
               Severity severity = Severity::Reject) const;
    [[nodiscard]] bool isKept() const { return kept_; } // no fault was found

    // Ids for the flag PROTECTED in a command buffer that is not protected, and for its absence in one that is.
    void checkProtection(const Place &place, const char *member, VkAddressCommandFlagsKHR flags,
                         const char *unprotectedRule, const char *protectedRule) const;
    [[nodiscard]] bool isProtected() const; // the command buffer

private:
    // The buffer of a range that obviously keeps all rules, in one ordinary buffer. Most do, and take one look-up.
    [[nodiscard]] VkBuffer soundBuffer(const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                                       const rules::Range &need) const;
    VkBuffer check(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                   const RangeFlagRules &flagRules, const rules::Range &need, const rules::AnyRange &ids) const;
    void checkUsageFlags(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                         const RangeFlagRules &rules) const;
    void checkBinding(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                      const RangeFlagRules &rules) const;

    DeviceModel &device_;
    VkCommandBuffer commandBuffer_;
    mutable bool kept_ = true;
};

// The check of a command's ranges, until the implementation below, which does not report them again, has recorded it.
class CheckedRanges
{
public:
    template <typename Check>
    CheckedRanges(const DeviceModel &device, VkCommandBuffer commandBuffer, Check check)
        : ranges_{device.checks.core && !check()}, checked_(commandBuffer, ranges_)
    {
    }

private:
    input::CheckedRanges ranges_;
    input::Checked<input::CheckedRanges> checked_;
};

// For example "0x1000 + 64 bytes".
std::string textOf(const VkDeviceAddressRangeKHR &range);

// Each returns whether all rules are kept.
namespace ranges
{

bool checkCopy(DeviceModel &, VkCommandBuffer, const VkCopyDeviceMemoryInfoKHR &);
bool checkUpdate(DeviceModel &, VkCommandBuffer, const VkDeviceAddressRangeKHR &, VkAddressCommandFlagsKHR,
                 VkDeviceSize);
bool checkFill(DeviceModel &, VkCommandBuffer, const VkDeviceAddressRangeKHR &, VkAddressCommandFlagsKHR);
bool checkQueryResults(DeviceModel &, VkCommandBuffer, uint32_t count, const VkStridedDeviceAddressRangeKHR &,
                       VkAddressCommandFlagsKHR, VkQueryResultFlags);
bool checkMarker(DeviceModel &, VkCommandBuffer, const VkMemoryMarkerInfoAMD &);
bool checkCopyToImage(DeviceModel &, VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR &);
bool checkCopyFromImage(DeviceModel &, VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR &);

bool checkIndexBuffer(DeviceModel &, VkCommandBuffer, const VkBindIndexBuffer3InfoKHR &);
bool checkVertexBuffers(DeviceModel &, VkCommandBuffer, uint32_t first, uint32_t count,
                        const VkBindVertexBuffer3InfoKHR *);
enum class DrawKind { Vertices, Indexed, MeshTasks };
bool checkDraw(DeviceModel &, VkCommandBuffer, DrawKind, const VkDrawIndirect2InfoKHR &);
bool checkDraw(DeviceModel &, VkCommandBuffer, DrawKind, const VkDrawIndirectCount2InfoKHR &);
bool checkDispatch(DeviceModel &, VkCommandBuffer, const VkDispatchIndirect2InfoKHR &);
bool checkCondition(DeviceModel &, VkCommandBuffer, const VkConditionalRenderingBeginInfo2EXT &, bool isActive);
bool checkFeedbackBuffers(DeviceModel &, VkCommandBuffer, uint32_t count,
                          const VkBindTransformFeedbackBuffer2InfoEXT *);
bool checkFeedbackBegin(DeviceModel &, VkCommandBuffer, uint32_t count, const VkBindTransformFeedbackBuffer2InfoEXT *);
bool checkFeedbackEnd(DeviceModel &, VkCommandBuffer, uint32_t count, const VkBindTransformFeedbackBuffer2InfoEXT *);
bool checkByteCount(DeviceModel &, VkCommandBuffer, const VkBindTransformFeedbackBuffer2InfoEXT &);

// The flags of the range, and the feature. The rules of micromaps and of other members are checked elsewhere.
void checkCreation(DeviceModel &, const Place &command, const VkAccelerationStructureCreateInfo2KHR &);

// Stages and accesses of micromap builds in all barriers, events, submissions and timestamps, and barriers of ranges.
void checkStage(DeviceModel &, const Place &, VkPipelineStageFlags2, const char *rule, ObjectHandle = {});
bool checkDependency(DeviceModel &, const Place &, const VkDependencyInfo &, VkCommandBuffer);
void checkSubmission(DeviceModel &, const Place &, const VkSubmitInfo2 &);

} // namespace ranges
} // namespace vellum::layer
