// SPDX-License-Identifier: Apache-2.0
// The setting `validate`: wrong input that only the device sees is reported, once, with the triangle's number.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <thread>

#include "harness/states.h"

namespace
{

using namespace vt;

class Validate : public GpuTest
{
protected:
    Validate() : GpuTest(Options{.validate = true}) {}

    // 600 triangles of level 4.
    static MicromapInput good()
    {
        MicromapInput input;
        Random random(3);
        for (int i = 0; i < 600; ++i)
            input.add(4, kFourState, randomStates(random, 4, kFourState));
        input.declared = input.usage();
        return input;
    }
    // The messages of the layer, as "id|text".
    std::vector<std::string> messages()
    {
        std::vector<std::string> out;
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            EXPECT_TRUE(m.fromVellum()) << m.id << ": " << m.text;
            out.push_back(m.id + "|" + m.text);
        }
        return out;
    }
    static size_t count(const std::vector<std::string> &messages, const std::string &part)
    {
        return static_cast<size_t>(std::count_if(
            messages.begin(), messages.end(), [&](const std::string &m) { return m.find(part) != std::string::npos; }));
    }
    // Builds once, and finds each of the expected parts in exactly one message about that triangle.
    void expectReported(const MicromapInput &input, VkBuildMicromapFlagsEXT flags,
                        const std::vector<std::pair<uint32_t, std::string>> &expected)
    {
        SCOPED_TRACE(testing::Message() << "flags " << flags);
        Micromap micromap(gpu(), input, flags);
        micromap.build();
        const std::vector<std::string> reported = messages();
        for (const auto &[triangle, part] : expected) {
            const std::string where = "]: triangle " + std::to_string(triangle) + ": ";
            EXPECT_EQ(count(reported, where), 1u) << where;
            for (const std::string &m : reported) {
                if (m.find(where) != std::string::npos) {
                    EXPECT_NE(m.find(part), std::string::npos) << m;
                }
            }
        }
        EXPECT_EQ(count(reported, "]: triangle "), expected.size());
        // No finding is reported twice.
        VT_CHECK(vkDeviceWaitIdle(gpu().device()));
        EXPECT_TRUE(messages().empty());
    }
    static constexpr std::array<VkBuildMicromapFlagsEXT, 3> kFlags{0, VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT,
                                                                   VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT};
};

TEST_F(Validate, GoodInputIsFine)
{
    for (const VkBuildMicromapFlagsEXT flags : kFlags)
        expectReported(good(), flags, {});
    EXPECT_TRUE(messages().empty());
}

TEST_F(Validate, EveryKindOfWrongTriangle)
{
    MicromapInput input = good();
    input.triangles[1].subdivisionLevel = 13;
    input.triangles[2].subdivisionLevel = 0xffff;
    input.triangles[3].format = 0;
    input.triangles[4].format = 3;
    input.triangles[5].dataOffset = 0xfffffff0;
    input.triangles[6] = {0, 13, kTwoState};
    input.triangles[257].dataOffset = 1 << 28;
    input.triangles[599].subdivisionLevel = 9;
    const std::vector<std::pair<uint32_t, std::string>> expected{
        {1, gpu().khr() ? "VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11566"
                        : "VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11660"},
        {2, "level 65535"},
        {3, gpu().khr() ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11555"
                        : "VUID-VkMicromapBuildInfoEXT-format-11657"},
        {4, "format 3"},
        {5, "offset 4294967280"},
        {6, gpu().khr() ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11556"
                        : "VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11659"},
        {257, gpu().khr() ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11553" : "VELLUM-micromap-data"},
        {599, "VELLUM-micromap-usage-counts"},
    };
    for (const VkBuildMicromapFlagsEXT flags : kFlags)
        expectReported(input, flags, expected);
}

TEST_F(Validate, CountsThatDoNotMatch)
{
    const char *reported = "VELLUM-micromap-usage-counts|";
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        MicromapInput input = good();
        input.declared = {{599, 4, kFourState}, {1, 3, kFourState}};
        Micromap fewer(gpu(), input, flags);
        fewer.build();
        const std::vector<std::string> text = messages();
        EXPECT_EQ(text.size(), 1u);
        EXPECT_EQ(count(text, "the usage counts state 1 4-state triangles of level 3, the triangle array has 0"), 1u);
        input.declared = {{598, 4, kFourState}, {1, 6, kFourState}, {1, 3, kFourState}};
        for (size_t i : {10u, 20u, 30u}) // 3 of level 6, where the capacity is for less than two
            input.triangles[i] = {0, 6, kFourState};
        Micromap more(gpu(), input, flags);
        more.build();
        EXPECT_EQ(count(messages(), reported), 1u);
        // The same data at an address at which it cannot be read in place.
        input.data.insert(input.data.begin(), 8, 0);
        for (VkMicromapTriangleEXT &t : input.triangles)
            t.dataOffset += 8;
        Micromap unaligned(gpu(), input, flags);
        unaligned.build();
        EXPECT_EQ(count(messages(), reported), 1u);
    }
}

TEST_F(Validate, ATriangleArrayThatIsTooShort)
{
    MicromapInput input;
    input.add(3, kFourState, std::vector<uint8_t>(64, 1));
    input.declared = {{5000, 3, kFourState}};
    Micromap micromap(gpu(), std::move(input), 0);
    micromap.build();
    const std::vector<std::string> reported = messages();
    EXPECT_EQ(reported.size(), 1u);
    EXPECT_EQ(count(reported, gpu().khr() ? "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11554|"
                                          : "VELLUM-micromap-triangle-array|"),
              1u);
}

TEST_F(Validate, MoreFindingsThanTheLogHolds)
{
    MicromapInput input;
    for (uint32_t i = 0; i < 5000; ++i)
        input.triangles.push_back({0, 3, 9});
    input.data.resize(16);
    input.declared = {{5000, 3, kFourState}};
    Micromap micromap(gpu(), std::move(input), 0);
    micromap.build();
    const std::vector<std::string> reported = messages();
    EXPECT_EQ(count(reported, "VELLUM-validation-log"), 1u);
    EXPECT_EQ(count(reported, "format 9"), 4096u);
    // Once the device is idle, the log is empty again.
    VT_CHECK(vkDeviceWaitIdle(gpu().device()));
    MicromapInput again = good();
    again.triangles[77].format = 9;
    expectReported(again, 0, {{77, "format 9"}});
}

TEST_F(Validate, MessagesNameTheMicromap)
{
    MicromapInput input = good();
    input.triangles[8].format = 5;
    Micromap micromap(gpu(), std::move(input), 0);
    const auto name = reinterpret_cast<PFN_vkSetDebugUtilsObjectNameEXT>(
        vkGetInstanceProcAddr(gpu().instance(), "vkSetDebugUtilsObjectNameEXT"));
    auto info = vkInit<VkDebugUtilsObjectNameInfoEXT>({.objectType = micromap.handle().objectType(),
                                                       .objectHandle = micromap.handle().object(),
                                                       .pObjectName = "the leaves"});
    VT_CHECK(name(gpu().device(), &info));
    micromap.build();
    const std::vector<Message> reported = gpu().takeUnexpectedMessages();
    ASSERT_EQ(reported.size(), 1u);
    EXPECT_EQ(reported[0].object, "the leaves");
}

// Findings of a BLAS build: triangles whose index exceeds the triangles of the micromap.
TEST_F(Validate, IndicesPastTheMicromap)
{
    Micromap micromap(gpu(), good(), 0);
    micromap.build();
    Geometry geometry{.vertices = triangleRow(6)};
    geometry.micromap = Attachment{&micromap, VK_INDEX_TYPE_UINT32, {0, 598, 599, -3, 600, 1 << 30}};
    geometry.micromap->base = 1;
    const Blas blas(gpu(), {geometry});
    const std::vector<std::string> reported = messages();
    const std::string rest = " plus baseTriangle is outside the 600 triangles of micromap ";
    const std::string id =
        gpu().khr() ? "VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11575" : "VELLUM-micromap-index";
    EXPECT_EQ(reported.size(), 3u);
    EXPECT_EQ(count(reported, id), 3u);
    EXPECT_EQ(count(reported, "pInfos[0].pGeometries[0]: triangle 2: index 599" + rest), 1u);
    EXPECT_EQ(count(reported, "pInfos[0].pGeometries[0]: triangle 4: index 600" + rest), 1u);
    EXPECT_EQ(count(reported, "pInfos[0].pGeometries[0]: triangle 5: index 1073741824" + rest), 1u);
    VT_CHECK(vkDeviceWaitIdle(gpu().device()));
    EXPECT_TRUE(messages().empty());
    // Without indices, the triangle's number is the index.
    geometry.micromap = Attachment{.micromap = &micromap, .base = 597};
    const Blas unindexed(gpu(), {geometry});
    const std::vector<std::string> numbers = messages();
    EXPECT_EQ(numbers.size(), 3u);
    EXPECT_EQ(count(numbers, gpu().khr() ? "geometry-11576|" : "VELLUM-micromap-index|"), 3u);
    EXPECT_EQ(count(numbers, "]: triangle 3: its number" + rest), 1u);
}

// Findings of a BLAS build: triangles whose index lies beyond the end of the index buffer.
TEST_F(Validate, IndexBufferTooShort)
{
    Micromap micromap(gpu(), good(), 0);
    micromap.build();
    // The test's buffer ends a few hundred bytes, which say another index, behind the indices.
    constexpr uint32_t indices = 900, triangles = 2000;
    Geometry geometry{.vertices = triangleRow(triangles)};
    geometry.micromap = Attachment{&micromap, VK_INDEX_TYPE_UINT16, std::vector<int32_t>(indices, 5)};
    const Blas blas(gpu(), {geometry});
    const std::vector<std::string> reported = messages();
    // Indices between these and the end of the buffer may be wrong.
    EXPECT_EQ(count(reported, gpu().khr() ? "VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11577"
                                          : ": its index is outside the buffer of indexBuffer, like those after it"),
              1u);
}

// Findings are reported by each command through which the host learns that work is complete.
TEST_F(Validate, FencesAndSemaphores)
{
    MicromapInput input = good();
    input.triangles[8].format = 5;
    Micromap micromap(gpu(), std::move(input), 0);
    auto create = vkInit<VkFenceCreateInfo>();
    VkFence fence = VK_NULL_HANDLE;
    VT_CHECK(vkCreateFence(gpu().device(), &create, nullptr, &fence));
    VkCommandBuffer commands = gpu().begin(0);
    micromap.record(commands);
    gpu().end(commands);
    auto submit = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
    for (const bool poll : {false, true}) {
        VT_CHECK(vkQueueSubmit(gpu().queue(), 1, &submit, fence));
        if (poll) {
            while (vkGetFenceStatus(gpu().device(), fence) == VK_NOT_READY)
                ;
        } else {
            VT_CHECK(vkWaitForFences(gpu().device(), 1, &fence, VK_TRUE, UINT64_MAX));
        }
        EXPECT_EQ(count(messages(), "]: triangle 8: format 5"), 1u);
        VT_CHECK(vkResetFences(gpu().device(), 1, &fence));
    }
    vkDestroyFence(gpu().device(), fence, nullptr);
}

// A messenger that takes its time, on one thread; on another one, the application polls a fence.
TEST_F(Validate, PollsDoNotWaitForMessages)
{
    struct State {
        std::promise<void> called, polled;
        std::atomic<bool> first = true;
        bool inTime = false;
    } state;
    auto info =
        vkInit<VkDebugUtilsMessengerCreateInfoEXT>({.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
                                                    .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT,
                                                    .pUserData = &state});
    info.pfnUserCallback = [](auto, auto, auto, void *user) -> VkBool32 {
        auto &s = *static_cast<State *>(user);
        if (s.first.exchange(false)) {
            s.called.set_value();
            s.inTime = s.polled.get_future().wait_for(std::chrono::seconds(20)) == std::future_status::ready;
        }
        return VK_FALSE;
    };
    VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
    VT_CHECK(gpu().vk().CreateDebugUtilsMessengerEXT(gpu().instance(), &info, nullptr, &messenger));
    const auto fenceInfo = vkInit<VkFenceCreateInfo>();
    VkFence fence = VK_NULL_HANDLE;
    VT_CHECK(vkCreateFence(gpu().device(), &fenceInfo, nullptr, &fence));
    std::thread poller([&] {
        state.called.get_future().wait();
        EXPECT_EQ(vkGetFenceStatus(gpu().device(), fence), VK_NOT_READY);
        state.polled.set_value();
    });
    MicromapInput input = good();
    input.triangles[7].format = 9;
    Micromap micromap(gpu(), input, 0);
    micromap.build();
    poller.join();
    EXPECT_TRUE(state.inTime);
    EXPECT_FALSE(messages().empty());
    vkDestroyFence(gpu().device(), fence, nullptr);
    gpu().vk().DestroyDebugUtilsMessengerEXT(gpu().instance(), messenger, nullptr);
}

} // namespace
