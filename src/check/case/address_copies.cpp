// SPDX-License-Identifier: Apache-2.0
#include "check/case/address_copies.h"

#include <algorithm>
#include <bit>
#include <fmt/format.h>

#include "check/case/names.h"

namespace vellum::check
{
namespace
{

using CommandKind = AddressCommand::Kind;

constexpr size_t kMostBuffers = 16, kMostRegions = 64;
constexpr uint32_t kMostBufferBytes = 1 << 20;
constexpr uint32_t kMostTexels = 256; // in a direction
constexpr uint32_t kMostLayers = 16;
constexpr uint64_t kMostUpdated = 65536;
constexpr size_t kNoMemory = ~size_t{0};

// A stretch of bytes that a command writes.
struct Stretch {
    size_t region;
    size_t from; // the element of AddressMemory; kNoMemory: data of the command
    uint64_t fromAt;
    size_t to;
    uint64_t toAt;
    uint64_t bytes;
};

// Bytes without a pattern that copies could preserve.
uint8_t noise(uint64_t seed, uint64_t i)
{
    uint64_t x = (seed + 1) * 0x9e3779b97f4a7c15u + i * 0xbf58476d1ce4e5b9u;
    x ^= x >> 31;
    x *= 0x94d049bb133111ebu;
    return static_cast<uint8_t>(x >> 56);
}

uint64_t layerSize(const AddressPlan &plan, uint32_t level)
{
    const VkExtent3D extent = extentOf(plan, level);
    return uint64_t{extent.width} * extent.height * extent.depth * texelSize(plan);
}

// "Buffer and Image Addressing": rowExtent and sliceExtent, in bytes.
uint64_t rowExtent(const AddressPlan &plan, const AddressRegion &region)
{
    return std::max(region.rowLength, region.width) * texelSize(plan);
}
uint64_t sliceExtent(const AddressPlan &plan, const AddressRegion &region)
{
    return std::max(region.imageHeight, region.height) * rowExtent(plan, region);
}

void addRows(const AddressPlan &plan, bool toImage, const AddressRegion &region, size_t number,
             std::vector<Stretch> &stretches)
{
    const size_t image = plan.buffers.size();
    const VkExtent3D extent = extentOf(plan, region.level);
    for (uint32_t layer = 0; layer < region.layers; ++layer)
        for (uint32_t z = 0; z < region.depth; ++z)
            for (uint32_t y = 0; y < region.height; ++y) {
                const uint64_t atAddress = region.offset +
                                           (uint64_t{layer} * region.depth + z) * sliceExtent(plan, region) +
                                           y * rowExtent(plan, region);
                const uint64_t row = (uint64_t{region.z} + z) * extent.height + region.y + y;
                const uint64_t inImage = levelOffset(plan, region.level) +
                                         (region.layer + layer) * layerSize(plan, region.level) +
                                         (row * extent.width + region.x) * texelSize(plan);
                const uint64_t bytes = region.width * texelSize(plan);
                if (toImage)
                    stretches.push_back({number, region.buffer, atAddress, image, inImage, bytes});
                else
                    stretches.push_back({number, image, inImage, region.buffer, atAddress, bytes});
            }
}

std::vector<Stretch> stretchesOf(const AddressPlan &plan, const AddressCommand &command)
{
    std::vector<Stretch> stretches;
    for (size_t i = 0; i < command.regions.size(); ++i) {
        const AddressRegion &region = command.regions[i];
        if (usesImage(command))
            addRows(plan, command.kind == CommandKind::CopyToImage, region, i, stretches);
        else if (command.kind == CommandKind::Copy)
            stretches.push_back({i, region.from, region.fromOffset, region.buffer, region.offset, region.size});
        else
            stretches.push_back({i, kNoMemory, 0, region.buffer, region.offset, region.size});
    }
    return stretches;
}

uint64_t imageSize(const AddressPlan &plan)
{
    return levelOffset(plan, plan.levels);
}

std::string brokenImageRule(const AddressPlan &plan, const AddressRegion &region)
{
    const auto within = [](uint32_t first, uint32_t count, uint32_t all) {
        return count >= 1 && uint64_t{first} + count <= all;
    };
    if (region.level >= plan.levels || !within(region.layer, region.layers, plan.layers))
        return "level or layers do not exist";
    const VkExtent3D extent = extentOf(plan, region.level);
    // VUID-VkCopyDeviceMemoryImageInfoKHR-pRegions-13032
    if (!within(region.x, region.width, extent.width) || !within(region.y, region.height, extent.height) ||
        !within(region.z, region.depth, extent.depth))
        return "exceeds the image";
    // VUID-VkDeviceMemoryImageCopyKHR-addressRowLength-09101, -addressImageHeight-09102
    if ((region.rowLength != 0 && region.rowLength < region.width) ||
        (region.imageHeight != 0 && region.imageHeight < region.height))
        return "rowLength or imageHeight is below the extent";
    if (region.rowLength > kMostTexels || region.imageHeight > kMostTexels)
        return "rowLength or imageHeight is too large";
    // VUID-VkCopyDeviceMemoryImageInfoKHR-image-13029
    return region.offset % texelSize(plan) == 0 ? "" : "offset is no multiple of the texel size";
}

std::string brokenRegionRule(const AddressPlan &plan, const AddressCommand &command, const AddressRegion &region)
{
    if (region.buffer >= plan.buffers.size() ||
        (command.kind == CommandKind::Copy && region.from >= plan.buffers.size()))
        return "a buffer does not exist";
    // VUID-VkDeviceAddress-size-11364, also of an empty range
    if (region.offset >= plan.buffers[region.buffer] ||
        (command.kind == CommandKind::Copy && region.fromOffset >= plan.buffers[region.from]))
        return "an address is behind its buffer";
    if (usesImage(command)) {
        if (std::string broken = brokenImageRule(plan, region); !broken.empty())
            return broken;
    }
    const auto words = [](uint32_t number) { return number % 4 == 0; };
    switch (command.kind) {
    case CommandKind::Copy:
        if (uint64_t{region.fromOffset} + region.size > plan.buffers[region.from])
            return "reads more than the buffer has";
        break;
    case CommandKind::Update:
        // VUID-vkCmdUpdateMemoryKHR-pDstRange-13006, -pDstRange-13007, -dataSize-13009, -dataSize-arraylength
        if (!words(region.offset) || !words(region.size) || region.size == 0 ||
            uint64_t{region.size} + region.spare > kMostUpdated)
            return "offset or size is no multiple of 4, or the size is 0 or above 65,536";
        break;
    case CommandKind::Fill:
        // VUID-vkCmdFillMemoryKHR-pDstRange-13001, -pDstRange-13002
        if (!words(region.offset) || !words(region.size) || region.spare != 0)
            return "offset or size is no multiple of 4";
        break;
    default: break;
    }
    // VUID-VkDeviceAddressRangeKHR-address-11365
    return region.offset + rangeSize(plan, command, region) <= plan.buffers[region.buffer]
               ? ""
               : "a range exceeds its buffer";
}

// The place of a byte.
std::string placeOf(const AddressPlan &plan, size_t memory, uint64_t at)
{
    if (memory < plan.buffers.size())
        return fmt::format("byte {} of buffer {}", at, memory);
    uint32_t level = 0;
    while (level + 1 < plan.levels && at >= levelOffset(plan, level + 1))
        ++level;
    at -= levelOffset(plan, level);
    const uint64_t texel = at % layerSize(plan, level) / texelSize(plan);
    const VkExtent3D extent = extentOf(plan, level);
    return fmt::format("byte {} of texel ({}, {}, {}) of level {}, layer {} of the image", at % texelSize(plan),
                       texel % extent.width, texel / extent.width % extent.height, texel / extent.width / extent.height,
                       level, at / layerSize(plan, level));
}

} // namespace

bool usesImage(const AddressCommand &command)
{
    return command.kind == CommandKind::CopyToImage || command.kind == CommandKind::CopyFromImage;
}

bool usesImage(const AddressPlan &plan)
{
    return std::ranges::any_of(plan.commands, [](const AddressCommand &command) { return usesImage(command); });
}

VkExtent3D extentOf(const AddressPlan &plan, uint32_t level)
{
    return {std::max(plan.width >> level, 1u), std::max(plan.height >> level, 1u), std::max(plan.depth >> level, 1u)};
}

uint64_t texelSize(const AddressPlan &plan)
{
    uint64_t size = 1;
    for (const Name<VkFormat> &format : kImageFormatNames) {
        if (format.value == plan.format)
            break;
        size *= 2;
    }
    return size;
}

uint64_t levelOffset(const AddressPlan &plan, uint32_t level)
{
    uint64_t offset = 0;
    for (uint32_t i = 0; i < level; ++i)
        offset += plan.layers * layerSize(plan, i);
    return offset;
}

uint64_t rangeSize(const AddressPlan &plan, const AddressCommand &command, const AddressRegion &region)
{
    if (!usesImage(command))
        return uint64_t{region.size} + region.spare;
    // VUID-VkDeviceMemoryImageCopyKHR-size-13037
    return (uint64_t{region.layers} * region.depth - 1) * sliceExtent(plan, region) +
           (region.height - 1) * rowExtent(plan, region) + region.width * texelSize(plan) + region.spare;
}

std::string brokenRule(const AddressPlan &plan)
{
    const auto between = [](uint32_t value, uint32_t most) { return value >= 1 && value <= most; };
    if (plan.buffers.size() > kMostBuffers ||
        !std::ranges::all_of(plan.buffers, [&](uint32_t size) { return between(size, kMostBufferBytes); }))
        return "buffers are too many, or their sizes are 0 or too large";
    if (!isNamed(kImageFormatNames, plan.format))
        return "no such format";
    if (!between(plan.width, kMostTexels) || !between(plan.height, kMostTexels) ||
        !between(plan.depth, plan.volume ? kMostTexels / 4 : 1) || !between(plan.layers, plan.volume ? 1 : kMostLayers))
        return "the image is too large, or its type has neither depth nor layers";
    // VUID-VkImageCreateInfo-mipLevels-00958
    if (!between(plan.levels, static_cast<uint32_t>(std::bit_width(std::max({plan.width, plan.height, plan.depth})))))
        return "the image has too many levels";
    return {};
}

std::string brokenRule(const AddressPlan &plan, const AddressCommand &command)
{
    if (!isNamed(kAddressCommandNames, command.kind))
        return "no such command";
    const bool several = usesImage(command) || command.kind == CommandKind::Copy;
    if (command.regions.empty() || command.regions.size() > (several ? kMostRegions : 1))
        return "has no region, or too many";
    for (const AddressRegion &region : command.regions)
        if (std::string broken = brokenRegionRule(plan, command, region); !broken.empty())
            return broken;
    if (!several)
        return {};
    // Nothing orders regions. VUID-VkCopyDeviceMemoryImageInfoKHR-pRegions-12473
    std::vector<std::vector<bool>> written, inTarget;
    for (const uint32_t size : plan.buffers) {
        written.emplace_back(size);
        inTarget.emplace_back(size);
    }
    if (usesImage(command))
        written.emplace_back(imageSize(plan));
    for (const Stretch &stretch : stretchesOf(plan, command))
        for (uint64_t i = stretch.toAt; i < stretch.toAt + stretch.bytes; ++i) {
            if (written[stretch.to][i])
                return "two regions write the same byte";
            written[stretch.to][i] = true;
        }
    if (command.kind != CommandKind::Copy)
        return {};
    // VUID-VkCopyDeviceMemoryInfoKHR-srcRange-13015: "must not overlap the memory backing the address range defined by
    // the srcRange or dstRange of any element"
    for (const AddressRegion &region : command.regions)
        std::fill_n(inTarget[region.buffer].begin() + region.offset, rangeSize(plan, command, region), true);
    for (const AddressRegion &region : command.regions)
        for (uint64_t i = region.fromOffset; i < uint64_t{region.fromOffset} + region.size; ++i) {
            if (inTarget[region.from][i])
                return "a range that is read overlaps another one";
            inTarget[region.from][i] = true;
        }
    return {};
}

std::vector<uint8_t> updateData(const AddressCommand &command)
{
    std::vector<uint8_t> data(command.regions[0].size);
    for (size_t i = 0; i < data.size(); ++i)
        data[i] = noise(uint64_t{command.value} + 1000, i);
    return data;
}

AddressMemory memoryBefore(const AddressPlan &plan)
{
    AddressMemory memory;
    for (const uint32_t size : plan.buffers)
        memory.emplace_back(size);
    memory.emplace_back(usesImage(plan) ? imageSize(plan) : 0);
    for (size_t m = 0; m < memory.size(); ++m)
        for (size_t i = 0; i < memory[m].size(); ++i)
            memory[m][i] = noise(m, i);
    return memory;
}

void carryOut(const AddressPlan &plan, const AddressCommand &command, AddressMemory &memory)
{
    const std::vector<uint8_t> data =
        command.kind == CommandKind::Update ? updateData(command) : std::vector<uint8_t>();
    for (const Stretch &stretch : stretchesOf(plan, command)) {
        for (uint64_t i = 0; i < stretch.bytes; ++i)
            memory[stretch.to][stretch.toAt + i] = stretch.from != kNoMemory ? memory[stretch.from][stretch.fromAt + i]
                                                   : !data.empty()           ? data[i]
                                                                   : static_cast<uint8_t>(command.value >> i % 4 * 8);
    }
}

std::string addressFault(const AddressPlan &plan, size_t command, const AddressMemory &expected,
                         const AddressMemory &found)
{
    size_t wrong = 0, memory = 0;
    uint64_t at = 0;
    for (size_t m = 0; m < expected.size(); ++m)
        for (size_t i = 0; i < expected[m].size(); ++i) {
            if (expected[m][i] == found[m][i])
                continue;
            if (wrong++ == 0) {
                memory = m;
                at = i;
            }
        }
    if (wrong == 0)
        return {};
    const AddressCommand &culprit = plan.commands[command];
    const std::string_view name = nameOf(kAddressCommandNames, culprit.kind);
    const std::string others = wrong > 1 ? fmt::format("; {} bytes differ", wrong) : "";
    const std::string place = placeOf(plan, memory, at);
    for (const Stretch &stretch : stretchesOf(plan, culprit)) {
        if (stretch.to != memory || at < stretch.toAt || at >= stretch.toAt + stretch.bytes)
            continue;
        const uint64_t offset = at - stretch.toAt;
        const std::string source = stretch.from == kNoMemory ? fmt::format("byte {} of its data", offset)
                                                             : placeOf(plan, stretch.from, stretch.fromAt + offset);
        return fmt::format("{} writes a wrong byte (command {}, region {}: {} is {:#04x}, not {:#04x} as {}{})", name,
                           command, stretch.region, place, found[memory][at], expected[memory][at], source, others);
    }
    return fmt::format("{} changes a byte that it must not (command {}: {} is {:#04x}, not {:#04x} as before{})", name,
                       command, place, found[memory][at], expected[memory][at], others);
}

} // namespace vellum::check
