// SPDX-License-Identifier: Apache-2.0
// Range barriers: the barriers that the driver gets instead, as the spy reports them; range barriers never reach it.
#include <algorithm>
#include <sstream>

#include "device_address/address_ranges.h"

namespace
{

using namespace vt;

constexpr VkPipelineStageFlags2 kMicromapBuild = VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT;

class AddressBarriers : public AddressTest
{
protected:
    explicit AddressBarriers(const Options &options = {.addressCommands = true}) : AddressTest(options) {}
    static void SetUpTestSuite() { setenv("VELLUM_TEST_SPY_BARRIERS", "1", 1); }
    static void TearDownTestSuite() { unsetenv("VELLUM_TEST_SPY_BARRIERS"); }

    static VkMemoryRangeBarrierKHR barrierOf(const VkDeviceAddressRangeKHR &range,
                                             uint32_t from = VK_QUEUE_FAMILY_IGNORED,
                                             uint32_t to = VK_QUEUE_FAMILY_IGNORED)
    {
        return vkInit<VkMemoryRangeBarrierKHR>({.srcStageMask = VK_PIPELINE_STAGE_2_COPY_BIT,
                                                .srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
                                                .dstStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
                                                .dstAccessMask = VK_ACCESS_2_SHADER_STORAGE_READ_BIT,
                                                .srcQueueFamilyIndex = from,
                                                .dstQueueFamilyIndex = to,
                                                .addressRange = range,
                                                .addressFlags = kAnyUsage});
    }
    // A dependency info with these barriers, and one memory barrier of the application's own.
    class Dependency
    {
    public:
        explicit Dependency(std::vector<VkMemoryRangeBarrierKHR> barriers) : barriers_(std::move(barriers))
        {
            own_ = vkInit<VkMemoryBarrier2>();
            own_.srcStageMask = own_.dstStageMask = VK_PIPELINE_STAGE_2_CLEAR_BIT;
            own_.srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT;
            ranges_ = vkInit<VkMemoryRangeBarriersInfoKHR>(
                {.memoryRangeBarrierCount = static_cast<uint32_t>(barriers_.size()),
                 .pMemoryRangeBarriers = barriers_.data()});
            info_ = vkInit<VkDependencyInfo>({.pNext = &ranges_, .memoryBarrierCount = 1, .pMemoryBarriers = &own_});
        }
        Dependency(const Dependency &) = delete;
        Dependency &operator=(const Dependency &) = delete;
        [[nodiscard]] const VkDependencyInfo &info() const { return info_; }
        [[nodiscard]] bool untouched() const { return info_.pNext == &ranges_ && info_.memoryBarrierCount == 1; }

    private:
        std::vector<VkMemoryRangeBarrierKHR> barriers_;
        VkMemoryBarrier2 own_{};
        VkMemoryRangeBarriersInfoKHR ranges_{};
        VkDependencyInfo info_{};
    };
    // Records, and returns what the spy reported about barriers; other messages are failures.
    std::vector<std::string> barriersIn(const std::function<void(VkCommandBuffer)> &record)
    {
        (void)gpu().takeMessages();
        gpu().submit(record);
        std::vector<std::string> barriers;
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            if (m.text.starts_with("MEMORY "))
                barriers.push_back(gpu().options().validation ? withoutHandle(m.text) : m.text);
            else
                other_.push_back(m.id);
        }
        return barriers;
    }
    std::vector<std::string> barriersIn(const Dependency &dependency)
    {
        const auto barriers =
            barriersIn([&](VkCommandBuffer commands) { vkCmdPipelineBarrier2(commands, &dependency.info()); });
        EXPECT_TRUE(dependency.untouched());
        return barriers;
    }
    void TearDown() override
    {
        (void)gpu().takeMessages(); // of barriers
        EXPECT_EQ(other_, std::vector<std::string>{});
        AddressTest::TearDown();
    }
    std::vector<std::string> takeOther() { return std::exchange(other_, {}); }

    static std::string hex(uint64_t value)
    {
        std::ostringstream text;
        text << std::hex << value;
        return text.str();
    }
    static std::string masks(VkFlags64 a, VkFlags64 b, VkFlags64 c, VkFlags64 d)
    {
        return "MEMORY " + hex(a) + ' ' + hex(b) + ' ' + hex(c) + ' ' + hex(d);
    }
    inline static const std::string kOwn =
        masks(VK_PIPELINE_STAGE_2_CLEAR_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_2_CLEAR_BIT, 0);
    inline static const std::string kRange =
        masks(VK_PIPELINE_STAGE_2_COPY_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
              VK_ACCESS_2_SHADER_STORAGE_READ_BIT);
    // The validation layer gives the spy other handles than the test has.
    std::string transfer(uint32_t from, uint32_t to, VkDeviceSize offset, VkDeviceSize size, VkBuffer buffer)
    {
        return kRange + ' ' + hex(from) + ' ' + hex(to) + ' ' + hex(offset) + ' ' + hex(size) + ' ' +
               (gpu().options().validation ? "" : hex(reinterpret_cast<uint64_t>(buffer)));
    }

    // A transfer to another queue family becomes a buffer barrier for each buffer in the range.
    void expectTransfers();

private:
    static std::string withoutHandle(const std::string &text)
    {
        const bool ofBuffer = std::count(text.begin(), text.end(), ' ') > 4;
        return ofBuffer ? text.substr(0, text.rfind(' ') + 1) : text;
    }
    std::vector<std::string> other_;
};

using Texts = std::vector<std::string>;

TEST_F(AddressBarriers, BecomeMemoryBarriers)
{
    const Buffer some = buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    EXPECT_EQ(barriersIn(Dependency({barrierOf(rangeOf(some, 16, 32))})), (Texts{kOwn, kRange}));
    EXPECT_EQ(barriersIn(Dependency({barrierOf(rangeOf(some, 0, 256), 0, 0), barrierOf({0, 0})})),
              (Texts{kOwn, kRange, kRange}));
    EXPECT_EQ(barriersIn(Dependency({})), Texts{kOwn});
}

TEST_F(AddressBarriers, MicromapStagesAndAccessesAreTranslated)
{
    const Buffer some = buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    VkMemoryRangeBarrierKHR range = barrierOf(rangeOf(some, 0, 256));
    range.srcStageMask = kMicromapBuild;
    range.srcAccessMask = VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT;
    range.dstStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
    range.dstAccessMask = VK_ACCESS_2_MICROMAP_READ_BIT_EXT;
    const std::string expected = masks(
        VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT, VK_ACCESS_2_MEMORY_WRITE_BIT,
        VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR, VK_ACCESS_2_MEMORY_READ_BIT);
    EXPECT_EQ(barriersIn(Dependency({range})), (Texts{kOwn, expected}));
}

TEST_F(AddressBarriers, BehindOtherStructures)
{
    const Buffer some = buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    const Dependency dependency({barrierOf(rangeOf(some, 16, 32))});
    // of a known size; what it says here is nothing to anybody
    auto first = vkInit<VkMemoryBarrier2>({.pNext = dependency.info().pNext});
    VkDependencyInfo info = dependency.info();
    info.pNext = &first;
    Texts barriers = barriersIn([&](VkCommandBuffer commands) { vkCmdPipelineBarrier2(commands, &info); });
    EXPECT_EQ(barriers, (Texts{kOwn, kRange}));
    EXPECT_EQ(first.pNext, dependency.info().pNext);
    (void)takeOther(); // the validation layer's message about the structure in the wrong chain
}

void AddressBarriers::expectTransfers()
{
    const Buffer some = buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    const uint32_t here = gpu().family();
    const uint32_t away = VK_QUEUE_FAMILY_EXTERNAL;
    EXPECT_EQ(barriersIn(Dependency({barrierOf(rangeOf(some, 16, 32), here, away)})),
              (Texts{kOwn, transfer(here, away, 16, 32, some.handle())}));
    EXPECT_EQ(barriersIn(Dependency({barrierOf(rangeOf(some, 16, 32), away, here)})),
              (Texts{kOwn, transfer(away, here, 16, 32, some.handle())}));
    Aliases aliases(gpu(), 64, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    Texts barriers = barriersIn(Dependency({barrierOf({aliases.address(0) + 8, 40}, here, away)}));
    Texts expected{kOwn, transfer(here, away, 8, 40, aliases.handle(0)),
                   transfer(here, away, 8, 40, aliases.handle(1))};
    std::sort(barriers.begin(), barriers.end());
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(barriers, expected);
    // If no buffer is in the range, only the memory barrier remains.
    EXPECT_EQ(barriersIn(Dependency({barrierOf({16, 32}, here, away)})), (Texts{kOwn, kRange}));
    EXPECT_EQ(takeOther(), Texts{"VELLUM-VUID-VkDeviceAddressRangeKHR-address-11365"});
}

TEST_F(AddressBarriers, QueueFamilyTransfers)
{
    expectTransfers();
}

TEST_F(AddressBarriers, DestroyedAliasesInQueueFamilyTransfers)
{
    Decoys decoys(gpu());
    const Buffer some = shadowed(decoys, 256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    const Dependency dependency({barrierOf(rangeOf(some, 0, 256), gpu().family(), VK_QUEUE_FAMILY_EXTERNAL)});
    const Texts barriers = barriersIn([&](VkCommandBuffer commands) {
        vkCmdPipelineBarrier2(commands, &dependency.info());
        decoys.destroy();
    });
    EXPECT_EQ(barriers.size(), 3u); // one of memory, one of each buffer
}

class AddressTransfers : public AddressBarriers
{
protected:
    AddressTransfers() : AddressBarriers({.validation = false, .addressCommands = true}) {}
};
TEST_F(AddressTransfers, UseTheRightBuffers)
{
    expectTransfers();
}

TEST_F(AddressBarriers, Events)
{
    const Buffer some = buffer(256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    auto create = vkInit<VkEventCreateInfo>({.flags = VK_EVENT_CREATE_DEVICE_ONLY_BIT});
    std::array<VkEvent, 2> events{};
    for (VkEvent &event : events)
        VT_CHECK(vkCreateEvent(gpu().device(), &create, nullptr, &event));
    const Dependency one({barrierOf(rangeOf(some, 16, 32))});
    const Dependency two({barrierOf(rangeOf(some, 16, 32)), barrierOf(rangeOf(some, 0, 16))});
    const Texts barriers = barriersIn([&](VkCommandBuffer commands) {
        vkCmdSetEvent2(commands, events[0], &one.info());
        vkCmdSetEvent2(commands, events[1], &two.info());
        const std::array infos{one.info(), two.info()};
        vkCmdWaitEvents2(commands, 2, events.data(), infos.data());
    });
    EXPECT_EQ(barriers, (Texts{kOwn, kRange, kOwn, kRange, kRange, kOwn, kRange, kOwn, kRange, kRange}));
    for (const VkEvent event : events)
        vkDestroyEvent(gpu().device(), event, nullptr);
}

// The bytes come through.
TEST_F(AddressBarriers, OrderCopies)
{
    const Buffer first = randomBuffer(256, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    const Buffer middle = buffer(256, VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const Buffer last = buffer(256, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    VkMemoryRangeBarrierKHR range = barrierOf(rangeOf(middle, 0, 256));
    range.dstStageMask = VK_PIPELINE_STAGE_2_COPY_BIT;
    range.dstAccessMask = VK_ACCESS_2_TRANSFER_READ_BIT;
    const Dependency dependency({range});
    const auto copy = [&](VkCommandBuffer commands, const Buffer &from, const Buffer &to) {
        auto region =
            vkInit<VkDeviceMemoryCopyKHR>({.srcRange = rangeOf(from, 0, 256), .dstRange = rangeOf(to, 0, 256)});
        region.srcFlags = region.dstFlags = kAnyUsage;
        const auto info = vkInit<VkCopyDeviceMemoryInfoKHR>({.regionCount = 1, .pRegions = &region});
        gpu().vk().CmdCopyMemoryKHR(commands, &info);
    };
    (void)barriersIn([&](VkCommandBuffer commands) {
        copy(commands, first, middle);
        vkCmdPipelineBarrier2(commands, &dependency.info());
        copy(commands, middle, last);
    });
    EXPECT_EQ(bytesOf(last), bytesOf(first));
}

} // namespace
