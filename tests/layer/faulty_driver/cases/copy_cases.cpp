// SPDX-License-Identifier: Apache-2.0
// Faults of copies.cpp and generic.cpp.
#include "faulty_driver/cases/cases.h"

#include "gpu/micromap_commands.h"

namespace faults
{
namespace
{

using namespace vt;

// The sizes of micromaps, queried by `commands` commands.
std::vector<uint64_t> sizes(Gpu &gpu, std::span<const MicromapHandle> micromaps, VkQueryType type, bool together)
{
    const auto count = static_cast<uint32_t>(micromaps.size());
    const VkQueryType queried = micromapQueryType(gpu, type);
    const QueryPool pool(gpu, queried, count);
    gpu.submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, count);
        for (uint32_t i = 0; i < count; i += together ? count : 1)
            recordMicromapProperties(gpu, commands, micromaps.subspan(i, together ? count : 1), queried, pool, i);
    });
    std::vector<uint64_t> values;
    for (uint32_t i = 0; i < count; ++i)
        values.push_back(pool.value(i));
    return values;
}

std::string order(const std::vector<uint64_t> &values)
{
    return values[0] < values[1] ? "smaller first" : values[0] > values[1] ? "larger first" : "equal";
}

// Compares the sizes of a small micromap and a large one.
std::string orderOfSizes(Gpu &gpu, VkQueryType type, bool together)
{
    const auto small = built(gpu, uniform({0}), VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    MicromapInput many;
    for (uint32_t i = 0; i < 100; ++i)
        many.add(3, kFourState, [i] {
            std::vector<uint8_t> states(64, 1);
            states[i % 64] = static_cast<uint8_t>(i / 64 * 2);
            return states;
        }());
    const auto large = built(gpu, std::move(many), VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    return order(sizes(gpu, std::array{small->handle(), large->handle()}, type, together));
}

std::string compactedSizes(Gpu &gpu)
{
    return orderOfSizes(gpu, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT, true);
}

std::string serializedSizes(Gpu &gpu)
{
    return orderOfSizes(gpu, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT, false);
}

// Two queries of one size, of which the second one is written. Returns the results of both, with availability, 24 bytes
// apart; '-' where nothing was written. copied: by vkCmdCopyQueryPoolResults, the second query twice.
std::string secondQuery(Gpu &gpu, const std::function<void(VkQueryPool)> &afterwards, bool copied = false)
{
    const auto micromap = built(gpu, uniform({0}));
    const VkQueryType type = micromapQueryType(gpu, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT);
    const QueryPool pool(gpu, type, 3);
    const MicromapHandle handle = micromap->handle();
    constexpr VkDeviceSize kStride = 24;
    constexpr uint64_t kUnwritten = UINT64_MAX;
    const Buffer buffer(gpu, 2 * kStride, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    std::memset(buffer.bytes(), 0xff, 2 * kStride);
    constexpr VkQueryResultFlags kFlags = VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT;
    gpu.submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 3);
        recordMicromapProperties(gpu, commands, std::span(&handle, 1), type, pool, 1);
        if (copied) {
            recordMicromapProperties(gpu, commands, std::span(&handle, 1), type, pool, 2);
            vkCmdCopyQueryPoolResults(commands, pool, 1, 2, buffer.handle(), 0, kStride,
                                      kFlags | VK_QUERY_RESULT_WAIT_BIT);
        }
        barrier(commands);
    });
    afterwards(pool);
    if (!copied)
        (void)vkGetQueryPoolResults(gpu.device(), pool, 0, 2, 2 * kStride, buffer.bytes(), kStride,
                                    kFlags | VK_QUERY_RESULT_PARTIAL_BIT);
    std::string seen;
    for (const size_t word : {size_t{1}, size_t{4}})
        seen += buffer.as<uint64_t>()[word] == kUnwritten ? '-' : buffer.as<uint64_t>()[word] != 0 ? 'a' : 'u';
    return seen;
}

std::string queryStates(Gpu &gpu)
{
    return secondQuery(gpu, [](VkQueryPool) {});
}

std::string copiedStates(Gpu &gpu)
{
    return secondQuery(
        gpu, [](VkQueryPool) {}, true);
}

std::string resetStates(Gpu &gpu)
{
    return secondQuery(gpu, [&](VkQueryPool pool) {
        gpu.submit([&](VkCommandBuffer commands) { vkCmdResetQueryPool(commands, pool, 0, 2); });
    });
}

std::string hostResetStates(Gpu &gpu)
{
    return secondQuery(gpu, [&](VkQueryPool pool) { vkResetQueryPool(gpu.device(), pool, 0, 2); });
}

Guarded serialized(Gpu &gpu, const Micromap &micromap)
{
    const uint64_t size =
        sizes(gpu, std::array{micromap.handle()}, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT, true)[0];
    Guarded data(gpu, size, 256, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    gpu.submit(
        [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu, commands, micromap.handle(), data.address()); });
    return data;
}

std::string deserializedAgain(Gpu &gpu)
{
    const auto old = built(gpu, uniform({0})), other = built(gpu, uniform({1}));
    const Guarded data = serialized(gpu, *other);
    gpu.submit([&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu, commands, data.address(), old->handle()); });
    return statesOfMicromap(gpu, *old);
}

std::string header(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({0, 1, 2, 3}, 5));
    const Guarded data = serialized(gpu, *micromap);
    std::array<uint64_t, 2> stated{};
    std::memcpy(stated.data(), data.bytes() + 2 * VK_UUID_SIZE, sizeof stated);
    return stated[0] == stated[1] ? "equal" : "different";
}

// Two structures in one buffer. The first one is built last, by a handle that ends at the end of the buffer.
std::string sharedRange(Gpu &gpu)
{
    constexpr VkDeviceSize kSecond = 1 << 16, kSize = 1 << 17;
    const Buffer buffer(gpu, kSize, gpu.structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    Blas second(gpu);
    second.placeIn(buffer.handle(), kSecond);
    second.build({Geometry{.vertices = triangleRow(1)}});
    const std::vector<uint8_t> before(buffer.bytes() + kSecond, buffer.bytes() + kSize);
    auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = buffer.handle(), .size = kSize, .type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR});
    VkAccelerationStructureKHR generic = VK_NULL_HANDLE;
    VT_CHECK(gpu.vk().CreateAccelerationStructureKHR(gpu.device(), &info, nullptr, &generic));
    Blas prepared(gpu);
    prepared.prepare({Geometry{.vertices = triangleRow(2)}});
    VkAccelerationStructureBuildGeometryInfoKHR build = prepared.buildInfo();
    build.dstAccelerationStructure = generic;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = prepared.ranges();
    gpu.submit(
        [&](VkCommandBuffer commands) { gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &build, &ranges); });
    gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), generic, nullptr);
    return std::equal(before.begin(), before.end(), buffer.bytes() + kSecond) ? "intact" : "overwritten";
}

constexpr VkBufferUsageFlags kCopied =
    VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

// Copies two of four bytes to a range of three.
std::string copiedMemory(Gpu &gpu)
{
    const Buffer from(gpu, 4, kCopied), to(gpu, 4, kCopied);
    std::memcpy(from.bytes(), "abcd", 4);
    std::memcpy(to.bytes(), "----", 4);
    const auto region = vkInit<VkDeviceMemoryCopyKHR>({.srcRange = {from.address() + 1, 2},
                                                       .srcFlags = kUnknownUsage,
                                                       .dstRange = {to.address(), 3},
                                                       .dstFlags = kUnknownUsage});
    const auto info = vkInit<VkCopyDeviceMemoryInfoKHR>({.regionCount = 1, .pRegions = &region});
    gpu.submit([&](VkCommandBuffer commands) {
        gpu.vk().CmdCopyMemoryKHR(commands, &info);
        barrier(commands);
    });
    std::string text(to.bytes(), to.bytes() + 4);
    std::ranges::replace(text, '\0', '0');
    return text;
}

// Copies an image of two rows of two bytes to rows of three.
std::string copiedImage(Gpu &gpu)
{
    const DeviceImage image(
        gpu, vkInit<VkImageCreateInfo>({.imageType = VK_IMAGE_TYPE_2D,
                                        .format = VK_FORMAT_R8_UINT,
                                        .extent = {2, 2, 1},
                                        .mipLevels = 1,
                                        .arrayLayers = 1,
                                        .samples = VK_SAMPLE_COUNT_1_BIT,
                                        .usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT}));
    const Buffer from(gpu, 4, kCopied), to(gpu, 6, kCopied);
    std::memcpy(from.bytes(), "abcd", 4);
    std::memcpy(to.bytes(), "------", 6);
    const VkBufferImageCopy in{.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1}, .imageExtent = {2, 2, 1}};
    const auto out = vkInit<VkDeviceMemoryImageCopyKHR>({.addressRange = {to.address(), 6},
                                                         .addressFlags = kUnknownUsage,
                                                         .addressRowLength = 3,
                                                         .imageSubresource = in.imageSubresource,
                                                         .imageLayout = VK_IMAGE_LAYOUT_GENERAL,
                                                         .imageExtent = in.imageExtent});
    const auto info =
        vkInit<VkCopyDeviceMemoryImageInfoKHR>({.image = image.handle(), .regionCount = 1, .pRegions = &out});
    gpu.submit([&](VkCommandBuffer commands) {
        const auto toGeneral =
            vkInit<VkImageMemoryBarrier>({.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                                          .newLayout = VK_IMAGE_LAYOUT_GENERAL,
                                          .image = image.handle(),
                                          .subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1}});
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0,
                             nullptr, 0, nullptr, 1, &toGeneral);
        vkCmdCopyBufferToImage(commands, from.handle(), image.handle(), VK_IMAGE_LAYOUT_GENERAL, 1, &in);
        barrier(commands);
        gpu.vk().CmdCopyImageToMemoryKHR(commands, &info);
        barrier(commands);
    });
    return {to.bytes(), to.bytes() + 6};
}

} // namespace

std::span<const Case> copyCases()
{
    static const std::array cases{
        Case{"compacted-size-of-another", compactedSizes, "smaller first", "larger first"},
        Case{"query-of-previous", serializedSizes, "smaller first", "equal"},
        Case{"query-first-ignored", queryStates, "ua", "au"},
        Case{"results-stride-ignored", queryStates, "ua", "u-"},
        Case{"results-without-availability", queryStates, "ua", "aa"},
        Case{"copied-results-stride-ignored", copiedStates, "aa", "a-"},
        Case{"reset-does-nothing", resetStates, "uu", "ua"},
        Case{"host-reset-does-nothing", hostResetStates, "uu", "ua"},
        Case{"deserialization-keeps-old", deserializedAgain, "1", "0"},
        Case{"serialized-header-size", header, "different", "equal"},
        Case{"memory-copy-clears-rest", copiedMemory, "bc--", "bc0-", Api::Khr},
        Case{"image-copy-row-length", copiedImage, "ab-cd-", "abcd--", Api::Khr},
        Case{"generic-cleared-to-its-end", sharedRange, "intact", "overwritten"},
    };
    return cases;
}

} // namespace faults
