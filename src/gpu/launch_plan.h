// SPDX-License-Identifier: Apache-2.0
// Dispatches, draws and traces whose parameters are given in the command, or read by the device.
#pragma once

#include <cstdint>

#include "gpu/device.h"

namespace vellum::gpu
{

// The form of a command. Indirect2: of traces vkCmdTraceRaysIndirect2KHR, which reads the tables as well; of others the
// form of VK_KHR_device_address_commands.
enum class Launch { Direct, Indirect, Indirect2 };

struct LaunchPlan {
    Launch command = Launch::Direct;
    uint32_t height = 1, depth = 1; // of traces: the width is what the rays then need
    uint32_t offset = 0;            // words before the parameters of an indirect command

    bool operator==(const LaunchPlan &) const = default;
};

// The parameters of an indirect command in memory; none with Launch::Direct.
class IndirectCommand
{
public:
    IndirectCommand() = default;
    template <class Parameters>
    IndirectCommand(Device &gpu, const LaunchPlan &launch, const Parameters &parameters)
        : kind_(launch.command), offset_(VkDeviceSize{4} * launch.offset), size_(sizeof parameters)
    {
        if (kind_ == Launch::Direct)
            return;
        std::vector<uint8_t> bytes(static_cast<size_t>(offset_ + size_), 0x5a);
        std::memcpy(bytes.data() + offset_, &parameters, sizeof parameters);
        buffer_ = gpu.upload(std::span<const uint8_t>(bytes), VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
    }

    [[nodiscard]] Launch kind() const { return kind_; }
    [[nodiscard]] VkBuffer buffer() const { return buffer_.handle(); }
    [[nodiscard]] VkDeviceSize offset() const { return offset_; }
    [[nodiscard]] VkDeviceAddressRangeKHR range() const { return {buffer_.address() + offset_, size_}; }

private:
    Launch kind_ = Launch::Direct;
    VkDeviceSize offset_ = 0, size_ = 0;
    Buffer buffer_;
};

} // namespace vellum::gpu
