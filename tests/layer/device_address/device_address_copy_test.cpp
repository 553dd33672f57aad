// SPDX-License-Identifier: Apache-2.0
// Copies, fills, updates, image copies, query results and markers of VK_KHR_device_address_commands: the same bytes as
// from the commands that take buffers, and wrong ranges rejected.
#include <algorithm>

#include "device_address/address_ranges.h"
#include "harness/program/labels.h"

namespace
{

// The labels of all suites in this folder.
const vt::Labels kDeviceAddressCopyLabels{{"Address*.*", "one_api strict_ext"}};

using namespace vt;

constexpr VkBufferUsageFlags kSource = VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
constexpr VkBufferUsageFlags kTarget = VK_BUFFER_USAGE_TRANSFER_DST_BIT;

VkDeviceMemoryCopyKHR copyRegion(const VkDeviceAddressRangeKHR &from, const VkDeviceAddressRangeKHR &to)
{
    auto region =
        vkInit<VkDeviceMemoryCopyKHR>({.srcRange = from, .srcFlags = kAnyUsage, .dstRange = to, .dstFlags = kAnyUsage});
    return region;
}

class AddressCopies : public AddressTest
{
protected:
    explicit AddressCopies(const Options &options = {.addressCommands = true}) : AddressTest(options) {}

    void copy(VkCommandBuffer commands, std::span<const VkDeviceMemoryCopyKHR> regions)
    {
        auto info = vkInit<VkCopyDeviceMemoryInfoKHR>(
            {.regionCount = static_cast<uint32_t>(regions.size()), .pRegions = regions.data()});
        gpu().vk().CmdCopyMemoryKHR(commands, &info);
    }
    void copy(VkCommandBuffer commands, const VkDeviceMemoryCopyKHR &region) { copy(commands, std::span(&region, 1)); }
};

TEST_F(AddressCopies, RegionsOfManyBuffers)
{
    std::vector<Buffer> from, to;
    std::vector<std::vector<uint8_t>> expected;
    for (size_t i = 0; i < 3; ++i) {
        from.push_back(randomBuffer(1000 + i * 100, kSource));
        to.push_back(randomBuffer(900 + i * 50, kTarget));
        expected.push_back(bytesOf(to.back()));
    }
    std::vector<VkDeviceMemoryCopyKHR> regions;
    for (size_t i = 0; i < 30; ++i) { // in 30 bytes each, of every target
        const Buffer &source = from[random() % 3];
        const size_t target = random() % 3;
        const VkDeviceSize size = random() % 31;                           // none too
        const VkDeviceSize sourceOffset = i * 30 + random() % (31 - size); // sources must not overlap either
        regions.push_back(
            copyRegion(rangeOf(source, sourceOffset, size), rangeOf(to[target], i * 30, size == 0 ? 0 : 30)));
        std::copy_n(source.bytes() + sourceOffset, size, expected[target].begin() + static_cast<ptrdiff_t>(i) * 30);
    }
    regions.push_back(copyRegion({0, 0}, {0, 0}));
    gpu().submit([&](VkCommandBuffer commands) { copy(commands, regions); });
    for (size_t i = 0; i < 3; ++i)
        EXPECT_EQ(bytesOf(to[i]), expected[i]) << i;
}

TEST_F(AddressCopies, InsideOneBuffer)
{
    const Buffer both = randomBuffer(256, kSource | kTarget);
    std::vector<uint8_t> expected = bytesOf(both);
    std::copy_n(expected.begin() + 3, 60, expected.begin() + 101);
    gpu().submit(
        [&](VkCommandBuffer commands) { copy(commands, copyRegion(rangeOf(both, 3, 60), rangeOf(both, 101, 60))); });
    EXPECT_EQ(bytesOf(both), expected);
}

TEST_F(AddressCopies, SecondaryCommandBuffers)
{
    const Buffer from = randomBuffer(64, kSource);
    const Buffer to = buffer(64, kTarget);
    VkCommandBuffer secondary = gpu().begin(0, VK_COMMAND_BUFFER_LEVEL_SECONDARY);
    copy(secondary, copyRegion(rangeOf(from, 0, 64), rangeOf(to, 0, 64)));
    gpu().end(secondary);
    gpu().submit([&](VkCommandBuffer commands) { vkCmdExecuteCommands(commands, 1, &secondary); });
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &secondary);
    EXPECT_EQ(bytesOf(to), bytesOf(from));
}

// Of two buffers at the same address, the layer uses the one whose usage allows the command, whichever of them the
// address was queried from.
TEST_F(AddressCopies, AliasesWithDifferentUsage)
{
    for (const size_t queried : {0u, 1u}) {
        const Buffer from = randomBuffer(64, kSource);
        const Buffer to = buffer(64, kTarget);
        Aliases aliases(gpu(), 64, kSource, kTarget);
        const VkDeviceAddress address = aliases.address(queried);
        gpu().submit([&](VkCommandBuffer commands) {
            copy(commands, copyRegion(rangeOf(from, 0, 64), {address, 64}));
            barrier(commands);
            copy(commands, copyRegion({address, 64}, rangeOf(to, 0, 64)));
        });
        EXPECT_EQ(bytesOf(to), bytesOf(from));
        // When that buffer is destroyed, the other one replaces it, unless the layer is strict (AddressCopiesHarmless).
        aliases.destroy(queried);
        const auto back = copyRegion(rangeOf(from, 0, 64), {address, 64});
        const auto out = copyRegion({address, 64}, rangeOf(to, 0, 64));
        if (strictTests())
            expectRejected(queried == 0 ? "VkDeviceMemoryCopyKHR-srcRange-13017"
                                        : "VkDeviceMemoryCopyKHR-dstRange-13018",
                           [&](VkCommandBuffer commands) { copy(commands, queried == 0 ? out : back); });
        aliases.destroy(1 - queried);
        expectRejected("VkDeviceAddressRangeKHR-address-11365",
                       [&](VkCommandBuffer commands) { copy(commands, queried == 0 ? back : out); });
    }
}

TEST_F(AddressCopies, DestroyedAliases)
{
    Decoys decoys(gpu());
    const Buffer from = shadowed(decoys, 64, kSource, true), to = shadowed(decoys, 64, kTarget);
    const Buffer filled = shadowed(decoys, 64, kTarget), updated = shadowed(decoys, 64, kTarget);
    gpu().submit([&](VkCommandBuffer commands) {
        copy(commands, copyRegion(rangeOf(from, 0, 64), rangeOf(to, 0, 64)));
        const VkDeviceAddressRangeKHR fill = rangeOf(filled, 0, 64), update = rangeOf(updated, 0, 64);
        gpu().vk().CmdFillMemoryKHR(commands, &fill, kAnyUsage, 0x12345678);
        gpu().vk().CmdUpdateMemoryKHR(commands, &update, kAnyUsage, 64, from.bytes());
        decoys.destroy();
    });
    EXPECT_EQ(bytesOf(to), bytesOf(from));
    EXPECT_EQ(bytesOf(updated), bytesOf(from));
    for (const uint32_t word : filled.as<uint32_t>())
        EXPECT_EQ(word, 0x12345678u);
}

// A secondary command buffer is recorded once and executed by two primary ones.
TEST_F(AddressCopies, DestroyedAliasesInSecondaryCommandBuffers)
{
    Decoys decoys(gpu());
    const Buffer from = shadowed(decoys, 64, kSource, true), to = shadowed(decoys, 64, kTarget);
    VkCommandBuffer secondary = gpu().begin(0, VK_COMMAND_BUFFER_LEVEL_SECONDARY);
    copy(secondary, copyRegion(rangeOf(from, 0, 64), rangeOf(to, 0, 64)));
    gpu().end(secondary);
    decoys.destroy();
    for (int i = 0; i < 2; ++i) {
        std::memset(to.bytes(), 0, 64);
        gpu().submit([&](VkCommandBuffer commands) { vkCmdExecuteCommands(commands, 1, &secondary); });
        EXPECT_EQ(bytesOf(to), bytesOf(from));
    }
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &secondary);
}

TEST_F(AddressCopies, RejectsWrongRanges)
{
    const Buffer from = randomBuffer(256, kSource);
    const Buffer to = randomBuffer(256, kTarget);
    const Buffer other = randomBuffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    const std::vector<uint8_t> before = bytesOf(to);
    // The region before the wrong one is not copied either.
    const auto copyBoth = [&](VkCommandBuffer commands, const VkDeviceMemoryCopyKHR &wrong) {
        const std::array regions{copyRegion(rangeOf(from, 0, 64), rangeOf(to, 128, 64)), wrong};
        copy(commands, regions);
    };
    expectBadRangesRejected(from, other, "VkDeviceAddressRangeKHR", "VkDeviceMemoryCopyKHR-srcRange-13017",
                            [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
                                copyBoth(commands, copyRegion(range, {to.address(), range.size}));
                            });
    expectBadRangesRejected(to, other, "VkDeviceAddressRangeKHR", "VkDeviceMemoryCopyKHR-dstRange-13018",
                            [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
                                copyBoth(commands, copyRegion(rangeOf(from, 0, 64), range));
                            });
    expectRejected("VkDeviceMemoryCopyKHR-size-13016", [&](VkCommandBuffer commands) {
        copyBoth(commands, copyRegion(rangeOf(from, 0, 64), rangeOf(to, 0, 60)));
    });
    EXPECT_EQ(bytesOf(to), before);
}

TEST_F(AddressCopies, Fills)
{
    const Buffer to = randomBuffer(256, kTarget);
    const Buffer twin = buffer(256, kTarget);
    std::memcpy(twin.bytes(), to.bytes(), 256);
    const Buffer other = buffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    const auto fill = [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
        gpu().vk().CmdFillMemoryKHR(commands, &range, kAnyUsage, 0x12345678);
    };
    gpu().submit([&](VkCommandBuffer commands) {
        fill(commands, rangeOf(to, 20, 100));
        fill(commands, {0, 0});
        fill(commands, rangeOf(to, 200, 56)); // to the end
        vkCmdFillBuffer(commands, twin.handle(), 20, 100, 0x12345678);
        vkCmdFillBuffer(commands, twin.handle(), 200, 56, 0x12345678);
    });
    EXPECT_EQ(bytesOf(to), bytesOf(twin));
    expectBadRangesRejected(to, other, "VkDeviceAddressRangeKHR", "vkCmdFillMemoryKHR-dstRange-13000", fill);
    EXPECT_EQ(bytesOf(to), bytesOf(twin));
}

TEST_F(AddressCopies, Updates)
{
    const Buffer to = randomBuffer(256, kTarget);
    const Buffer twin = buffer(256, kTarget);
    std::memcpy(twin.bytes(), to.bytes(), 256);
    const Buffer other = buffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    std::array<uint32_t, 16> data{};
    for (uint32_t &word : data)
        word = random();
    const auto update = [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
        gpu().vk().CmdUpdateMemoryKHR(commands, &range, kAnyUsage, sizeof data, data.data());
    };
    gpu().submit([&](VkCommandBuffer commands) {
        update(commands, rangeOf(to, 20, 80)); // of which 64 are written
        update(commands, rangeOf(to, 192, 64));
        vkCmdUpdateBuffer(commands, twin.handle(), 20, sizeof data, data.data());
        vkCmdUpdateBuffer(commands, twin.handle(), 192, sizeof data, data.data());
    });
    EXPECT_EQ(bytesOf(to), bytesOf(twin));
    expectBadRangesRejected(to, other, "VkDeviceAddressRangeKHR", "vkCmdUpdateMemoryKHR-dstRange-13005", update, false);
    expectRejected("vkCmdUpdateMemoryKHR-dataSize-13008",
                   [&](VkCommandBuffer commands) { update(commands, rangeOf(to, 196, 60)); });
    EXPECT_EQ(bytesOf(to), bytesOf(twin));
}

// --- images ---

constexpr uint32_t kWidth = 8, kHeight = 4, kLayers = 3;

class Image
{
public:
    explicit Image(Gpu &gpu)
        : image_(gpu, vkInit<VkImageCreateInfo>(
                          {.imageType = VK_IMAGE_TYPE_2D,
                           .format = VK_FORMAT_R32_UINT,
                           .extent = {kWidth, kHeight, 1},
                           .mipLevels = 1,
                           .arrayLayers = kLayers,
                           .samples = VK_SAMPLE_COUNT_1_BIT,
                           .usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT}))
    {
    }
    // Image layer `layer` is in VK_IMAGE_LAYOUT_GENERAL, the others are in `optimal`.
    static VkImageLayout layoutOf(uint32_t layer, VkImageLayout optimal)
    {
        return layer == 1 ? VK_IMAGE_LAYOUT_GENERAL : optimal;
    }
    void transition(VkCommandBuffer commands, VkImageLayout before, VkImageLayout after) const
    {
        std::array<VkImageMemoryBarrier2, kLayers> barriers{};
        for (uint32_t i = 0; i < kLayers; ++i) {
            VkImageMemoryBarrier2 &b = barriers[i];
            b = vkInit<VkImageMemoryBarrier2>();
            b.srcStageMask = b.dstStageMask = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
            b.srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT;
            b.dstAccessMask = VK_ACCESS_2_TRANSFER_READ_BIT | VK_ACCESS_2_TRANSFER_WRITE_BIT;
            b.oldLayout = before == VK_IMAGE_LAYOUT_UNDEFINED ? before : layoutOf(i, before);
            b.newLayout = layoutOf(i, after);
            b.srcQueueFamilyIndex = b.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
            b.image = handle();
            b.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, i, 1};
        }
        auto info =
            vkInit<VkDependencyInfo>({.imageMemoryBarrierCount = kLayers, .pImageMemoryBarriers = barriers.data()});
        vkCmdPipelineBarrier2(commands, &info);
    }
    [[nodiscard]] VkImage handle() const { return image_.handle(); }

private:
    DeviceImage image_;
};

class AddressImageCopies : public AddressTest
{
protected:
    static VkDeviceMemoryImageCopyKHR region(const VkDeviceAddressRangeKHR &range, uint32_t layer,
                                             VkImageLayout optimal)
    {
        return vkInit<VkDeviceMemoryImageCopyKHR>({.addressRange = range,
                                                   .addressFlags = kAnyUsage,
                                                   .imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, layer, 1},
                                                   .imageLayout = Image::layoutOf(layer, optimal),
                                                   .imageExtent = {kWidth, kHeight, 1}});
    }
    static VkCopyDeviceMemoryImageInfoKHR info(const Image &image, std::span<const VkDeviceMemoryImageCopyKHR> regions)
    {
        return vkInit<VkCopyDeviceMemoryImageInfoKHR>({.image = image.handle(),
                                                       .regionCount = static_cast<uint32_t>(regions.size()),
                                                       .pRegions = regions.data()});
    }
};

// Layers in different layouts from and to different buffers, rows and layers longer than the image's, and a part.
TEST_F(AddressImageCopies, ThereAndBack)
{
    const Image image(gpu());
    const Buffer a = randomBuffer(2048, kSource), b = randomBuffer(2048, kSource);
    const Buffer out = buffer(1024, kTarget), out2 = buffer(1024, kTarget);
    constexpr VkDeviceSize layerBytes = 4 * kWidth * kHeight;
    constexpr VkImageLayout in = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, from = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;

    std::vector<VkDeviceMemoryImageCopyKHR> regions{region(rangeOf(a, 64, layerBytes), 0, in),
                                                    region(rangeOf(b, 132, 1024), 1, in),
                                                    region(rangeOf(a, 512, layerBytes), 2, in)};
    regions[1].addressRowLength = 11;
    regions[1].addressImageHeight = 5;
    auto part = region(rangeOf(b, 4, 8), 2, in);
    part.imageOffset = {3, 2, 0};
    part.imageExtent = {2, 1, 1};
    const std::vector<VkDeviceMemoryImageCopyKHR> back{region(rangeOf(out, 128, layerBytes), 0, from),
                                                       region(rangeOf(out2, 0, layerBytes), 1, from),
                                                       region(rangeOf(out, 512, layerBytes), 2, from)};
    gpu().submit([&](VkCommandBuffer commands) {
        image.transition(commands, VK_IMAGE_LAYOUT_UNDEFINED, in);
        const auto first = info(image, regions), second = info(image, std::span(&part, 1)), third = info(image, back);
        gpu().vk().CmdCopyMemoryToImageKHR(commands, &first);
        barrier(commands);
        gpu().vk().CmdCopyMemoryToImageKHR(commands, &second);
        image.transition(commands, in, from);
        gpu().vk().CmdCopyImageToMemoryKHR(commands, &third);
    });
    std::vector<uint8_t> expected(1024), expected2(1024);
    std::copy_n(a.bytes() + 64, layerBytes, expected.begin() + 128);
    std::copy_n(a.bytes() + 512, layerBytes, expected.begin() + 512);
    std::copy_n(b.bytes() + 4, 8, expected.begin() + 512 + 4 * (2 * kWidth + 3));
    for (uint32_t y = 0; y < kHeight; ++y)
        std::copy_n(b.bytes() + 132 + y * 44, 4 * kWidth, expected2.begin() + y * 4 * kWidth);
    EXPECT_EQ(bytesOf(out), expected);
    EXPECT_EQ(bytesOf(out2), expected2);
}

TEST_F(AddressImageCopies, DestroyedAliases)
{
    constexpr VkDeviceSize layerBytes = 4 * kWidth * kHeight;
    constexpr VkImageLayout in = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, from = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    const Image image(gpu());
    Decoys decoys(gpu());
    const Buffer source = shadowed(decoys, layerBytes, kSource, true), target = shadowed(decoys, layerBytes, kTarget);
    const auto there = region(rangeOf(source, 0, layerBytes), 0, in);
    const auto back = region(rangeOf(target, 0, layerBytes), 0, from);
    gpu().submit([&](VkCommandBuffer commands) {
        image.transition(commands, VK_IMAGE_LAYOUT_UNDEFINED, in);
        const auto first = info(image, std::span(&there, 1)), second = info(image, std::span(&back, 1));
        gpu().vk().CmdCopyMemoryToImageKHR(commands, &first);
        image.transition(commands, in, from);
        gpu().vk().CmdCopyImageToMemoryKHR(commands, &second);
        decoys.destroy();
    });
    EXPECT_EQ(bytesOf(target), bytesOf(source));
}

TEST_F(AddressImageCopies, RejectsWrongRanges)
{
    const Image image(gpu());
    const Buffer from = buffer(256, kSource), to = randomBuffer(256, kTarget);
    const Buffer other = buffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    const std::vector<uint8_t> before = bytesOf(to);
    const auto regionsWith = [](const VkDeviceAddressRangeKHR &good, const VkDeviceAddressRangeKHR &range) {
        std::array regions{region(good, 0, VK_IMAGE_LAYOUT_GENERAL), region(range, 1, VK_IMAGE_LAYOUT_GENERAL)};
        for (auto &r : regions)
            r.imageExtent = {4, 4, 1};
        return regions;
    };
    expectBadRangesRejected(from, other, "VkDeviceAddressRangeKHR", "vkCmdCopyMemoryToImageKHR-addressRange-13128",
                            [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
                                const auto regions = regionsWith(rangeOf(from, 0, 64), range);
                                const auto copy = info(image, regions);
                                gpu().vk().CmdCopyMemoryToImageKHR(commands, &copy);
                            });
    expectBadRangesRejected(to, other, "VkDeviceAddressRangeKHR", "vkCmdCopyImageToMemoryKHR-addressRange-13129",
                            [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
                                const auto regions = regionsWith(rangeOf(to, 0, 64), range);
                                const auto copy = info(image, regions);
                                gpu().vk().CmdCopyImageToMemoryKHR(commands, &copy);
                            });
    EXPECT_EQ(bytesOf(to), before);
}

// --- query results ---

class AddressQueries : public AddressTest
{
protected:
    // Copies two results of a pool of the type, by both commands; `write` makes them available.
    void expectSame(VkQueryType type, const std::function<void(VkCommandBuffer, VkQueryPool)> &write)
    {
        const QueryPool pool(gpu(), type, 3);
        const Buffer out = randomBuffer(128, kTarget), twin = buffer(128, kTarget);
        std::memcpy(twin.bytes(), out.bytes(), 128);
        const std::vector<uint8_t> before = bytesOf(out);
        const VkQueryResultFlags flags =
            VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT;
        const auto copy = [&](VkCommandBuffer commands, const VkStridedDeviceAddressRangeKHR &range,
                              uint32_t count = 2) {
            gpu().vk().CmdCopyQueryPoolResultsToMemoryKHR(commands, pool, 1, count, &range, kAnyUsage, flags);
        };
        gpu().submit([&](VkCommandBuffer commands) {
            vkCmdResetQueryPool(commands, pool, 0, 3);
            write(commands, pool);
            copy(commands, rangeOf(out, 24, 48, 32)); // the second one's stride is cut off
            vkCmdCopyQueryPoolResults(commands, pool, 1, 2, twin.handle(), 24, 32, flags);
        });
        EXPECT_EQ(bytesOf(out), bytesOf(twin));
        EXPECT_NE(bytesOf(out), before);
        const Buffer other = buffer(128, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
        expectBadRangesRejected(
            out, other, "VkStridedDeviceAddressRangeKHR", "vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13080",
            [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
                copy(commands, {range.address, range.size, 32});
            },
            false);
        for (const VkStridedDeviceAddressRangeKHR &range :
             {rangeOf(out, 96, 32, 32), rangeOf(out, 24, 32, 96), rangeOf(out, 0, 128, UINT64_MAX)})
            expectRejected("vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13079",
                           [&](VkCommandBuffer commands) { copy(commands, range); });
        EXPECT_EQ(bytesOf(out), bytesOf(twin));
    }
};

TEST_F(AddressQueries, DriverPools)
{
    expectSame(VK_QUERY_TYPE_TIMESTAMP, [](VkCommandBuffer commands, VkQueryPool pool) {
        for (uint32_t i = 1; i < 3; ++i)
            vkCmdWriteTimestamp2(commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, pool, i);
    });
}

TEST_F(AddressQueries, DestroyedAliases)
{
    const QueryPool pool(gpu(), VK_QUERY_TYPE_TIMESTAMP, 1);
    Decoys decoys(gpu());
    const Buffer out = shadowed(decoys, 16, kTarget);
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        vkCmdWriteTimestamp2(commands, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, pool, 0);
        const VkStridedDeviceAddressRangeKHR range = rangeOf(out, 0, 16, 16);
        gpu().vk().CmdCopyQueryPoolResultsToMemoryKHR(commands, pool, 0, 1, &range, kAnyUsage,
                                                      VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT |
                                                          VK_QUERY_RESULT_WITH_AVAILABILITY_BIT);
        decoys.destroy();
    });
    EXPECT_EQ(out.as<uint64_t>()[0], pool.value(0));
    EXPECT_EQ(out.as<uint64_t>()[1], 1u);
}

TEST_F(AddressQueries, LayerPools)
{
    const Buffer storage = buffer(1 << 16, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
    const Buffer scratch = buffer(1 << 16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    auto create = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = storage.handle(), .size = storage.size(), .type = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    VT_CHECK(gpu().vk().CreateAccelerationStructureKHR(gpu().device(), &create, nullptr, &structure));
    auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR});
    geometry.geometry.instances = vkInit<VkAccelerationStructureGeometryInstancesDataKHR>();
    auto build = vkInit<VkAccelerationStructureBuildGeometryInfoKHR>(
        {.type = create.type, .dstAccelerationStructure = structure, .geometryCount = 1, .pGeometries = &geometry});
    build.scratchData.deviceAddress = scratch.address();
    const VkAccelerationStructureBuildRangeInfoKHR none{};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &none;
    gpu().submit(
        [&](VkCommandBuffer commands) { gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &build, &ranges); });
    const VkQueryType type = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR;
    expectSame(type, [&](VkCommandBuffer commands, VkQueryPool pool) {
        const std::array both{structure, structure};
        gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 2, both.data(), type, pool, 1);
    });
    gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), structure, nullptr);
}

// --- VK_AMD_buffer_marker, which the spy provides on request ---

class AddressMarkers : public AddressTest
{
protected:
    AddressMarkers() : AddressTest({.validation = false, .addressCommands = true}) {}
    static void SetUpTestSuite() { setenv("VELLUM_TEST_SPY_MARKER", "1", 1); }
    static void TearDownTestSuite() { unsetenv("VELLUM_TEST_SPY_MARKER"); }
};

TEST_F(AddressMarkers, AreWritten)
{
    const Buffer to = randomBuffer(256, kTarget);
    const Buffer other = buffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    std::vector<uint8_t> expected = bytesOf(to);
    const uint32_t marker = 0xfeedbeef;
    auto info = vkInit<VkMemoryMarkerInfoAMD>({.dstFlags = kAnyUsage, .marker = marker});
    ASSERT_NE(gpu().vk().CmdWriteMarkerToMemoryAMD, nullptr);
    gpu().submit([&](VkCommandBuffer commands) {
        info.stage = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
        info.dstRange = rangeOf(to, 20, 4);
        gpu().vk().CmdWriteMarkerToMemoryAMD(commands, &info);
        info.stage = VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT; // the spy reports it if the driver gets it
        info.dstRange = rangeOf(to, 252, 4);
        gpu().vk().CmdWriteMarkerToMemoryAMD(commands, &info);
    });
    std::memcpy(&expected[20], &marker, 4);
    std::memcpy(&expected[252], &marker, 4);
    EXPECT_EQ(bytesOf(to), expected);
    info.stage = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    const auto mark = [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
        info.dstRange = range;
        gpu().vk().CmdWriteMarkerToMemoryAMD(commands, &info);
    };
    expectBadRangesRejected(to, other, "VkDeviceAddressRangeKHR", "VkMemoryMarkerInfoAMD-dstRange-13039", mark, false);
    expectRejected("VkMemoryMarkerInfoAMD-dstRange-13041",
                   [&](VkCommandBuffer commands) { mark(commands, rangeOf(to, 253, 3)); });
    EXPECT_EQ(bytesOf(to), expected);
}

TEST_F(AddressMarkers, RangeThatIsTooSmall)
{
    const Buffer to = randomBuffer(256, kTarget);
    std::vector<uint8_t> expected = bytesOf(to);
    auto info = vkInit<VkMemoryMarkerInfoAMD>({.stage = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
                                               .dstRange = rangeOf(to, 20, 3),
                                               .dstFlags = kAnyUsage,
                                               .marker = 0xfeedbeef});
    if (done("VkMemoryMarkerInfoAMD-dstRange-13041",
             [&](VkCommandBuffer commands) { gpu().vk().CmdWriteMarkerToMemoryAMD(commands, &info); }))
        std::memcpy(&expected[20], &info.marker, 4);
    EXPECT_EQ(bytesOf(to), expected);
}

// Ranges and buffers that a driver has nothing against. Validation below would.
class AddressCopiesHarmless : public AddressCopies
{
protected:
    AddressCopiesHarmless() : AddressCopies({.validation = false, .addressCommands = true}) {}
    Buffer other_ = randomBuffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    std::vector<uint8_t> expected_ = bytesOf(other_);
};

TEST_F(AddressCopiesHarmless, Usage)
{
    const Buffer from = randomBuffer(256, kSource), to = buffer(256, kTarget);
    if (done("VkDeviceMemoryCopyKHR-dstRange-13018", [&](VkCommandBuffer commands) {
            copy(commands, copyRegion(rangeOf(from, 0, 64), rangeOf(other_, 100, 64)));
        }))
        std::memcpy(&expected_[100], from.bytes(), 64);
    EXPECT_EQ(bytesOf(other_), expected_);
    const bool copied = done("VkDeviceMemoryCopyKHR-srcRange-13017", [&](VkCommandBuffer commands) {
        copy(commands, copyRegion(rangeOf(other_, 0, 256), rangeOf(to, 0, 256)));
    });
    EXPECT_EQ(bytesOf(to), copied ? expected_ : std::vector<uint8_t>(256));
    const VkDeviceAddressRangeKHR filled = rangeOf(other_, 8, 16);
    if (done("vkCmdFillMemoryKHR-dstRange-13000",
             [&](VkCommandBuffer commands) { gpu().vk().CmdFillMemoryKHR(commands, &filled, kAnyUsage, 0); }))
        std::memset(&expected_[8], 0, 16);
    const VkDeviceAddressRangeKHR updated = rangeOf(other_, 40, 8);
    if (done("vkCmdUpdateMemoryKHR-dstRange-13005", [&](VkCommandBuffer commands) {
            gpu().vk().CmdUpdateMemoryKHR(commands, &updated, kAnyUsage, 8, from.bytes());
        }))
        std::memcpy(&expected_[40], from.bytes(), 8);
    EXPECT_EQ(bytesOf(other_), expected_);
}

TEST_F(AddressCopiesHarmless, Sizes)
{
    const Buffer to = randomBuffer(256, kTarget);
    std::vector<uint8_t> expected = bytesOf(to);
    const uint64_t data = 0x123456789abcdef;
    const auto update = [&](const char *rule, const VkDeviceAddressRangeKHR &range) {
        if (done(rule, [&](VkCommandBuffer commands) {
                gpu().vk().CmdUpdateMemoryKHR(commands, &range, kAnyUsage, 8, &data);
            }))
            std::memcpy(&expected[range.address - to.address()], &data, 8);
        EXPECT_EQ(bytesOf(to), expected);
    };
    update("vkCmdUpdateMemoryKHR-dataSize-13008", rangeOf(to, 8, 4));
    update("VkDeviceAddressRangeKHR-address-11365", rangeOf(to, 248, 4096));
}

TEST_F(AddressCopies, CommandsOfMissingExtensionsAreNull)
{
    if (validationOfTests() == Validation::Above)
        GTEST_SKIP() << "the validation layer has all commands that it knows";
    EXPECT_EQ(gpu().vk().CmdWriteMarkerToMemoryAMD, nullptr);
    const Gpu without({.validation = false, .api = Api::Ext});
    EXPECT_EQ(without.vk().CmdCopyMemoryKHR, nullptr);
    EXPECT_EQ(without.vk().CmdBeginConditionalRendering2EXT, nullptr);
    EXPECT_EQ(without.vk().CmdCopyQueryPoolResultsToMemoryKHR, nullptr);
}

} // namespace
