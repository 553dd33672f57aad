// SPDX-License-Identifier: Apache-2.0
// Transform feedback of VK_KHR_device_address_commands: the same captured bytes, counters and draws as from the
// commands that take buffers, and wrong ranges rejected.
#include "device_address/address_graphics.h"

namespace
{

using namespace vt;

constexpr VkBufferUsageFlags kCaptured = VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_BUFFER_BIT_EXT;
constexpr VkBufferUsageFlags kCounter =
    VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_COUNTER_BUFFER_BIT_EXT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
constexpr VkDeviceSize kOffset = 16, kCounterOffset = 20;

class AddressFeedback : public AddressGraphicsTest
{
protected:
    explicit AddressFeedback(const Options &options = {.addressCommands = true}) : AddressGraphicsTest(options) {}
    void SetUp() override
    {
        AddressGraphicsTest::SetUp();
        if (!gpu().has(VK_EXT_TRANSFORM_FEEDBACK_EXTENSION_NAME))
            GTEST_SKIP() << "no transform feedback";
        pipeline_ = graphics().pipeline(AddressGraphics::Kind::Feedback);
    }

    static VkBindTransformFeedbackBuffer2InfoEXT info(const VkDeviceAddressRangeKHR &range)
    {
        return vkInit<VkBindTransformFeedbackBuffer2InfoEXT>({.addressRange = range, .addressFlags = kAnyUsage});
    }
    void bind(VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range)
    {
        const auto binding = info(range);
        gpu().vk().CmdBindTransformFeedbackBuffers2EXT(commands, 0, 1, &binding);
    }
    void begin(VkCommandBuffer commands, const VkDeviceAddressRangeKHR &counter)
    {
        const auto binding = info(counter);
        gpu().vk().CmdBeginTransformFeedback2EXT(commands, 0, 1, &binding);
    }
    void end(VkCommandBuffer commands, const VkDeviceAddressRangeKHR &counter)
    {
        const auto binding = info(counter);
        gpu().vk().CmdEndTransformFeedback2EXT(commands, 0, 1, &binding);
    }
    // A render in which transform feedback is used, by either kind of commands.
    void render(const std::function<void(VkCommandBuffer)> &record)
    {
        (void)graphics().render(pipeline_, [&](VkCommandBuffer commands) {
            bindVertices(commands);
            record(commands);
        });
    }
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

TEST_F(AddressFeedback, CapturesCountsAndGoesOn)
{
    const Buffer captured = buffer(256, kCaptured), counters = buffer(64, kCounter);
    const Buffer twin = buffer(256, kCaptured), twinCounters = buffer(64, kCounter);
    const auto &vk = gpu().vk();
    // Three points, then one more behind them; the second time with no array of counters at the end.
    render([&](VkCommandBuffer commands) {
        bind(commands, rangeOf(captured, kOffset, 128));
        begin(commands, {0, 0}); // from the start
        vkCmdDraw(commands, 3, 1, 4, 0);
        end(commands, rangeOf(counters, kCounterOffset, 4));
    });
    render([&](VkCommandBuffer commands) {
        bind(commands, rangeOf(captured, kOffset, 128));
        begin(commands, rangeOf(counters, kCounterOffset, 4));
        vkCmdDraw(commands, 1, 1, 9, 0);
        vk.CmdEndTransformFeedback2EXT(commands, 0, 0, nullptr);
    });
    const VkDeviceSize size = 128;
    const VkBuffer none = VK_NULL_HANDLE, counter = twinCounters.handle(), target = twin.handle();
    const VkDeviceSize zero = 0;
    render([&](VkCommandBuffer commands) {
        vk.CmdBindTransformFeedbackBuffersEXT(commands, 0, 1, &target, &kOffset, &size);
        vk.CmdBeginTransformFeedbackEXT(commands, 0, 1, &none, &zero);
        vkCmdDraw(commands, 3, 1, 4, 0);
        vk.CmdEndTransformFeedbackEXT(commands, 0, 1, &counter, &kCounterOffset);
    });
    render([&](VkCommandBuffer commands) {
        vk.CmdBindTransformFeedbackBuffersEXT(commands, 0, 1, &target, &kOffset, &size);
        vk.CmdBeginTransformFeedbackEXT(commands, 0, 1, &counter, &kCounterOffset);
        vkCmdDraw(commands, 1, 1, 9, 0);
        vk.CmdEndTransformFeedbackEXT(commands, 0, 0, nullptr, nullptr);
    });
    EXPECT_EQ(bytesOf(captured), bytesOf(twin));
    EXPECT_EQ(bytesOf(counters), bytesOf(twinCounters));
    EXPECT_EQ(captured.as<uint32_t>()[4], xs().as<uint32_t>()[4]);
    EXPECT_EQ(captured.as<uint32_t>()[4 + 6], xs().as<uint32_t>()[9]);
    EXPECT_EQ(counters.as<uint32_t>()[5], 24u);

    const VkPipeline plain = graphics().pipeline(AddressGraphics::Kind::StaticStrides);
    const auto byCount = info(rangeOf(counters, kCounterOffset, 4));
    expectSame(
        plain, [&](VkCommandBuffer commands) { vk.CmdDrawIndirectByteCount2EXT(commands, 2, 1, &byCount, 4, 8); },
        [&](VkCommandBuffer commands) {
            vk.CmdDrawIndirectByteCountEXT(commands, 2, 1, twinCounters.handle(), kCounterOffset, 4, 8);
        });
}

TEST_F(AddressFeedback, DestroyedAliases)
{
    Decoys decoys(gpu());
    const Buffer captured = shadowed(decoys, 256, kCaptured), counters = shadowed(decoys, 64, kCounter);
    render([&](VkCommandBuffer commands) {
        bind(commands, rangeOf(captured, kOffset, 128));
        begin(commands, {0, 0});
        vkCmdDraw(commands, 3, 1, 4, 0);
        end(commands, rangeOf(counters, kCounterOffset, 4));
        decoys.destroy();
    });
    EXPECT_EQ(captured.as<uint32_t>()[4], xs().as<uint32_t>()[4]);
    EXPECT_EQ(counters.as<uint32_t>()[5], 24u);
}

// Bytes of the buffer beyond the range are not captured.
TEST_F(AddressFeedback, EndsWithTheRange)
{
    const Buffer captured = buffer(256, kCaptured);
    render([&](VkCommandBuffer commands) {
        bind(commands, rangeOf(captured, kOffset, 16));
        gpu().vk().CmdBeginTransformFeedback2EXT(commands, 0, 0, nullptr);
        vkCmdDraw(commands, 5, 1, 1, 0);
        gpu().vk().CmdEndTransformFeedback2EXT(commands, 0, 0, nullptr);
    });
    const auto words = captured.as<uint32_t>();
    EXPECT_EQ(words[6], xs().as<uint32_t>()[2]);
    EXPECT_EQ(words[8], 0u);
    EXPECT_EQ(words[9], 0u);
}

TEST_F(AddressFeedback, RejectsWrongRanges)
{
    const Buffer captured = buffer(256, kCaptured), counters = buffer(256, kCounter);
    const Buffer other = buffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    expectBadRangesRejected(
        captured, other, "VkDeviceAddressRangeKHR", "vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13091",
        [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) { bind(commands, range); }, false);
    const auto byCount = [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
        const auto counter = info(range);
        gpu().vk().CmdDrawIndirectByteCount2EXT(commands, 1, 0, &counter, 0, 4);
    };
    expectBadRangesRejected(counters, other, "VkDeviceAddressRangeKHR", "vkCmdDrawIndirectByteCount2EXT-pInfo-13061",
                            byCount, false);
    gpu().submit([&](VkCommandBuffer commands) { byCount(commands, rangeOf(counters, 253, 3)); });
    const std::vector<Message> ofCounter = gpu().takeUnexpectedMessages();
    ASSERT_EQ(ofCounter.size(), 1u);
    EXPECT_EQ(ofCounter[0].id, "VELLUM-counter-range");
    // A beginning that is rejected has no end either; an end that is wrong ends, without counters.
    const auto inRender = [&](const std::string &rule, const VkDeviceAddressRangeKHR &first,
                              const VkDeviceAddressRangeKHR &last, bool captures) {
        std::memset(captured.bytes(), 0, 256);
        render([&](VkCommandBuffer commands) {
            bind(commands, rangeOf(captured, kOffset, 128));
            begin(commands, first);
            vkCmdDraw(commands, 3, 1, 4, 0);
            end(commands, last);
            begin(commands, {0, 0}); // and it can be begun again
            end(commands, {0, 0});
        });
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        ASSERT_EQ(messages.size(), 1u);
        EXPECT_EQ(messages[0].id, "VELLUM-VUID-" + rule);
        EXPECT_EQ(captured.as<uint32_t>()[4], captures ? xs().as<uint32_t>()[4] : 0);
    };
    const std::string beginning = "vkCmdBeginTransformFeedback2EXT-pCounterInfos-";
    const std::string ending = "vkCmdEndTransformFeedback2EXT-pCounterInfos-";
    inRender("VkDeviceAddressRangeKHR-address-11365", {16, 4}, {0, 0}, false);
    inRender("VkDeviceAddressRangeKHR-size-11411", {0, 4}, {0, 0}, false);
    inRender(beginning + "13093", rangeOf(counters, 253, 3), {0, 0}, false);
    if (strictTests())
        inRender(beginning + "13094", rangeOf(other, 0, 4), {0, 0}, false);
    inRender("VkDeviceAddressRangeKHR-address-11365", {0, 0}, {16, 4}, true);
    inRender(ending + "13095", {0, 0}, rangeOf(counters, 253, 3), true);
    if (strictTests())
        inRender(ending + "13096", {0, 0}, rangeOf(other, 0, 4), true);
}

// Drivers accept this; the validation layer below would report it.
class AddressFeedbackHarmless : public AddressFeedback
{
protected:
    AddressFeedbackHarmless() : AddressFeedback({.validation = false, .addressCommands = true}) {}
};

TEST_F(AddressFeedbackHarmless, UsageAndSizes)
{
    const Buffer captured = buffer(256, kCaptured), counters = buffer(256, kCounter);
    const Buffer other = buffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    const auto rendered = [&](const std::string &rule, const Buffer &into, const VkDeviceAddressRangeKHR &range,
                              const VkDeviceAddressRangeKHR &first, const VkDeviceAddressRangeKHR &last) {
        SCOPED_TRACE(rule);
        std::memset(into.bytes(), 0, 256);
        render([&](VkCommandBuffer commands) {
            bind(commands, rangeOf(captured, 0, 256));
            bind(commands, range);
            begin(commands, first);
            vkCmdDraw(commands, 3, 1, 4, 0);
            end(commands, last);
        });
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        ASSERT_EQ(messages.size(), 1u);
        EXPECT_EQ(messages[0].id, "VELLUM-VUID-" + rule);
        EXPECT_EQ(into.as<uint32_t>()[8], strictTests() ? 0 : xs().as<uint32_t>()[6]);
    };
    rendered("vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13091", other, rangeOf(other, kOffset, 64), {0, 0},
             {0, 0});
    rendered("VkDeviceAddressRangeKHR-address-11365", captured, rangeOf(captured, kOffset, 4096), {0, 0}, {0, 0});
    const VkDeviceAddressRangeKHR good = rangeOf(captured, kOffset, 64);
    rendered("vkCmdBeginTransformFeedback2EXT-pCounterInfos-13093", captured, good, rangeOf(counters, 0, 3), {0, 0});
    rendered("vkCmdBeginTransformFeedback2EXT-pCounterInfos-13094", captured, good, rangeOf(other, 200, 4), {0, 0});
}

} // namespace
