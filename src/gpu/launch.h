// SPDX-License-Identifier: Apache-2.0
// Dispatches, draws and traces: parameters, given in the command or read by the device, and what a shader has besides
// its pipeline, a descriptor set and push constants.
#pragma once

#include <cstdint>

#include "gpu/device.h"

namespace vellum::gpu
{

// The form of a command. Indirect2: of traces vkCmdTraceRaysIndirect2KHR, which reads the tables as well; of others the
// form of VK_KHR_device_address_commands.
enum class Launch { Direct, Indirect, Indirect2 };

struct LaunchPlan {
    static constexpr uint32_t kMostDraws = 3; // of a command that reads their number

    Launch command = Launch::Direct;
    uint32_t height = 1, depth = 1; // of traces: the width is what the rays then need
    uint32_t offset = 0;            // words before the parameters of an indirect command
    // Of indirect draws: the device reads that it makes two of three draws. The first is of one vertex where that is a
    // primitive, the second of all, the third of nothing.
    bool counted = false;

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

// What a shader has besides its pipeline: a descriptor set and push constants.
struct Bindings {
    VkPipelineBindPoint point{};
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkDescriptorSet set = VK_NULL_HANDLE; // set 0
    VkShaderStageFlags stages = 0;        // stages that use the push constants; all are of the bind point
    std::span<const std::byte> constants; // from offset 0 on
};

// maintenance6: by the commands of VK_KHR_maintenance6, which the device must have.
void recordBindings(const Device &gpu, VkCommandBuffer commands, const Bindings &bindings, bool maintenance6);

} // namespace vellum::gpu
