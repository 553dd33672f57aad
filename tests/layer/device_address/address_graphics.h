// SPDX-License-Identifier: Apache-2.0
// A row of 64 pixels for the tests of draws by address: shaders/address_draws.glsl draws points that write numbers.
#pragma once

#include "device_address/address_ranges.h"
#include "gpu/programs/graphics.h"

namespace vt
{

class AddressGraphics
{
public:
    static constexpr uint32_t kWidth = 64;

    explicit AddressGraphics(Gpu &gpu);
    AddressGraphics(const AddressGraphics &) = delete;
    AddressGraphics &operator=(const AddressGraphics &) = delete;
    ~AddressGraphics();

    enum class Kind { StaticStrides, DynamicStrides, Feedback, Mesh };
    // A new pipeline, whose bindings are x (one word, 4 bytes apart) and value (one word, 8 bytes apart).
    VkPipeline pipeline(Kind kind);
    // Renders what is recorded with a pipeline, and returns the row.
    std::vector<uint32_t> render(VkPipeline pipeline, const std::function<void(VkCommandBuffer)> &record);

private:
    Gpu &gpu_;
    RowImage image_;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    std::vector<VkPipeline> pipelines_;
    Buffer out_;
};

// Draws by address against draws of buffers.
class AddressGraphicsTest : public AddressTest
{
protected:
    explicit AddressGraphicsTest(const Options &options = {.addressCommands = true}) : AddressTest(options) {}
    void SetUp() override
    {
        graphics_ = std::make_unique<AddressGraphics>(gpu());
        xs_ = buffer(1024, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
        values_ = buffer(1024, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
        for (uint32_t i = 0; i < 256; ++i) {
            xs_.as<uint32_t>()[i] = i * 7 % 61;
            values_.as<uint32_t>()[i] = i + 1;
        }
    }
    void TearDown() override
    {
        graphics_.reset();
        AddressTest::TearDown();
    }
    AddressGraphics &graphics() { return *graphics_; }
    const Buffer &xs() const { return xs_; }
    const Buffer &values() const { return values_; }
    void bindVertices(VkCommandBuffer commands) const
    {
        const std::array buffers{xs_.handle(), values_.handle()};
        const std::array<VkDeviceSize, 2> offsets{0, 0};
        vkCmdBindVertexBuffers(commands, 0, 2, buffers.data(), offsets.data());
    }
    // Checks that both draw the same row, and that it is not empty.
    void expectSame(VkPipeline pipeline, const std::function<void(VkCommandBuffer)> &byAddress,
                    const std::function<void(VkCommandBuffer)> &byBuffer)
    {
        const auto row = [&](const auto &record) {
            return graphics().render(pipeline, [&](VkCommandBuffer commands) {
                bindVertices(commands);
                record(commands);
            });
        };
        const std::vector<uint32_t> expected = row(byBuffer);
        EXPECT_NE(expected, std::vector<uint32_t>(AddressGraphics::kWidth));
        EXPECT_EQ(row(byAddress), expected);
    }
    void expectNothing(VkPipeline pipeline, const std::function<void(VkCommandBuffer)> &record)
    {
        EXPECT_EQ(graphics().render(pipeline, record), std::vector<uint32_t>(AddressGraphics::kWidth));
    }

private:
    std::unique_ptr<AddressGraphics> graphics_;
    Buffer xs_, values_;
};

} // namespace vt
