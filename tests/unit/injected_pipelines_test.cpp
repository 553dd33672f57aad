// SPDX-License-Identifier: Apache-2.0
// Pipelines of injected work, which threads that record need while others compile some.
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <gtest/gtest.h>

#include "layer/command_buffer/injected_work.h"

namespace
{

using namespace vellum::layer;

// A device whose compiler waits until the test lets it go on.
class InjectedPipelineTest : public testing::Test
{
protected:
    InjectedPipelineTest()
    {
        current_ = this;
        table_.CreatePipelineLayout = [](VkDevice, const VkPipelineLayoutCreateInfo *, const VkAllocationCallbacks *,
                                         VkPipelineLayout *layout) {
            *layout = reinterpret_cast<VkPipelineLayout>(uintptr_t{1});
            return VK_SUCCESS;
        };
        table_.DestroyPipelineLayout = [](VkDevice, VkPipelineLayout, const VkAllocationCallbacks *) {};
        table_.CreateShaderModule = [](VkDevice, const VkShaderModuleCreateInfo *, const VkAllocationCallbacks *,
                                       VkShaderModule *module) {
            *module = reinterpret_cast<VkShaderModule>(uintptr_t{1});
            return VK_SUCCESS;
        };
        table_.DestroyShaderModule = [](VkDevice, VkShaderModule, const VkAllocationCallbacks *) {};
        table_.CreateComputePipelines = [](VkDevice, VkPipelineCache, uint32_t, const VkComputePipelineCreateInfo *,
                                           const VkAllocationCallbacks *,
                                           VkPipeline *pipeline) { return current_->compile(*pipeline); };
        table_.DestroyPipeline = [](VkDevice, VkPipeline, const VkAllocationCallbacks *) { --current_->alive_; };
        context_.next = &table_;
    }
    VkResult compile(VkPipeline &pipeline)
    {
        std::unique_lock lock(mutex_);
        ++compiling_;
        changed_.notify_all();
        changed_.wait(lock, [this] { return compiling_ >= awaited_; });
        if (failures_ > 0) {
            --failures_;
            return VK_ERROR_OUT_OF_DEVICE_MEMORY;
        }
        ++alive_;
        pipeline = reinterpret_cast<VkPipeline>(uintptr_t{++made_});
        return VK_SUCCESS;
    }

    inline static InjectedPipelineTest *current_ = nullptr;
    std::mutex mutex_;
    std::condition_variable changed_;
    int compiling_ = 0, awaited_ = 0, failures_ = 0;
    uintptr_t made_ = 0;
    std::atomic<int> alive_ = 0;
    DeviceTable table_{};
    GpuContext context_{};
};

// Each compiler waits for the other: with a lock around them this would never end.
TEST_F(InjectedPipelineTest, DifferentOnesCompileConcurrently)
{
    {
        InjectedPipelines pipelines;
        ASSERT_EQ(pipelines.create(context_, kPushBytes), VK_SUCCESS);
        awaited_ = 2;
        VkPipeline first = VK_NULL_HANDLE;
        std::thread thread([&] { first = pipelines.get(InjectedShader::BlasRecords); });
        const VkPipeline second = pipelines.get(InjectedShader::TlasInstances);
        thread.join();
        EXPECT_NE(first, second);
        EXPECT_EQ(pipelines.get(InjectedShader::BlasRecords), first);
        EXPECT_EQ(pipelines.get(InjectedShader::TlasInstances), second);
        EXPECT_EQ(alive_, 2);
    }
    EXPECT_EQ(alive_, 0);
}

TEST_F(InjectedPipelineTest, OneOfTwoEqualOnesIsKept)
{
    {
        InjectedPipelines pipelines;
        ASSERT_EQ(pipelines.create(context_, kPushBytes), VK_SUCCESS);
        awaited_ = 2;
        VkPipeline first = VK_NULL_HANDLE;
        std::thread thread([&] { first = pipelines.get(InjectedShader::BlasRecords); });
        const VkPipeline second = pipelines.get(InjectedShader::BlasRecords);
        thread.join();
        EXPECT_EQ(first, second);
        EXPECT_EQ(alive_, 1);
    }
    EXPECT_EQ(alive_, 0);
}

TEST_F(InjectedPipelineTest, FailedOnesAreTriedAgain)
{
    InjectedPipelines pipelines;
    ASSERT_EQ(pipelines.create(context_, kPushBytes), VK_SUCCESS);
    failures_ = 1;
    EXPECT_EQ(pipelines.get(InjectedShader::BlasRecords), VkPipeline{VK_NULL_HANDLE});
    EXPECT_NE(pipelines.get(InjectedShader::BlasRecords), VkPipeline{VK_NULL_HANDLE});
}

} // namespace
