// SPDX-License-Identifier: Apache-2.0
// The commands of a case that copy, update and fill memory at device addresses.
#include "check/case/address_copies.h"
#include "check/case/built_case.h"
#include "check/case/names.h"
#include "gpu/micromap_commands.h"

namespace vellum::check
{
namespace
{

using CommandKind = AddressCommand::Kind;

VkImageSubresourceRange wholeOf(const AddressPlan &plan)
{
    return {VK_IMAGE_ASPECT_COLOR_BIT, 0, plan.levels, 0, plan.layers};
}

// The image of a plan. Its layout is GENERAL between submissions.
class PlanImage
{
public:
    PlanImage(Device &gpu, const AddressPlan &plan)
        : gpu_(gpu), plan_(plan),
          image_(gpu, vkInit<VkImageCreateInfo>({.imageType = plan.volume ? VK_IMAGE_TYPE_3D : VK_IMAGE_TYPE_2D,
                                                 .format = plan.format,
                                                 .extent = extentOf(plan, 0),
                                                 .mipLevels = plan.levels,
                                                 .arrayLayers = plan.layers,
                                                 .samples = VK_SAMPLE_COUNT_1_BIT,
                                                 .usage = kUsage}))
    {
    }
    static constexpr VkImageUsageFlags kUsage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;

    [[nodiscard]] VkImage handle() const { return image_.handle(); }
    void transition(VkCommandBuffer commands, VkImageLayout to)
    {
        const auto change =
            vkInit<VkImageMemoryBarrier>({.srcAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT,
                                          .dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT,
                                          .oldLayout = layout_,
                                          .newLayout = to,
                                          .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                          .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                          .image = handle(),
                                          .subresourceRange = wholeOf(plan_)});
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0,
                             nullptr, 0, nullptr, 1, &change);
        layout_ = to;
    }
    // By commands that take buffers.
    void write(const std::vector<uint8_t> &content)
    {
        const Buffer staging(gpu_, content.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
        std::ranges::copy(content, staging.bytes());
        gpu_.submit([&](VkCommandBuffer commands) {
            transition(commands, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
            const std::vector<VkBufferImageCopy> regions = allLevels();
            vkCmdCopyBufferToImage(commands, staging.handle(), handle(), layout_, plan_.levels, regions.data());
            transition(commands, VK_IMAGE_LAYOUT_GENERAL);
        });
    }
    void read(std::vector<uint8_t> &content)
    {
        const Buffer staging(gpu_, content.size(), VK_BUFFER_USAGE_TRANSFER_DST_BIT);
        gpu_.submit([&](VkCommandBuffer commands) {
            transition(commands, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
            const std::vector<VkBufferImageCopy> regions = allLevels();
            vkCmdCopyImageToBuffer(commands, handle(), layout_, staging.handle(), plan_.levels, regions.data());
            transition(commands, VK_IMAGE_LAYOUT_GENERAL);
            barrier(commands);
        });
        std::copy_n(staging.bytes(), content.size(), content.begin());
    }

private:
    [[nodiscard]] std::vector<VkBufferImageCopy> allLevels() const
    {
        std::vector<VkBufferImageCopy> regions;
        for (uint32_t level = 0; level < plan_.levels; ++level)
            regions.push_back({.bufferOffset = levelOffset(plan_, level),
                               .imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, level, 0, plan_.layers},
                               .imageExtent = extentOf(plan_, level)});
        return regions;
    }

    Device &gpu_;
    const AddressPlan &plan_;
    DeviceImage image_;
    VkImageLayout layout_ = VK_IMAGE_LAYOUT_UNDEFINED;
};

// The memory of a plan on a device, with its content before the commands.
class PlanMemory
{
public:
    PlanMemory(Device &gpu, const AddressPlan &plan) : gpu_(gpu), plan_(plan)
    {
        constexpr VkBufferUsageFlags usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                                             VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
        constexpr VkDeviceSize alignment = 16; // the largest of texels
        const AddressMemory before = memoryBefore(plan);
        for (size_t i = 0; i < plan.buffers.size(); ++i) {
            // Every third one ends where its VkBuffer ends. Others have bytes behind, which must stay 0.
            const bool last = i % 3 == 2;
            Guarded &buffer =
                buffers_.emplace_back(gpu, plan.buffers[i] + (last ? 0 : kBehind), alignment, usage, last);
            std::fill_n(buffer.bytes(), buffer.size(), uint8_t{0});
            buffer.write(0, before[i].data(), before[i].size());
        }
        if (usesImage(plan)) {
            image_ = std::make_unique<PlanImage>(gpu, plan);
            image_->write(before.back());
        }
    }

    [[nodiscard]] std::vector<Arena::Range> ranges() const
    {
        std::vector<Arena::Range> ranges;
        for (const Guarded &buffer : buffers_)
            ranges.push_back(buffer.range());
        return ranges;
    }
    // The first commands of the plan.
    void record(VkCommandBuffer commands, size_t count)
    {
        for (size_t i = 0; i < count; ++i) {
            const AddressCommand &command = plan_.commands[i];
            if (usesImage(command))
                image_->transition(commands, layoutFor(command));
            record(commands, command);
            barrier(commands);
        }
        if (image_)
            image_->transition(commands, VK_IMAGE_LAYOUT_GENERAL);
    }
    // The fault of the last command that was executed; empty: none.
    [[nodiscard]] std::string fault(size_t last, const AddressMemory &expected) const
    {
        AddressMemory found = expected;
        for (size_t i = 0; i < buffers_.size(); ++i) {
            std::copy_n(buffers_[i].bytes(), found[i].size(), found[i].begin());
            const uint8_t *const bytes = buffers_[i].bytes();
            if (!buffers_[i].intact() || std::any_of(bytes + plan_.buffers[i], bytes + buffers_[i].size(),
                                                     [](uint8_t byte) { return byte != 0; }))
                return std::string(nameOf(kAddressCommandNames, plan_.commands[last].kind)) +
                       " writes outside a buffer (command " + std::to_string(last) + ": bytes before or behind the " +
                       std::to_string(plan_.buffers[i]) + " of buffer " + std::to_string(i) + " are changed)";
        }
        if (image_)
            image_->read(found.back());
        return addressFault(plan_, last, expected, found);
    }

private:
    static constexpr VkDeviceSize kBehind = 65536;

    [[nodiscard]] VkImageLayout layoutFor(const AddressCommand &command) const
    {
        return !plan_.optimal                             ? VK_IMAGE_LAYOUT_GENERAL
               : command.kind == CommandKind::CopyToImage ? VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL
                                                          : VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    }
    // An empty range need not be one of a buffer (VUID-VkDeviceAddressRangeKHR-size-11411).
    [[nodiscard]] VkDeviceAddressRangeKHR rangeOf(uint32_t buffer, uint32_t offset, VkDeviceSize size) const
    {
        return {size == 0 && offset == 0 ? 0 : buffers_[buffer].address() + offset, size};
    }
    [[nodiscard]] VkDeviceAddressRangeKHR rangeOf(const AddressCommand &command, const AddressRegion &region) const
    {
        return rangeOf(region.buffer, region.offset, rangeSize(plan_, command, region));
    }
    void record(VkCommandBuffer commands, const AddressCommand &command) const
    {
        const VkAddressCommandFlagsKHR flags =
            kUnknownUsage |
            (command.fullyBound ? VkAddressCommandFlagsKHR{VK_ADDRESS_COMMAND_FULLY_BOUND_BIT_KHR} : 0u);
        if (usesImage(command))
            return recordImageCopy(commands, command, flags);
        if (command.kind == CommandKind::Copy)
            return recordCopy(commands, command, flags);
        const VkDeviceAddressRangeKHR range = rangeOf(command, command.regions[0]);
        if (command.kind == CommandKind::Fill)
            return gpu_.vk().CmdFillMemoryKHR(commands, &range, flags, command.value);
        const std::vector<uint8_t> data = updateData(command);
        gpu_.vk().CmdUpdateMemoryKHR(commands, &range, flags, data.size(), data.data());
    }
    void recordCopy(VkCommandBuffer commands, const AddressCommand &command, VkAddressCommandFlagsKHR flags) const
    {
        std::vector<VkDeviceMemoryCopyKHR> regions;
        for (const AddressRegion &region : command.regions)
            regions.push_back(
                vkInit<VkDeviceMemoryCopyKHR>({.srcRange = rangeOf(region.from, region.fromOffset, region.size),
                                               .srcFlags = flags,
                                               .dstRange = rangeOf(command, region),
                                               .dstFlags = flags}));
        const auto info = vkInit<VkCopyDeviceMemoryInfoKHR>(
            {.regionCount = static_cast<uint32_t>(regions.size()), .pRegions = regions.data()});
        gpu_.vk().CmdCopyMemoryKHR(commands, &info);
    }
    void recordImageCopy(VkCommandBuffer commands, const AddressCommand &command, VkAddressCommandFlagsKHR flags) const
    {
        std::vector<VkDeviceMemoryImageCopyKHR> regions;
        for (const AddressRegion &region : command.regions) {
            auto &made = regions.emplace_back(vkInit<VkDeviceMemoryImageCopyKHR>(
                {.addressRange = rangeOf(command, region),
                 .addressFlags = flags,
                 .addressRowLength = region.rowLength,
                 .addressImageHeight = region.imageHeight,
                 .imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, region.level, region.layer, region.layers},
                 .imageLayout = layoutFor(command)}));
            made.imageOffset = {static_cast<int32_t>(region.x), static_cast<int32_t>(region.y),
                                static_cast<int32_t>(region.z)};
            made.imageExtent = {region.width, region.height, region.depth};
        }
        const auto info = vkInit<VkCopyDeviceMemoryImageInfoKHR>({.image = image_->handle(),
                                                                  .regionCount = static_cast<uint32_t>(regions.size()),
                                                                  .pRegions = regions.data()});
        if (command.kind == CommandKind::CopyToImage)
            gpu_.vk().CmdCopyMemoryToImageKHR(commands, &info);
        else
            gpu_.vk().CmdCopyImageToMemoryKHR(commands, &info);
    }

    Device &gpu_;
    const AddressPlan &plan_;
    std::vector<Guarded> buffers_;
    std::unique_ptr<PlanImage> image_;
};

} // namespace

bool supportsImage(const Device &gpu, const AddressPlan &plan)
{
    VkImageFormatProperties properties{};
    const VkImageType type = plan.volume ? VK_IMAGE_TYPE_3D : VK_IMAGE_TYPE_2D;
    return vkGetPhysicalDeviceImageFormatProperties(gpu.physical(), plan.format, type, VK_IMAGE_TILING_OPTIMAL,
                                                    PlanImage::kUsage, 0, &properties) == VK_SUCCESS &&
           plan.width <= properties.maxExtent.width && plan.height <= properties.maxExtent.height &&
           plan.depth <= properties.maxExtent.depth && plan.levels <= properties.maxMipLevels &&
           plan.layers <= properties.maxArrayLayers;
}

void BuiltCase::copyAtAddresses()
{
    const AddressPlan &plan = case_.addressCopies;
    const size_t count = plan.commands.size();
    if (count == 0)
        return;
    PlanMemory memory(gpu_, plan);
    execute("copies at device addresses", memory.ranges(), [&](VkCommandBuffer to) { memory.record(to, count); });
    AddressMemory expected = memoryBefore(plan);
    for (uint32_t times = case_.build.twice ? 2 : 1; times > 0; --times)
        for (const AddressCommand &command : plan.commands)
            carryOut(plan, command, expected);
    const std::string whole = memory.fault(count - 1, expected);
    if (whole.empty())
        return;
    // The first command that goes wrong when those before it are executed with it, once.
    expected = memoryBefore(plan);
    for (size_t i = 0; i < count; ++i) {
        carryOut(plan, plan.commands[i], expected);
        PlanMemory beginning(gpu_, plan);
        gpu_.submit([&](VkCommandBuffer to) { beginning.record(to, i + 1); });
        if (const std::string fault = beginning.fault(i, expected); !fault.empty())
            return gpu_.fault(fault);
    }
    gpu_.fault("commands at device addresses leave a wrong byte only as the case executes them (at the end: " + whole +
               ")");
}

} // namespace vellum::check
