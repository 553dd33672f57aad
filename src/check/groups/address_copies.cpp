// SPDX-License-Identifier: Apache-2.0
// The group about commands that copy, update and fill memory at device addresses.
#include "check/case/address_copies.h"

#include <array>
#include <bit>

#include "check/case/names.h"
#include "check/groups/random_case.h"

namespace vellum::check
{
namespace
{

using AddressKind = AddressCommand::Kind;

class PlanMaker
{
public:
    explicit PlanMaker(Random &random) : random_(random)
    {
        for (uint32_t i = 1 + below(random, 4); i > 0; --i)
            plan_.buffers.push_back(bufferSize());
        if (chance(random, 50)) // for the largest updates
            plan_.buffers[0] = 65536 + below(random, 4000);
        plan_.format = kImageFormatNames[below(random, kImageFormatNames.size())].value;
        plan_.volume = chance(random, 30);
        plan_.width = 1 + below(random, 24);
        plan_.height = 1 + below(random, 12);
        (plan_.volume ? plan_.depth : plan_.layers) = 1 + below(random, 4);
        const uint32_t most = std::max({plan_.width, plan_.height, plan_.depth});
        plan_.levels = chance(random, 50) ? 1 : 1 + below(random, static_cast<uint32_t>(std::bit_width(most)));
        plan_.optimal = chance(random, 50);
    }

    AddressPlan make()
    {
        constexpr std::array kinds{AddressKind::Copy,          AddressKind::Copy,        AddressKind::Copy,
                                   AddressKind::CopyToImage,   AddressKind::CopyToImage, AddressKind::CopyFromImage,
                                   AddressKind::CopyFromImage, AddressKind::Update,      AddressKind::Fill};
        for (uint32_t i = 4 + below(random_, 9); i > 0; --i) {
            AddressCommand command = randomCommand(kinds[below(random_, kinds.size())]);
            if (!command.regions.empty())
                plan_.commands.push_back(std::move(command));
        }
        return std::move(plan_);
    }

private:
    uint32_t bufferSize()
    {
        const uint32_t size = 1 + below(random_, chance(random_, 30) ? 200 : 6000);
        return chance(random_, 40) ? (size + 15) / 16 * 16 : size;
    }
    // Few: most of the time. At most `most`.
    uint32_t amount(uint32_t few, uint32_t most)
    {
        return below(random_, (chance(random_, 80) ? std::min(few, most) : most) + 1);
    }
    // Where so many bytes begin in a buffer of that size: often at its beginning or end.
    uint32_t place(uint32_t bytes, uint32_t size, uint32_t multiple)
    {
        const uint32_t last = size < bytes ? 0 : (size - bytes) / multiple;
        return multiple * (chance(random_, 35) ? last : chance(random_, 20) ? 0 : below(random_, last + 1));
    }
    uint32_t anyBuffer() { return below(random_, static_cast<uint32_t>(plan_.buffers.size())); }

    AddressCommand randomCommand(AddressKind kind)
    {
        AddressCommand command{.kind = kind, .fullyBound = chance(random_, 40)};
        if (kind == AddressKind::Update || kind == AddressKind::Fill)
            command.value = static_cast<uint32_t>(random_());
        const bool several = kind != AddressKind::Update && kind != AddressKind::Fill;
        const uint32_t count = several && chance(random_, 70) ? 2 + below(random_, 6) : 1;
        // Those that the ones before it, or the sizes of the buffers, forbid are tried again.
        for (uint32_t tries = 12 * count; tries > 0 && command.regions.size() < count; --tries) {
            command.regions.push_back(randomRegion(kind));
            if (!brokenRule(plan_, command).empty())
                command.regions.pop_back();
        }
        return command;
    }

    AddressRegion randomRegion(AddressKind kind)
    {
        AddressRegion region{.buffer = anyBuffer()};
        const uint32_t size = plan_.buffers[region.buffer];
        switch (kind) {
        case AddressKind::Copy:
            region.from = anyBuffer();
            region.size = amount(80, std::min(size, plan_.buffers[region.from]));
            region.spare = chance(random_, 50) ? amount(40, size - region.size) : 0;
            region.fromOffset = place(region.size, plan_.buffers[region.from], 1);
            region.offset = place(region.size + region.spare, size, 1);
            return region;
        case AddressKind::Update:
            region.size = chance(random_, 20) ? 65536 : 4 + 4 * amount(30, std::min(size / 4, 16383u));
            region.spare = chance(random_, 40) ? below(random_, 30) : 0;
            region.offset = place(region.size + region.spare, size, 4);
            return region;
        case AddressKind::Fill:
            region.size = chance(random_, 15) ? size / 4 * 4 : 4 * amount(30, size / 4);
            region.offset = place(region.size, size, 4);
            return region;
        default: return randomImageRegion(region, {.kind = kind});
        }
    }

    // A part of what begins at 0, or all.
    void part(uint32_t all, uint32_t &first, uint32_t &count)
    {
        count = chance(random_, 40) ? all : 1 + below(random_, all);
        first = below(random_, all - count + 1);
    }
    // 0, as much as needed, or more.
    uint32_t length(uint32_t needed)
    {
        return chance(random_, 35) ? 0 : needed + (chance(random_, 20) ? 0 : 1 + below(random_, 7));
    }
    AddressRegion randomImageRegion(AddressRegion region, const AddressCommand &command)
    {
        region.level = below(random_, plan_.levels);
        const VkExtent3D extent = extentOf(plan_, region.level);
        part(extent.width, region.x, region.width);
        part(extent.height, region.y, region.height);
        part(extent.depth, region.z, region.depth);
        part(plan_.layers, region.layer, region.layers);
        region.rowLength = length(region.width);
        region.imageHeight = length(region.height);
        region.spare = chance(random_, 30) ? below(random_, 40) : 0;
        region.offset = place(static_cast<uint32_t>(rangeSize(plan_, command, region)), plan_.buffers[region.buffer],
                              static_cast<uint32_t>(texelSize(plan_)));
        return region;
    }

    Random &random_;
    AddressPlan plan_;
};

Case addressCopies(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.rays = 10;
    scene.objects = 2;
    scene.instances = 2;
    Case c{.scene = makeScene(random, scene, limits)};
    c.build.secondary = chance(random, 40);
    c.build.twice = chance(random, 40);
    c.build.rerecorded = chance(random, 25);
    makeConditional(random, c, limits, 20);
    c.addressCopies = randomAddressCopies(random);
    return c;
}

constexpr std::array kAddressGroups{
    Group{"address-copies",
          "memory copied, updated and filled at device addresses, between micromaps and structures: several regions of "
          "several buffers, ranges that are larger than what is copied or end with the buffer, images with "
          "levels, layers and depth, row lengths and image heights; every byte is compared",
          "vkCmdCopyMemoryKHR, VkDeviceMemoryCopyKHR: \"srcRange.size bytes will be copied from srcRange.address to "
          "dstRange.address\"; vkCmdCopyMemoryToImageKHR, vkCmdCopyImageToMemoryKHR, Buffer and Image Addressing: "
          "\"rowExtent\", \"sliceExtent\", \"layerExtent\"; vkCmdUpdateMemoryKHR: \"dataSize is the number of bytes "
          "to update\"; vkCmdFillMemoryKHR: \"written repeatedly to the destination range\"",
          200, runGroup<addressCopies>, 100},
};

} // namespace

AddressPlan randomAddressCopies(Random &random)
{
    return PlanMaker(random).make();
}

std::span<const Group> addressGroups()
{
    return kAddressGroups;
}

} // namespace vellum::check
