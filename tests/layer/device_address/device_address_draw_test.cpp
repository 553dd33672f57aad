// SPDX-License-Identifier: Apache-2.0
// Bindings, indirect commands and conditional rendering of VK_KHR_device_address_commands: the same pixels as from the
// commands that take buffers, and wrong ranges rejected.
#include "device_address/address_graphics.h"
#include "shaders/address_draws_compute.h"

namespace
{

using namespace vt;

constexpr VkBufferUsageFlags kIndirect = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
using Row = std::vector<uint32_t>;

class AddressDraws : public AddressGraphicsTest
{
protected:
    explicit AddressDraws(const Options &options = {.addressCommands = true}) : AddressGraphicsTest(options) {}

    static VkBindVertexBuffer3InfoKHR vertices(const VkStridedDeviceAddressRangeKHR &range, bool setStride)
    {
        return vkInit<VkBindVertexBuffer3InfoKHR>(
            {.setStride = setStride ? VK_TRUE : VK_FALSE, .addressRange = range, .addressFlags = kAnyUsage});
    }
    static VkBindIndexBuffer3InfoKHR indices(const VkDeviceAddressRangeKHR &range, VkIndexType type)
    {
        auto info =
            vkInit<VkBindIndexBuffer3InfoKHR>({.addressRange = range, .addressFlags = kAnyUsage, .indexType = type});
        return info;
    }
    static VkDrawIndirect2InfoKHR draws(const VkStridedDeviceAddressRangeKHR &range, uint32_t count)
    {
        return vkInit<VkDrawIndirect2InfoKHR>({.addressRange = range, .addressFlags = kAnyUsage, .drawCount = count});
    }
    static VkDrawIndirectCount2InfoKHR draws(const VkStridedDeviceAddressRangeKHR &range,
                                             const VkDeviceAddressRangeKHR &count, uint32_t most)
    {
        auto info = vkInit<VkDrawIndirectCount2InfoKHR>({.addressRange = range});
        info.addressFlags = info.countAddressFlags = kAnyUsage;
        info.countAddressRange = count;
        info.maxDrawCount = most;
        return info;
    }

    // The expected row after points 0 .. count of these vertices were drawn.
    Row points(uint32_t count, uint32_t firstX, uint32_t firstValue, uint32_t valueStride) const
    {
        Row row(AddressGraphics::kWidth);
        for (uint32_t i = 0; i < count; ++i)
            row[xs().as<uint32_t>()[firstX + i]] =
                valueStride == 0 ? 0 : values().as<uint32_t>()[firstValue + i * valueStride] * 100;
        return row;
    }

    // The commands of one kind of indirect draw, by address and by buffer, with and without a count.
    template <class Command, class Draw, class DrawCount>
    struct Family {
        const char *name;
        const char *countName;
        Draw draw;
        DrawCount drawCount;
        PFN_vkCmdDrawIndirect byBuffer;
        PFN_vkCmdDrawIndirectCount countByBuffer;
        std::array<Command, 4> commands;
    };
    template <class F>
    void expectFamily(VkPipeline pipeline, const F &family, const std::function<void(VkCommandBuffer)> &bind)
    {
        constexpr uint32_t stride = 32, offset = 24;
        const Buffer buffer = this->buffer(256, kIndirect), counts = this->buffer(64, kIndirect);
        const Buffer other = this->buffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
        const uint32_t size = sizeof(family.commands[0]);
        for (size_t i = 0; i < 4; ++i)
            std::memcpy(buffer.bytes() + offset + i * stride, &family.commands[i], size);
        counts.as<uint32_t>()[3] = 3;
        const auto draw = [&](VkCommandBuffer commands, const VkStridedDeviceAddressRangeKHR &range, uint32_t count) {
            bind(commands);
            const auto info = draws(range, count);
            family.draw(commands, &info);
        };
        const auto drawCount = [&](VkCommandBuffer commands, const VkStridedDeviceAddressRangeKHR &range,
                                   const VkDeviceAddressRangeKHR &count, uint32_t most) {
            bind(commands);
            const auto info = draws(range, count, most);
            family.drawCount(commands, &info);
        };
        const auto byBuffer = [&](uint32_t count) {
            return [&, count](VkCommandBuffer commands) {
                bind(commands);
                family.byBuffer(commands, buffer.handle(), offset, count, stride);
            };
        };
        const VkStridedDeviceAddressRangeKHR all = rangeOf(buffer, offset, 3 * stride + size, stride);
        const VkStridedDeviceAddressRangeKHR one = rangeOf(buffer, offset, size, 0);
        const VkDeviceAddressRangeKHR three = rangeOf(counts, 12, 4);
        expectSame(
            pipeline, [&](VkCommandBuffer c) { draw(c, all, 4); }, byBuffer(4));
        expectSame(
            pipeline, [&](VkCommandBuffer c) { draw(c, one, 1); }, byBuffer(1));
        expectSame(
            pipeline, [&](VkCommandBuffer c) { drawCount(c, all, three, 4); },
            [&](VkCommandBuffer commands) {
                bind(commands);
                family.countByBuffer(commands, buffer.handle(), offset, counts.handle(), 12, 4, stride);
            });
        expectSame(
            pipeline, [&](VkCommandBuffer c) { drawCount(c, all, three, 2); }, byBuffer(2));
        expectSame(
            pipeline, [&](VkCommandBuffer c) { drawCount(c, one, three, 1); }, byBuffer(1));

        const std::string name = family.name, countName = family.countName;
        expectNothing(pipeline, [&](VkCommandBuffer commands) {
            bindVertices(commands);
            draw(commands, {0, 0, 0}, 0);
            drawCount(commands, {0, 0, 0}, three, 0);
        });
        expectNoMessages();
        const auto rejected = [&](const std::string &rule, const std::function<void(VkCommandBuffer)> &record) {
            expectRejected(rule, [&](VkCommandBuffer commands) { record(commands); });
        };
        for (const bool counted : {false, true}) {
            const std::string rules = (counted ? countName : name) + "-pInfo-";
            const auto with = [&](const VkStridedDeviceAddressRangeKHR &range, uint32_t count) {
                return [&, range, count](VkCommandBuffer c) {
                    counted ? drawCount(c, range, three, count) : draw(c, range, count);
                };
            };
            const VkDeviceSize late = buffer.size() - 3 * stride - size + 4;
            rejected(rules + "13110", with(rangeOf(buffer, late, 3 * stride + size - 4, stride), 4));
            rejected(rules + "13111", with(rangeOf(buffer, offset, 128, 0), 2));
            rejected(rules + "13112", with(rangeOf(buffer, offset, 128, size - 4), 2));
            rejected(rules + "13113", with(rangeOf(buffer, offset, 128, size + 2), 2));
            expectBadRangesRejected(
                buffer, other, "VkStridedDeviceAddressRangeKHR",
                std::string(counted ? "VkDrawIndirectCount2InfoKHR" : "VkDrawIndirect2InfoKHR") + "-addressRange-13107",
                [&](VkCommandBuffer c, const VkDeviceAddressRangeKHR &range) {
                    with({range.address, range.size, stride}, 2)(c);
                },
                false);
        }
        expectBadRangesRejected(
            counts, other, "VkDeviceAddressRangeKHR", "VkDrawIndirectCount2InfoKHR-countAddressRange-13114",
            [&](VkCommandBuffer c, const VkDeviceAddressRangeKHR &range) { drawCount(c, all, range, 4); }, false);
        rejected("VkDrawIndirectCount2InfoKHR-countAddressRange-13117",
                 [&](VkCommandBuffer c) { drawCount(c, all, rangeOf(counts, 61, 3), 4); });
    }
};

TEST_F(AddressDraws, VertexBuffers)
{
    const VkPipeline pipeline = graphics().pipeline(AddressGraphics::Kind::StaticStrides);
    const Row row = graphics().render(pipeline, [&](VkCommandBuffer commands) {
        const std::array infos{vertices(rangeOf(xs(), 40, 400, 0), false),
                               vertices(rangeOf(values(), 12, 600, 0), false)};
        gpu().vk().CmdBindVertexBuffers3KHR(commands, 0, 2, infos.data());
        vkCmdDraw(commands, 20, 1, 0, 0);
    });
    EXPECT_EQ(row, points(20, 10, 3, 2));
}

// One call that sets some strides and keeps others.
TEST_F(AddressDraws, VertexBuffersWithStrides)
{
    const VkPipeline pipeline = graphics().pipeline(AddressGraphics::Kind::DynamicStrides);
    const Row row = graphics().render(pipeline, [&](VkCommandBuffer commands) {
        const std::array first{vertices(rangeOf(xs(), 0, 1024, 4), true),
                               vertices(rangeOf(values(), 0, 1024, 4), true)};
        gpu().vk().CmdBindVertexBuffers3KHR(commands, 0, 2, first.data());
        const std::array second{vertices(rangeOf(xs(), 40, 400, 0), false),
                                vertices(rangeOf(values(), 12, 600, 16), true)};
        gpu().vk().CmdBindVertexBuffers3KHR(commands, 0, 2, second.data());
        vkCmdDraw(commands, 20, 1, 0, 0);
    });
    EXPECT_EQ(row, points(20, 10, 3, 4));
}

TEST_F(AddressDraws, NullVertexBuffers)
{
    const VkPipeline pipeline = graphics().pipeline(AddressGraphics::Kind::StaticStrides);
    Row expected(AddressGraphics::kWidth);
    const Row row = graphics().render(pipeline, [&](VkCommandBuffer commands) {
        const std::array infos{vertices({0, 0, 0}, false), vertices(rangeOf(values(), 12, 600, 0), false)};
        gpu().vk().CmdBindVertexBuffers3KHR(commands, 0, 2, infos.data());
        vkCmdDraw(commands, 1, 1, 0, 0);
    });
    expected[0] = 400;
    EXPECT_EQ(row, expected);
}

TEST_F(AddressDraws, RejectsWrongVertexBuffers)
{
    const Buffer other = buffer(256, kIndirect);
    const auto bind = [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
        const std::array infos{vertices(rangeOf(xs(), 0, 64, 0), false),
                               vertices({range.address, range.size, 0}, false)};
        gpu().vk().CmdBindVertexBuffers3KHR(commands, 0, 2, infos.data());
    };
    expectBadRangesRejected(values(), other, "VkStridedDeviceAddressRangeKHR",
                            "VkBindVertexBuffer3InfoKHR-addressRange-13074", bind, false);
    expectRejected("VkBindVertexBuffer3InfoKHR-addressRange-13075",
                   [&](VkCommandBuffer commands) { bind(commands, rangeOf(values(), 0, 0)); });
    // A rejected call binds nothing.
    const VkPipeline pipeline = graphics().pipeline(AddressGraphics::Kind::StaticStrides);
    const Row row = graphics().render(pipeline, [&](VkCommandBuffer commands) {
        bindVertices(commands);
        const std::array infos{vertices(rangeOf(xs(), 64, 64, 0), false), vertices({16, 64, 0}, false)};
        gpu().vk().CmdBindVertexBuffers3KHR(commands, 0, 2, infos.data());
        vkCmdDraw(commands, 20, 1, 0, 0);
    });
    EXPECT_EQ(row, points(20, 0, 0, 2));
    EXPECT_EQ(gpu().takeUnexpectedMessages().size(), 1u);
}

class AddressIndices : public AddressDraws
{
protected:
    explicit AddressIndices(const Options &options = {.addressCommands = true}) : AddressDraws(options) {}
    void expectIndices()
    {
        const VkPipeline pipeline = graphics().pipeline(AddressGraphics::Kind::StaticStrides);
        const Buffer buffer = this->buffer(256, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
        for (uint16_t i = 0; i < 64; ++i)
            buffer.as<uint16_t>()[i] = static_cast<uint16_t>(i % 2 == 0 ? i : 0); // of both sizes
        for (const VkIndexType type : {VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32}) {
            expectSame(
                pipeline,
                [&](VkCommandBuffer commands) {
                    const auto info = indices(rangeOf(buffer, 8, 83), type);
                    gpu().vk().CmdBindIndexBuffer3KHR(commands, &info);
                    vkCmdDrawIndexed(commands, 20, 1, 0, 1, 0);
                },
                [&](VkCommandBuffer commands) {
                    vkCmdBindIndexBuffer(commands, buffer.handle(), 8, type);
                    vkCmdDrawIndexed(commands, 20, 1, 0, 1, 0);
                });
        }
        const Buffer other = this->buffer(256, kIndirect);
        const auto bind = [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
            const auto info = indices(range, VK_INDEX_TYPE_UINT16);
            gpu().vk().CmdBindIndexBuffer3KHR(commands, &info);
        };
        expectBadRangesRejected(buffer, other, "VkDeviceAddressRangeKHR",
                                "VkBindIndexBuffer3InfoKHR-addressRange-13051", bind, false);
        expectRejected("VkBindIndexBuffer3InfoKHR-addressRange-13056",
                       [&](VkCommandBuffer commands) { bind(commands, rangeOf(buffer, 0, 0)); });
        // Every index of a null buffer is 0.
        expectSame(
            pipeline,
            [&](VkCommandBuffer commands) {
                bind(commands, {0, 0});
                vkCmdDrawIndexed(commands, 20, 1, 100, 3, 0);
            },
            [&](VkCommandBuffer commands) { vkCmdDraw(commands, 1, 1, 3, 0); });
    }
};
TEST_F(AddressIndices, Bound)
{
    expectIndices();
}
class AddressIndicesMaintenance6 : public AddressIndices
{
protected:
    AddressIndicesMaintenance6()
        : AddressIndices({.oldValidation = false, .addressCommands = true, .nullIndexBuffer = true})
    {
    }
};
TEST_F(AddressIndicesMaintenance6, Bound)
{
    expectIndices();
}
// With VK_KHR_maintenance5, which adds the size of index buffers.
class AddressIndicesMaintenance5 : public AddressIndices
{
protected:
    AddressIndicesMaintenance5() : AddressIndices({.oldValidation = false, .newer = true, .addressCommands = true}) {}
};
TEST_F(AddressIndicesMaintenance5, Bound)
{
    expectIndices();
}

TEST_F(AddressDraws, Indirect)
{
    expectFamily(graphics().pipeline(AddressGraphics::Kind::StaticStrides),
                 Family<VkDrawIndirectCommand, PFN_vkCmdDrawIndirect2KHR, PFN_vkCmdDrawIndirectCount2KHR>{
                     "vkCmdDrawIndirect2KHR",
                     "vkCmdDrawIndirectCount2KHR",
                     gpu().vk().CmdDrawIndirect2KHR,
                     gpu().vk().CmdDrawIndirectCount2KHR,
                     vkCmdDrawIndirect,
                     vkCmdDrawIndirectCount,
                     {{{3, 1, 0, 0}, {2, 2, 5, 0}, {1, 1, 9, 1}, {4, 1, 12, 0}}}},
                 [](VkCommandBuffer) {});
}

TEST_F(AddressDraws, IndexedIndirect)
{
    const Buffer buffer = this->buffer(256, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
    for (uint32_t i = 0; i < 64; ++i)
        buffer.as<uint32_t>()[i] = i * 5 % 64;
    expectFamily(
        graphics().pipeline(AddressGraphics::Kind::StaticStrides),
        Family<VkDrawIndexedIndirectCommand, PFN_vkCmdDrawIndexedIndirect2KHR, PFN_vkCmdDrawIndexedIndirectCount2KHR>{
            "vkCmdDrawIndexedIndirect2KHR",
            "vkCmdDrawIndexedIndirectCount2KHR",
            gpu().vk().CmdDrawIndexedIndirect2KHR,
            gpu().vk().CmdDrawIndexedIndirectCount2KHR,
            vkCmdDrawIndexedIndirect,
            vkCmdDrawIndexedIndirectCount,
            {{{3, 1, 0, 0, 0}, {2, 2, 5, 1, 0}, {1, 1, 9, 0, 1}, {4, 1, 12, 0, 0}}}},
        [&](VkCommandBuffer commands) { vkCmdBindIndexBuffer(commands, buffer.handle(), 0, VK_INDEX_TYPE_UINT32); });
}

TEST_F(AddressDraws, MeshTasksIndirect)
{
    if (!gpu().has(VK_EXT_MESH_SHADER_EXTENSION_NAME))
        GTEST_SKIP() << "no mesh shaders";
    expectFamily(graphics().pipeline(AddressGraphics::Kind::Mesh),
                 Family<VkDrawMeshTasksIndirectCommandEXT, PFN_vkCmdDrawMeshTasksIndirect2EXT,
                        PFN_vkCmdDrawMeshTasksIndirectCount2EXT>{"vkCmdDrawMeshTasksIndirect2EXT",
                                                                 "vkCmdDrawMeshTasksIndirectCount2EXT",
                                                                 gpu().vk().CmdDrawMeshTasksIndirect2EXT,
                                                                 gpu().vk().CmdDrawMeshTasksIndirectCount2EXT,
                                                                 gpu().vk().CmdDrawMeshTasksIndirectEXT,
                                                                 gpu().vk().CmdDrawMeshTasksIndirectCountEXT,
                                                                 {{{3, 1, 1}, {2, 1, 1}, {5, 1, 1}, {7, 1, 1}}}},
                 [](VkCommandBuffer) {});
}

// Drivers accept this; the validation layer below would report it. Tests vertices, indices, and the arguments and
// counts of draws.
TEST_F(AddressDraws, DestroyedAliases)
{
    Decoys decoys(gpu());
    const Buffer index = shadowed(decoys, 64, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
    const Buffer arguments = shadowed(decoys, 64, kIndirect), count = shadowed(decoys, 16, kIndirect);
    decoys.add(xs(), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    decoys.add(values(), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    for (uint32_t i = 0; i < 16; ++i)
        index.as<uint32_t>()[i] = i;
    const VkDrawIndirectCommand plain{3, 1, 0, 0};
    const VkDrawIndexedIndirectCommand indexed{5, 1, 0, 0, 0};
    std::memcpy(arguments.bytes(), &plain, sizeof plain);
    std::memcpy(arguments.bytes() + 32, &indexed, sizeof indexed);
    count.as<uint32_t>()[0] = 1;
    const VkPipeline pipeline = graphics().pipeline(AddressGraphics::Kind::StaticStrides);
    const auto &vk = gpu().vk();
    const Row row = graphics().render(pipeline, [&](VkCommandBuffer commands) {
        const std::array bindings{vertices(rangeOf(xs(), 0, 1024, 4), false),
                                  vertices(rangeOf(values(), 0, 1024, 8), false)};
        vk.CmdBindVertexBuffers3KHR(commands, 0, 2, bindings.data());
        const auto elements = indices(rangeOf(index, 0, 64), VK_INDEX_TYPE_UINT32);
        vk.CmdBindIndexBuffer3KHR(commands, &elements);
        const VkStridedDeviceAddressRangeKHR first = rangeOf(arguments, 0, 32, 32),
                                             second = rangeOf(arguments, 32, 32, 32);
        const auto draw = draws(first, 1), drawIndexed = draws(second, 1);
        const auto counted = draws(second, rangeOf(count, 0, 4), 1);
        vk.CmdDrawIndirect2KHR(commands, &draw);
        vk.CmdDrawIndexedIndirect2KHR(commands, &drawIndexed);
        vk.CmdDrawIndexedIndirectCount2KHR(commands, &counted);
        decoys.destroy();
    });
    EXPECT_EQ(row, points(5, 0, 0, 2));
}

class AddressDrawsHarmless : public AddressDraws
{
protected:
    AddressDrawsHarmless() : AddressDraws({.validation = false, .addressCommands = true}) {}
    // A draw with a wrong range gives one message of this rule and draws like one with the right range, or nothing if
    // the layer is strict.
    void expectDrawn(const std::string &rule, const std::function<void(VkCommandBuffer)> &wrong,
                     const std::function<void(VkCommandBuffer)> &right)
    {
        SCOPED_TRACE(rule);
        const auto draw = [&](const auto &record) {
            return graphics().render(pipeline_, [&](VkCommandBuffer commands) {
                bindVertices(commands);
                record(commands);
            });
        };
        const Row expected = draw(right);
        EXPECT_NE(expected, Row(AddressGraphics::kWidth));
        expectNoMessages();
        const Row row = draw(wrong);
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        ASSERT_EQ(messages.size(), 1u);
        EXPECT_EQ(messages[0].id, "VELLUM-VUID-" + rule);
        if (strictTests()) {
            EXPECT_NE(row, expected);
        } else {
            EXPECT_EQ(row, expected);
        }
    }
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

TEST_F(AddressDrawsHarmless, Bindings)
{
    pipeline_ = graphics().pipeline(AddressGraphics::Kind::StaticStrides);
    const Buffer other = buffer(1024, kIndirect);
    for (uint32_t i = 0; i < 256; ++i)
        other.as<uint32_t>()[i] = i * 3 % 64;
    const auto drawn = [&](const VkStridedDeviceAddressRangeKHR &range) {
        return [&, range](VkCommandBuffer commands) {
            const auto info = vertices(range, false);
            gpu().vk().CmdBindVertexBuffers3KHR(commands, 1, 1, &info);
            vkCmdDraw(commands, 20, 1, 0, 0);
        };
    };
    const auto byBuffer = [&](VkBuffer buffer, VkDeviceSize offset) {
        return [&, buffer, offset](VkCommandBuffer commands) {
            vkCmdBindVertexBuffers(commands, 1, 1, &buffer, &offset);
            vkCmdDraw(commands, 20, 1, 0, 0);
        };
    };
    expectDrawn("VkBindVertexBuffer3InfoKHR-addressRange-13074", drawn(rangeOf(other, 4, 512, 0)),
                byBuffer(other.handle(), 4));
    expectDrawn("VkStridedDeviceAddressRangeKHR-address-11365", drawn(rangeOf(values(), 64, 4096, 0)),
                byBuffer(values().handle(), 64));
    const auto indexed = [&](const VkDeviceAddressRangeKHR &range) {
        return [&, range](VkCommandBuffer commands) {
            const auto info = indices(range, VK_INDEX_TYPE_UINT32);
            gpu().vk().CmdBindIndexBuffer3KHR(commands, &info);
            if (!strictTests()) // nothing is bound then
                vkCmdDrawIndexed(commands, 20, 1, 0, 0, 0);
        };
    };
    const auto indexedByBuffer = [&](VkBuffer buffer) {
        return [buffer](VkCommandBuffer commands) {
            vkCmdBindIndexBuffer(commands, buffer, 8, VK_INDEX_TYPE_UINT32);
            vkCmdDrawIndexed(commands, 20, 1, 0, 0, 0);
        };
    };
    expectDrawn("VkBindIndexBuffer3InfoKHR-addressRange-13051", indexed(rangeOf(other, 8, 512)),
                indexedByBuffer(other.handle()));
}

TEST_F(AddressDrawsHarmless, Indirect)
{
    pipeline_ = graphics().pipeline(AddressGraphics::Kind::StaticStrides);
    const Buffer commands = buffer(256, kIndirect), other = buffer(256, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    const std::array<VkDrawIndirectCommand, 2> both{{{3, 1, 0, 0}, {2, 1, 5, 0}}};
    std::memcpy(commands.bytes() + 16, both.data(), sizeof both);
    std::memcpy(other.bytes() + 16, both.data(), sizeof both);
    const auto drawn = [&](const VkStridedDeviceAddressRangeKHR &range, uint32_t count) {
        return [&, range, count](VkCommandBuffer c) {
            const auto info = draws(range, count);
            gpu().vk().CmdDrawIndirect2KHR(c, &info);
        };
    };
    const auto byBuffer = [&](uint32_t count) {
        return [&, count](VkCommandBuffer c) { vkCmdDrawIndirect(c, commands.handle(), 16, count, 16); };
    };
    const std::string rule = "vkCmdDrawIndirect2KHR-pInfo-";
    expectDrawn("VkDrawIndirect2InfoKHR-addressRange-13107", drawn(rangeOf(other, 16, 32, 16), 2), byBuffer(2));
    expectDrawn("VkStridedDeviceAddressRangeKHR-address-11365", drawn(rangeOf(commands, 16, 512, 16), 2), byBuffer(2));
    expectDrawn(rule + "13110", drawn(rangeOf(commands, 16, 24, 16), 2), byBuffer(2));
    expectDrawn(rule + "13112", drawn(rangeOf(commands, 16, 16, 8), 1), byBuffer(1));
    expectDrawn(rule + "13113", drawn(rangeOf(commands, 16, 18, 18), 1), byBuffer(1));
}

// --- dispatches and conditional rendering ---

class AddressDispatches : public AddressTest
{
protected:
    void SetUp() override
    {
        const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, 8};
        auto layout = vkInit<VkPipelineLayoutCreateInfo>({.pushConstantRangeCount = 1, .pPushConstantRanges = &push});
        VT_CHECK(vkCreatePipelineLayout(gpu().device(), &layout, nullptr, &layout_));
        auto info = vkInit<VkComputePipelineCreateInfo>(
            {.stage = vkInit<VkPipelineShaderStageCreateInfo>({.stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                               .module = gpu().shader(address_draws_compute),
                                                               .pName = "main"}),
             .layout = layout_});
        VT_CHECK(vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline_));
        vkDestroyShaderModule(gpu().device(), info.stage.module, nullptr);
        target_ = buffer(64, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    }
    void TearDown() override
    {
        vkDestroyPipeline(gpu().device(), pipeline_, nullptr);
        vkDestroyPipelineLayout(gpu().device(), layout_, nullptr);
        target_ = {};
        AddressTest::TearDown();
    }
    void bind(VkCommandBuffer commands) const
    {
        const VkDeviceAddress address = target_.address();
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
        vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, 8, &address);
    }
    // The words that the dispatches since the last call have added to.
    Row takeSums() const
    {
        const auto words = target_.as<uint32_t>();
        Row row(words.begin(), words.end());
        std::memset(target_.bytes(), 0, 64);
        return row;
    }
    void begin(VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range, bool inverted = false)
    {
        auto info = vkInit<VkConditionalRenderingBeginInfo2EXT>(
            {.addressRange = range,
             .addressFlags = kAnyUsage,
             .flags = inverted ? VkFlags{VK_CONDITIONAL_RENDERING_INVERTED_BIT_EXT} : 0});
        gpu().vk().CmdBeginConditionalRendering2EXT(commands, &info);
    }
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
    Buffer target_;
};

TEST_F(AddressDispatches, Indirect)
{
    const Buffer indirect = buffer(128, kIndirect), other = buffer(128, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    const VkDispatchIndirectCommand command{5, 3, 1};
    std::memcpy(indirect.bytes() + 20, &command, sizeof command);
    const auto dispatch = [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
        auto info = vkInit<VkDispatchIndirect2InfoKHR>({.addressRange = range, .addressFlags = kAnyUsage});
        bind(commands);
        gpu().vk().CmdDispatchIndirect2KHR(commands, &info);
    };
    gpu().submit([&](VkCommandBuffer commands) {
        bind(commands);
        vkCmdDispatchIndirect(commands, indirect.handle(), 20);
    });
    const Row expected = takeSums();
    EXPECT_EQ(expected[4], 6u);
    gpu().submit([&](VkCommandBuffer commands) { dispatch(commands, rangeOf(indirect, 20, 12)); });
    EXPECT_EQ(takeSums(), expected);
    expectBadRangesRejected(indirect, other, "VkDeviceAddressRangeKHR", "VkDispatchIndirect2InfoKHR-addressRange-13107",
                            dispatch, false);
    expectRejected("vkCmdDispatchIndirect2KHR-pInfo-13050",
                   [&](VkCommandBuffer commands) { dispatch(commands, rangeOf(indirect, 120, 8)); });
    EXPECT_EQ(takeSums(), Row(16));
}

TEST_F(AddressDispatches, ConditionalRendering)
{
    if (!gpu().has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        GTEST_SKIP() << "no conditional rendering";
    const Buffer predicates = buffer(128, VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
    const Buffer other = buffer(128, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    predicates.as<uint32_t>()[3] = 1;
    gpu().submit([&](VkCommandBuffer commands) {
        bind(commands);
        uint32_t groups = 1;
        for (const VkDeviceSize offset : {8u, 12u}) { // of 0 and of 1
            for (const bool inverted : {false, true}) {
                begin(commands, rangeOf(predicates, offset, 4), inverted);
                vkCmdDispatch(commands, 1, groups, 1);
                gpu().vk().CmdEndConditionalRenderingEXT(commands);
                barrier(commands);
                groups *= 2;
            }
        }
    });
    // 1 + 2 for the dispatch of two groups, 1 + 2 + 3 + 4 for that of four.
    EXPECT_EQ(takeSums()[0], 13u);
    // Rejected: nothing is discarded, and the layer skips the vkCmdEndConditionalRenderingEXT.
    expectBadRangesRejected(
        predicates, other, "VkDeviceAddressRangeKHR", "VkConditionalRenderingBeginInfo2EXT-addressRange-13064",
        [&](VkCommandBuffer commands, const VkDeviceAddressRangeKHR &range) {
            bind(commands);
            begin(commands, range);
            vkCmdDispatch(commands, 1, 1, 1);
            gpu().vk().CmdEndConditionalRenderingEXT(commands);
        },
        false);
    expectRejected("VkConditionalRenderingBeginInfo2EXT-addressRange-13066", [&](VkCommandBuffer commands) {
        begin(commands, rangeOf(predicates, 125, 3));
        gpu().vk().CmdEndConditionalRenderingEXT(commands);
    });
    EXPECT_EQ(takeSums()[0], strictTests() ? 7u : 4u);
}

TEST_F(AddressDispatches, DestroyedAliases)
{
    Decoys decoys(gpu());
    const bool conditional = gpu().has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME);
    const Buffer indirect = shadowed(decoys, 64, kIndirect);
    const VkDispatchIndirectCommand command{1, 1, 1};
    std::memcpy(indirect.bytes(), &command, sizeof command);
    Buffer predicate;
    if (conditional)
        predicate = shadowed(decoys, 64, VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
    gpu().submit([&](VkCommandBuffer commands) {
        bind(commands);
        auto info =
            vkInit<VkDispatchIndirect2InfoKHR>({.addressRange = rangeOf(indirect, 0, 12), .addressFlags = kAnyUsage});
        gpu().vk().CmdDispatchIndirect2KHR(commands, &info);
        if (conditional) {
            begin(commands, rangeOf(predicate, 0, 4));
            vkCmdDispatch(commands, 1, 1, 1); // discarded
            gpu().vk().CmdEndConditionalRenderingEXT(commands);
        }
        decoys.destroy();
    });
    EXPECT_EQ(takeSums()[0], 1u);
}

// The layer's own work is not discarded, and what the application dispatches after it still is.
TEST_F(AddressDispatches, ConditionalRenderingAroundInjectedWork)
{
    if (!gpu().has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        GTEST_SKIP() << "no conditional rendering";
    const Buffer predicates = buffer(64, VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
    const Buffer out = buffer(64, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    std::memset(out.bytes(), 0x5a, 64);
    // written by the layer
    const QueryPool pool(gpu(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR);
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        bind(commands);
        begin(commands, rangeOf(predicates, 4, 4));
        const VkStridedDeviceAddressRangeKHR range = rangeOf(out, 8, 16, 16);
        gpu().vk().CmdCopyQueryPoolResultsToMemoryKHR(commands, pool, 0, 1, &range, kAnyUsage,
                                                      VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_PARTIAL_BIT |
                                                          VK_QUERY_RESULT_WITH_AVAILABILITY_BIT);
        vkCmdDispatch(commands, 1, 1, 1);
        gpu().vk().CmdEndConditionalRenderingEXT(commands);
    });
    EXPECT_EQ(out.as<uint64_t>()[1], 0u);
    EXPECT_EQ(out.as<uint64_t>()[2], 0u);
    EXPECT_EQ(takeSums(), Row(16));
}

} // namespace
