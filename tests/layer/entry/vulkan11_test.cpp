// SPDX-License-Identifier: Apache-2.0
// A program of Vulkan 1.1, the oldest version with emulation. Validation, below the layer, reports shaders and commands
// of the layer that are newer than the instance, or that need features which the program has not enabled.
#include <cstdlib>

#include "command_buffer/state_scene.h"
#include "device_address/address_ranges.h"
#include "pipelines/pipeline_scene.h"

namespace
{

using namespace vt;

class Vulkan11 : public testing::Test
{
protected:
    explicit Vulkan11(const Options &options = {})
    {
        setenv("VELLUM_TEST_VULKAN", "1.1", 1);
        gpu_.emplace(options);
    }
    ~Vulkan11() override
    {
        gpu_.reset();
        unsetenv("VELLUM_TEST_VULKAN");
    }
    void TearDown() override
    {
        for (const Message &message : gpu_->takeUnexpectedMessages())
            ADD_FAILURE() << message.id << ": " << message.text;
    }
    Gpu &gpu() { return *gpu_; }

private:
    std::optional<Gpu> gpu_;
};

TEST_F(Vulkan11, BuildsAndRayQueries)
{
    StateScene scene(gpu());
    gpu().submit([&](VkCommandBuffer commands) { scene.record(commands); });
    scene.expectRight();
}

// The general build, which uses every pass but those of lossy builds.
TEST_F(Vulkan11, CompactedMicromaps)
{
    MicromapInput input;
    for (uint8_t state = 0; state < 4; ++state)
        input.add(5, kFourState, std::vector<uint8_t>(1024, state));
    Micromap micromap(gpu(), input, VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    micromap.build();
    Geometry geometry{.vertices = triangleRow(4)};
    geometry.micromap = Attachment{&micromap};
    const Blas blas(gpu(), {geometry});
    Tlas tlas(gpu());
    tlas.build(std::vector{instance(blas, {}, 321)});
    Tracer tracer(gpu());
    StateScene::expectRight(tracer.trace(tlas, StateScene::rays()));
}

TEST_F(Vulkan11, Pipelines)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    const PipelineScene scene(gpu());
    for (const bool anyHit : {true, false}) {
        PipelineTracerSetup setup;
        setup.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}};
        PipelineTracer tracer(gpu(), setup);
        for (const uint32_t flags : opacityRayFlags())
            scene.expect(tracer, flags, {.triangleAnyHit = anyHit, .boxAnyHit = anyHit});
    }
}

class Vulkan11Addresses : public Vulkan11
{
protected:
    Vulkan11Addresses() : Vulkan11({.addressCommands = true}) {}
};

// VK_KHR_device_address_commands does not require VK_KHR_copy_commands2.
TEST_F(Vulkan11Addresses, ImageCopies)
{
    const VkDevice device = gpu().device();
    auto imageInfo =
        vkInit<VkImageCreateInfo>({.imageType = VK_IMAGE_TYPE_2D,
                                   .format = VK_FORMAT_R32_UINT,
                                   .extent = {8, 4, 1},
                                   .mipLevels = 1,
                                   .arrayLayers = 1,
                                   .samples = VK_SAMPLE_COUNT_1_BIT,
                                   .usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT});
    VkImage image = VK_NULL_HANDLE;
    VT_CHECK(vkCreateImage(device, &imageInfo, nullptr, &image));
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(device, image, &needs);
    const VkDeviceMemory memory = gpu().allocate(needs, 0);
    VT_CHECK(vkBindImageMemory(device, image, memory, 0));

    const Buffer from(gpu(), 128, VK_BUFFER_USAGE_TRANSFER_SRC_BIT | kAddressed);
    const Buffer to(gpu(), 256, VK_BUFFER_USAGE_TRANSFER_DST_BIT | kAddressed);
    for (size_t i = 0; i < 32; ++i)
        from.as<uint32_t>()[i] = static_cast<uint32_t>(i * i);
    auto region = vkInit<VkDeviceMemoryImageCopyKHR>({.addressRange = rangeOf(from, 0, 128),
                                                      .addressFlags = kAnyUsage,
                                                      .imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                                                      .imageLayout = VK_IMAGE_LAYOUT_GENERAL,
                                                      .imageExtent = {8, 4, 1}});
    auto back = region;
    back.addressRange = rangeOf(to, 64, 128);
    auto barrier = vkInit<VkImageMemoryBarrier>({.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                                                 .newLayout = VK_IMAGE_LAYOUT_GENERAL,
                                                 .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                 .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                 .image = image,
                                                 .subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1}});
    gpu().submit([&](VkCommandBuffer commands) {
        const auto transfers = [&] {
            vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0,
                                 nullptr, 0, nullptr, 1, &barrier);
        };
        transfers();
        auto info = vkInit<VkCopyDeviceMemoryImageInfoKHR>({.image = image, .regionCount = 1, .pRegions = &region});
        gpu().vk().CmdCopyMemoryToImageKHR(commands, &info);
        barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
        barrier.dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
        barrier.oldLayout = VK_IMAGE_LAYOUT_GENERAL;
        transfers();
        info.pRegions = &back;
        gpu().vk().CmdCopyImageToMemoryKHR(commands, &info);
    });
    EXPECT_EQ(std::memcmp(to.bytes() + 64, from.bytes(), 128), 0);
    vkDestroyImage(device, image, nullptr);
    vkFreeMemory(device, memory, nullptr);
}

} // namespace
