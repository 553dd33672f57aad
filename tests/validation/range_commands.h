// SPDX-License-Identifier: Apache-2.0
// Shared by the programs about address ranges: buffers with creation flags, and each command that has a range.
#pragma once

#include "programs.h"

namespace vt
{

// A buffer with an address and memory; a sparse one gets memory by bind().
class RangeBuffer
{
public:
    static constexpr VkDeviceSize kSize = 65536;

    RangeBuffer(Gpu &gpu, VkBufferUsageFlags usage, VkBufferCreateFlags flags = 0, VkDeviceSize size = kSize);
    RangeBuffer(const RangeBuffer &) = delete;
    RangeBuffer &operator=(const RangeBuffer &) = delete;
    ~RangeBuffer();

    void bind();
    [[nodiscard]] VkBuffer handle() const { return buffer_; }
    [[nodiscard]] VkDeviceAddress address() const { return address_; }

private:
    Gpu &gpu_;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkDeviceAddress address_ = 0;
};

// A command that takes a range.
struct RangeCommand {
    VkBufferUsageFlags usage; // of the buffer
    void (*record)(Gpu &, VkCommandBuffer, const VkDeviceAddressRangeKHR &, VkAddressCommandFlagsKHR);
    VkDeviceSize size = 64; // of a right range
};
extern const RangeCommand kCopySource, kCopyTarget, kImageCopy, kImageSource, kFill, kUpdate, kQueryResults, kMarker,
    kIndexBuffer, kVertexBuffer, kFeedbackBuffer, kFeedbackCounter, kFeedbackEnd, kByteCount, kDraw, kIndexedDraw,
    kCountedDraw, kDrawCount, kMeshDraw, kMeshCountedDraw, kIndexedCountedDraw, kDispatch, kCondition, kBarrier,
    kCreation;

// Records commands that are never executed.
void recordOnly(Gpu &gpu, const std::function<void(VkCommandBuffer)> &record, bool isProtected = false,
                uint32_t family = UINT32_MAX);

// --- programs that break one rule of a command's range ---

inline constexpr VkBufferUsageFlags kOtherUsage = VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT;
inline constexpr VkBufferCreateFlags kProtectedBuffer = VK_BUFFER_CREATE_PROTECTED_BIT;
// The usage flags that a protected buffer may have (VUID-VkBufferCreateInfo-flags-09641). A command that needs another
// reports that as well.
constexpr VkBufferUsageFlags protectedUsage(VkBufferUsageFlags usage)
{
    return usage & (VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
}
inline constexpr VkAddressCommandFlagsKHR kProtectedRange = kUnknownUsage | VK_ADDRESS_COMMAND_PROTECTED_BIT_KHR;

template <const RangeCommand &command>
void usage(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, wrong ? kOtherUsage : command.usage);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {buffer.address(), command.size}, kUnknownUsage);
    });
}

template <const RangeCommand &command, VkDeviceSize offset = 2>
void alignment(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, command.usage);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {buffer.address() + (wrong ? offset : 0), command.size}, kUnknownUsage);
    });
}

template <const RangeCommand &command, VkDeviceSize rightSize, VkDeviceSize wrongSize>
void size(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, command.usage, 0, 4 * RangeBuffer::kSize);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {buffer.address(), wrong ? wrongSize : rightSize}, kUnknownUsage);
    });
}

// A protected buffer and PROTECTED, in a command buffer that is not protected.
template <const RangeCommand &command>
void protectedFlag(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, wrong ? protectedUsage(command.usage) : command.usage, wrong ? kProtectedBuffer : 0);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {buffer.address(), command.size}, wrong ? kProtectedRange : kUnknownUsage);
    });
}

// A buffer that is not protected, without PROTECTED, in a protected command buffer.
template <const RangeCommand &command>
void protectedCommands(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, command.usage);
    recordOnly(
        gpu,
        [&](VkCommandBuffer commands) {
            command.record(gpu, commands, {buffer.address(), command.size}, kUnknownUsage);
        },
        wrong);
}

} // namespace vt
