// SPDX-License-Identifier: Apache-2.0
// A driver that runs out of memory, or loses the device. Whichever of its commands fails, the application learns of it
// by a result or a message, nothing leaks, and the same works once there is memory again.
#include <algorithm>
#include <functional>

#include "command_buffer/state_scene.h"
#include "gpu/copies.h"
#include "gpu/pipeline_tracer.h"
#include "harness/harness.h"
#include "harness/mock_driver.h"
#include "harness/states.h"
#include "shaders/tracer_comp.h"

namespace
{

using namespace vt;

class Failures : public GpuTest
{
protected:
    explicit Failures(const Options &options = {.quirks = "failures"}) : GpuTest(options) {}
    void TearDown() override
    {
        failAt(0);
        lose(false);
        GpuTest::TearDown();
    }

    static uint64_t failAt(uint64_t n) { return testDriverFunction<uint64_t (*)(uint64_t)>("vellumDriverFailAt")(n); }
    static void failing(uint64_t n, const std::function<void()> &call)
    {
        failAt(n);
        call();
        failAt(0);
    }
    static void lose(bool value) { testDriverFunction<void (*)(int)>("vellumDriverLose")(value); }

    // The command that failed last.
    static std::string failedCommand() { return testDriverFunction<const char *(*)()>("vellumDriverFailed")(); }

    // The layer's own messages; others are failures of the test.
    size_t validationLog()
    {
        size_t count = 0;
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            if (m.fromVellum()) {
                ++count;
                lastText_ = m.id + ": " + m.text;
            }
            // Validation layers (1.3.239) take what was rejected by vkQueueSubmit for submitted.
            if (!m.fromVellum() && failedCommand() != "vkQueueSubmit")
                ADD_FAILURE() << m.id << ": " << m.text;
        }
        return count;
    }

    // Does it again and again, with another of the driver's commands failing each time. What was made once may be kept,
    // so after a success it begins anew, until nothing of it can fail. `act` is given what lets the driver fail while a
    // function runs, says whether it seems to have worked, and leaves nothing behind.
    using WhileItFails = std::function<void(const std::function<void()> &)>;
    void failEach(const std::function<bool(const WhileItFails &)> &act)
    {
        uint64_t failed = 0;
        for (int round = 0; round < 12; ++round) {
            for (uint64_t n = 1;; ++n) {
                SCOPED_TRACE(testing::Message() << "round " << round << ", command " << n);
                uint64_t calls = 0;
                const bool works = act([&](const std::function<void()> &call) {
                    failAt(n);
                    call();
                    calls = failAt(0);
                });
                const bool reported = validationLog() > 0;
                if (calls < n) {
                    EXPECT_TRUE(works);
                    EXPECT_FALSE(reported) << lastText_;
                    if (n == 1) {
                        EXPECT_GT(failed, 0u) << "nothing of it can fail";
                        return;
                    }
                    break;
                }
                ++failed;
                EXPECT_TRUE(!works || reported || hasOtherPath_) << "not reported: the failure of " << failedCommand();
                if (works && !reported && hasOtherPath_ && isRight_) {
                    EXPECT_TRUE(isRight_()) << failedCommand();
                }
                if (HasFailure())
                    return;
            }
        }
    }

    // A command that is recorded, and then carried out.
    void failEachRecorded(const std::function<void(VkCommandBuffer)> &record)
    {
        failEach([&](const WhileItFails &whileItFails) {
            gpu().submit([&](VkCommandBuffer commands) { whileItFails([&] { record(commands); }); });
            gpu().submit([](VkCommandBuffer) {}); // findings of shaders are reported with the next submission
            return true;
        });
    }

    std::function<bool()> isRight_; // checks the created object
    std::string lastText_;          // of the layer's messages
    bool hasOtherPath_ = false; // with a fallback that is not reported: a smaller allocation, a shader for any driver
};

// Its ray flags come from a buffer, so the layer probes the driver with a ray.
TEST_F(Failures, ShaderModule)
{
    const std::vector<uint32_t> code = gpu().code(tracer_comp);
    hasOtherPath_ = true;
    failEach([&](const WhileItFails &whileItFails) {
        auto info = vkInit<VkShaderModuleCreateInfo>({.codeSize = code.size() * 4, .pCode = code.data()});
        VkShaderModule module = VK_NULL_HANDLE;
        VkResult result = VK_SUCCESS;
        whileItFails([&] { result = vkCreateShaderModule(gpu().device(), &info, nullptr, &module); });
        if (result == VK_SUCCESS)
            vkDestroyShaderModule(gpu().device(), module, nullptr);
        return result == VK_SUCCESS;
    });
}

TEST_F(Failures, RayTracingPipeline)
{
    for (const uint32_t count : {1u, 2u}) {
        hasOtherPath_ = count > 1; // objects of one call are created one by one if one fails
        const auto make = [&](Device &, const PipelineSetup &setup) {
            const PipelineInfo info(gpu(), setup);
            const std::vector<VkRayTracingPipelineCreateInfoKHR> infos(count, info.get());
            const RayPipeline first(gpu(), setup); // the driver was tried
            failEach([&](const WhileItFails &whileItFails) {
                std::vector<VkPipeline> pipelines(count, reinterpret_cast<VkPipeline>(uintptr_t{1}));
                VkResult result = VK_SUCCESS;
                whileItFails([&] {
                    result = gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE,
                                                                     count, infos.data(), nullptr, pipelines.data());
                });
                size_t made = 0;
                for (const VkPipeline pipeline : pipelines) {
                    made += pipeline != VK_NULL_HANDLE;
                    vkDestroyPipeline(gpu().device(), pipeline, nullptr);
                }
                if (result == VK_SUCCESS) {
                    EXPECT_EQ(made, count);
                }
                return result == VK_SUCCESS;
            });
            return MadePipeline{RayPipeline(gpu(), setup), {}};
        };
        const PipelineTracer tracer(gpu(), {.groups = {{.anyHit = false}, {.box = true}}, .make = make});
    }
}

TEST_F(Failures, Builds)
{
    StateScene scene(gpu());
    for (uint32_t step = 0; step < StateScene::kSteps; ++step) {
        SCOPED_TRACE(testing::Message() << "step " << step);
        failEachRecorded([&](VkCommandBuffer commands) { scene.recordStep(commands, step); });
    }
    scene.expectRight();
}

// A build or copy that is reported is not carried out by half: the structure is what it was.
TEST_F(Failures, LeaveStructuresAsTheyWere)
{
    const Patchwork patchwork(gpu());
    std::vector<Geometry> plain = patchwork.geometries();
    for (Geometry &geometry : plain) {
        geometry.micromap = {};
        geometry.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
    }
    Blas rebuilt(gpu()), source(gpu());
    rebuilt.prepare(patchwork.geometries()); // the larger one
    rebuilt.build(plain);
    const auto expectedOld = seenOf(gpu(), rebuilt);
    std::vector<std::string> expectedNew; // known after the first success
    const auto expectEither = [&](const Structure &structure, bool reported) {
        const auto now = seenOf(gpu(), structure);
        if (reported) {
            EXPECT_EQ(now, expectedOld) << lastText_;
        } else {
            EXPECT_NE(now, expectedOld);
            EXPECT_TRUE(expectedNew.empty() || now == expectedNew);
            expectedNew = now;
        }
        return !reported;
    };
    rebuilt.prepare(patchwork.geometries());
    size_t failures = 0;
    for (uint64_t n = 1;; ++n) {
        gpu().submit([&](VkCommandBuffer commands) { failing(n, [&] { rebuilt.record(commands); }); });
        if (expectEither(rebuilt, validationLog() > 0))
            break;
        ++failures;
    }
    EXPECT_GT(failures, 0u);
    source.build(patchwork.geometries());
    Structure copied(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
    copied.create(source.size());
    const Blas old(gpu(), plain);
    gpu().submit([&](VkCommandBuffer commands) {
        VkAccelerationStructureBuildGeometryInfoKHR info = old.buildInfo();
        info.dstAccelerationStructure = copied.handle();
        const VkAccelerationStructureBuildRangeInfoKHR *ranges = old.ranges();
        gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    });
    failures = 0;
    for (uint64_t n = 1;; ++n) {
        gpu().submit([&](VkCommandBuffer commands) {
            failing(n, [&] { recordCopy(gpu(), commands, source.handle(), copied.handle()); });
        });
        if (expectEither(copied, validationLog() > 0))
            break;
        ++failures;
    }
    EXPECT_GT(failures, 0u);
}

TEST_F(Failures, LeaveMicromapsAsTheyWere)
{
    Random random(5);
    MicromapInput input;
    for (const uint32_t level : {4u, 8u})
        input.add(level, kFourState, randomStates(random, level, kFourState));
    const auto expectAsBefore = [&](const Micromap &target, const std::function<void(VkCommandBuffer)> &record) {
        size_t failures = 0;
        for (uint64_t n = 1;; ++n) {
            target.forget();
            gpu().submit([&](VkCommandBuffer commands) { failing(n, [&] { record(commands); }); });
            if (validationLog() == 0)
                break;
            ++failures;
            EXPECT_EQ(std::count(target.memory(), target.memory() + target.size(), 0),
                      static_cast<ptrdiff_t>(target.size()))
                << failedCommand();
        }
        EXPECT_GT(failures, 0u);
    };
    Micromap micromap(gpu(), input, VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    expectAsBefore(micromap, [&](VkCommandBuffer commands) { micromap.record(commands); });
    const Micromap compacted(gpu(), micromap, micromap.size());
    expectAsBefore(compacted, [&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu(), commands, micromap.handle(), compacted.handle(), VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    });
}

TEST_F(Failures, CopiesOfStructures)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries());
    const Tlas top(gpu(), {instance(source, {}, 7)});
    const auto expected = seen(gpu(), top, Patchwork::rays());
    hasOtherPath_ = true;
    Structure copied(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
    copied.create(source.size());
    const auto expectedOfBottom = seenOf(gpu(), source);
    isRight_ = [&] { return seenOf(gpu(), copied) == expectedOfBottom; };
    failEachRecorded([&](VkCommandBuffer commands) { recordCopy(gpu(), commands, source.handle(), copied.handle()); });
    EXPECT_EQ(seenOf(gpu(), copied), seenOf(gpu(), source));
    Structure topCopy(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
    topCopy.create(top.size());
    isRight_ = [&] { return seen(gpu(), topCopy, Patchwork::rays()) == expected; };
    failEachRecorded([&](VkCommandBuffer commands) { recordCopy(gpu(), commands, top.handle(), topCopy.handle()); });
    EXPECT_EQ(seen(gpu(), topCopy, Patchwork::rays()), expected);
}

TEST_F(Failures, QueryPools)
{
    hasOtherPath_ = true;
    failEach([&](const WhileItFails &whileItFails) {
        auto info =
            vkInit<VkQueryPoolCreateInfo>({.queryType = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR});
        info.queryCount = 3u << 20; // more than there is memory for at first, each time
        VkQueryPool pool = VK_NULL_HANDLE;
        VkResult result = VK_SUCCESS;
        whileItFails([&] { result = vkCreateQueryPool(gpu().device(), &info, nullptr, &pool); });
        if (result == VK_SUCCESS)
            vkDestroyQueryPool(gpu().device(), pool, nullptr);
        return result == VK_SUCCESS;
    });
}

class FailuresUnvalidated : public Failures
{
protected:
    FailuresUnvalidated() : Failures({.validation = false, .quirks = "failures"}) {}
};

// Khronos' layer 1.4.363 crashes where it cannot map what is deserialized.
TEST_F(FailuresUnvalidated, Serialization)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries());
    const Buffer data(gpu(), 1u << 20,
                      VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                          VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkDeviceAddress begin = (data.address() + 255) & ~VkDeviceAddress{255};
    hasOtherPath_ = true;
    isRight_ = [&] {
        uint64_t total = 0;
        std::memcpy(&total, data.bytes() + (begin - data.address()) + 2 * VK_UUID_SIZE, 8);
        return total > 56;
    };
    failEachRecorded([&](VkCommandBuffer commands) { recordSerialize(gpu(), commands, source, begin); });
    Structure restored(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
    uint64_t deserializedSize = 0; // of the header that the specification gives
    std::memcpy(&deserializedSize, data.bytes() + (begin - data.address()) + 2 * VK_UUID_SIZE + 8, 8);
    restored.create(deserializedSize);
    const auto expected = seenOf(gpu(), source);
    isRight_ = [&] { return seenOf(gpu(), restored) == expected; };
    failEachRecorded([&](VkCommandBuffer commands) {
        auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        info.src.deviceAddress = begin;
        info.dst = restored.handle();
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        gpu().vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
    });
    EXPECT_EQ(seenOf(gpu(), restored), expected);
}

// Of another instance, which knows nothing of the device so far. The next call succeeds.
TEST_F(FailuresUnvalidated, ListOfExtensions)
{
    failAt(1);
    try {
        const Gpu other(gpu().options());
        ADD_FAILURE() << "a device without its list of extensions";
    } catch (const std::exception &error) {
        EXPECT_NE(std::string(error.what()).find("vkEnumerateDeviceExtensionProperties"), std::string::npos)
            << error.what();
    }
    EXPECT_EQ(failedCommand(), "vkEnumerateDeviceExtensionProperties");
    failAt(0);
    const Gpu other(gpu().options());
}

// Recorded work is lost with the device, and everything can be destroyed.
TEST_F(FailuresUnvalidated, DeviceLost)
{
    StateScene scene(gpu());
    VkCommandBuffer commands = gpu().begin();
    scene.record(commands);
    gpu().end(commands);
    lose(true);
    auto submission = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
    EXPECT_EQ(vkQueueSubmit(gpu().queue(), 1, &submission, VK_NULL_HANDLE), VK_ERROR_DEVICE_LOST);
    EXPECT_EQ(vkQueueWaitIdle(gpu().queue()), VK_ERROR_DEVICE_LOST);
    EXPECT_EQ(vkDeviceWaitIdle(gpu().device()), VK_ERROR_DEVICE_LOST);
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
    // A query that waits for what will never be written ends, too.
    const QueryPool pool(gpu(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR);
    uint64_t value = 0;
    EXPECT_EQ(vkGetQueryPoolResults(gpu().device(), pool, 0, 1, sizeof value, &value, sizeof value,
                                    VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
              VK_ERROR_DEVICE_LOST);
    lose(false);
    validationLog();
}

} // namespace
