// SPDX-License-Identifier: Apache-2.0
// Handles that are smaller than any micromap, as of applications that ignore the messages of size queries, and smaller
// than the micromap in their memory: nothing beyond their size is read or written, by either API.
#include "check/oracle/outcome.h"
#include "harness/harness.h"
#include "harness/states.h"

namespace
{

using namespace vt;

class MicromapSize : public testing::TestWithParam<Api>
{
protected:
    MicromapSize() : gpu_(Options{.api = GetParam()}) {}
    void TearDown() override { expectNoMessages(); }
    Gpu &gpu() { return gpu_; }
    [[nodiscard]] bool khr() const { return gpu_.khr(); }

    void expectNoMessages()
    {
        for (const Message &m : gpu_.takeUnexpectedMessages())
            ADD_FAILURE() << m.id << ": " << m.text;
    }
    void expectMessage(const std::string &id)
    {
        const std::vector<Message> messages = gpu_.takeUnexpectedMessages();
        EXPECT_EQ(messages.size(), 1u) << id;
        for (const Message &m : messages)
            EXPECT_EQ(m.id, id) << m.text;
    }
    // Four transparent triangles of level 4.
    static MicromapInput transparent()
    {
        MicromapInput input;
        for (int i = 0; i < 4; ++i)
            input.add(4, kFourState, std::vector<uint8_t>(256, 0));
        return input;
    }
    // Makes its memory say that it is that micromap, as far as it goes.
    static void alias(const Micromap &target, const Micromap &built)
    {
        std::memcpy(const_cast<uint8_t *>(target.memory()), built.memory(),
                    static_cast<size_t>(std::min(target.size(), built.size())));
    }
    void copy(const Micromap &from, const Micromap &to)
    {
        auto ext = vkInit<VkCopyMicromapInfoEXT>(
            {.src = from.handle().ext, .dst = to.handle().ext, .mode = VK_COPY_MICROMAP_MODE_COMPACT_EXT});
        auto info =
            vkInit<VkCopyAccelerationStructureInfoKHR>({.src = from.handle().khr,
                                                        .dst = to.handle().khr,
                                                        .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR});
        gpu_.submit([&](VkCommandBuffer commands) {
            if (khr())
                gpu_.vk().CmdCopyAccelerationStructureKHR(commands, &info);
            else
                gpu_.vk().CmdCopyMicromapEXT(commands, &ext);
        });
    }
    void save(const Micromap &from, VkDeviceAddress to)
    {
        auto ext = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = from.handle().ext});
        ext.dst.deviceAddress = to;
        ext.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
        auto info = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>({.src = from.handle().khr});
        info.dst.deviceAddress = to;
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
        gpu_.submit([&](VkCommandBuffer commands) {
            if (khr())
                gpu_.vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &info);
            else
                gpu_.vk().CmdCopyMicromapToMemoryEXT(commands, &ext);
        });
    }
    void restore(VkDeviceAddress from, const Micromap &to)
    {
        auto ext = vkInit<VkCopyMemoryToMicromapInfoEXT>();
        ext.src.deviceAddress = from;
        ext.dst = to.handle().ext;
        ext.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
        auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        info.src.deviceAddress = from;
        info.dst = to.handle().khr;
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        gpu_.submit([&](VkCommandBuffer commands) {
            if (khr())
                gpu_.vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
            else
                gpu_.vk().CmdCopyMemoryToMicromapEXT(commands, &ext);
        });
    }
    VkDeviceSize compactedSize(const Micromap &micromap)
    {
        return queryMicromap(gpu_, micromap.handle(), VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT);
    }
    // Candidates at the centres of four triangles with the micromap.
    std::vector<uint32_t> candidates(const Micromap &micromap)
    {
        Geometry geometry{.vertices = triangleRow(4)};
        geometry.micromap = Attachment{&micromap};
        const Blas blas(gpu_, {geometry});
        const Tlas tlas(gpu_, {instance(blas, {}, 1)});
        std::vector<Ray> rays(4);
        for (size_t i = 0; i < rays.size(); ++i)
            rays[i].origin = {1.5f * static_cast<float>(i) + 0.3f, 0.3f, 1};
        std::vector<uint32_t> out;
        for (const Result &r : Tracer(gpu_).trace(tlas, rays))
            out.push_back(r.candidateCount);
        return out;
    }
    static inline const std::vector<uint32_t> kUnknown{1, 1, 1, 1};

private:
    Gpu gpu_;
};

// Guard bytes around each are looked at when it goes.
TEST_P(MicromapSize, SmallerThanAnyMicromap)
{
    Micromap source(gpu(), transparent());
    source.build();
    const Buffer memory(gpu(), 65536, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    ASSERT_EQ(memory.address() % 256, 0u);
    for (const VkDeviceSize size : {0u, 1u, 4u, 12u, 60u}) {
        SCOPED_TRACE(testing::Message() << size << " bytes");
        if (size == 0 && khr())
            continue; // not created: VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11608
        const Micromap tiny(gpu(), source, size);
        const Micromap other(gpu(), source, source.size());
        alias(tiny, source);
        copy(source, tiny);
        expectMessage("VELLUM-micromap-copy-size");
        copy(tiny, other);
        expectMessage("VELLUM-micromap-not-constructed");
        save(source, memory.address());
        expectNoMessages();
        restore(memory.address(), tiny);
        expectMessage("VELLUM-micromap-copy-size");
        save(tiny, memory.address() + 32768);
        expectMessage("VELLUM-micromap-not-constructed");
        EXPECT_LE(compactedSize(tiny), 64u);
        EXPECT_EQ(candidates(tiny), kUnknown);
        EXPECT_EQ(candidates(other), kUnknown);
        expectNoMessages();
    }
}

// Its header is that of the larger micromap whose memory it has: nothing was built in it.
TEST_P(MicromapSize, MemoryOfALargerMicromap)
{
    MicromapInput input = transparent();
    Random random(5);
    // Differing states, so that the triangle cannot be folded and has data.
    input.add(4, kFourState, randomStates(random, 4, kFourState));
    Micromap large(gpu(), input);
    large.build();
    EXPECT_EQ(candidates(large), std::vector<uint32_t>(4, 0));
    for (const VkDeviceSize size : {64u, 80u, 96u, 112u, 368u}) {
        SCOPED_TRACE(testing::Message() << size << " bytes");
        const Micromap small(gpu(), large, size);
        alias(small, large);
        EXPECT_EQ(candidates(small), kUnknown);
    }
    // With the size of all bytes in use, it is a copy.
    const Micromap same(gpu(), large, large.size());
    alias(same, large);
    EXPECT_EQ(candidates(same), std::vector<uint32_t>(4, 0));
}

// Findings about a copy that only the GPU makes are reported by the next command buffer, once, without the setting
// `validate`.
TEST_P(MicromapSize, CopiesThatCannotBeCarriedOut)
{
    MicromapInput input = transparent();
    Random random(5);
    input.add(4, kFourState, randomStates(random, 4, kFourState));
    Micromap source(gpu(), input);
    source.build();
    const Micromap small(gpu(), source, 128);
    const Micromap unbuilt(gpu(), source, source.size());
    const Buffer memory(gpu(), 65536, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const auto expectGpuError = [&](const char *id) {
        expectNoMessages();
        gpu().end(gpu().begin());
        expectMessage(id);
        gpu().end(gpu().begin());
        expectNoMessages();
    };
    copy(source, small);
    expectGpuError("VELLUM-micromap-copy-size");
    save(unbuilt, memory.address());
    expectGpuError("VELLUM-micromap-not-constructed");
    restore(memory.address(), unbuilt);
    expectGpuError("VELLUM-micromap-serialized");
    save(source, memory.address());
    restore(memory.address(), unbuilt);
    EXPECT_EQ(candidates(unbuilt), candidates(source));
    expectNoMessages();
    restore(memory.address(), small);
    expectGpuError("VELLUM-micromap-copy-size");
    const Buffer buffer(gpu(), 256, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    save(source, buffer.address());
    expectGpuError("VELLUM-micromap-copy-size");
}

TEST(MicromapSizeOnTheHost, SmallerThanAnyMicromap)
{
    Gpu gpu(Options{.api = Api::Ext});
    MicromapInput input;
    input.add(4, kFourState, std::vector<uint8_t>(256, 0));
    Micromap source(gpu, input);
    source.build();
    const auto expectOne = [&](const std::string &id) {
        const std::vector<Message> messages = gpu.takeUnexpectedMessages();
        ASSERT_EQ(messages.size(), 1u) << id;
        EXPECT_EQ(messages[0].id, id);
    };
    for (const VkDeviceSize size : {0u, 1u, 3u, 60u}) {
        SCOPED_TRACE(testing::Message() << size << " bytes");
        const Micromap tiny(gpu, source, size);
        auto info = vkInit<VkCopyMicromapInfoEXT>(
            {.src = source.handle().ext, .dst = tiny.handle().ext, .mode = VK_COPY_MICROMAP_MODE_COMPACT_EXT});
        EXPECT_EQ(gpu.vk().CopyMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info), VK_SUCCESS);
        expectOne("VELLUM-micromap-copy-size");
        const std::vector<uint8_t> nonsense(4096, 7);
        auto in = vkInit<VkCopyMemoryToMicromapInfoEXT>();
        in.src.hostAddress = nonsense.data();
        in.dst = tiny.handle().ext;
        in.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
        EXPECT_EQ(gpu.vk().CopyMemoryToMicromapEXT(gpu.device(), VK_NULL_HANDLE, &in), VK_SUCCESS);
        expectOne("VELLUM-VUID-VkCopyMemoryToMicromapInfoEXT-src-07549");
    }
}

INSTANTIATE_TEST_SUITE_P(Apis, MicromapSize, testing::Values(Api::Ext, Api::Khr),
                         [](const auto &test) { return test.param == Api::Ext ? "Ext" : "Khr"; });

} // namespace
