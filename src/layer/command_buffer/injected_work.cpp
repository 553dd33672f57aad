// SPDX-License-Identifier: Apache-2.0
#include "layer/command_buffer/injected_work.h"

#include <algorithm>
#include <vector>

#include "layer/command_buffer/device_command_buffers.h"
#include "layer/command_buffer/injected_words.h"

namespace vellum::layer
{
namespace
{

constexpr uint32_t kMaxGroups = 65535; // required minimum of maxComputeWorkGroupCount

} // namespace

VkResult InjectedPipelines::create(const GpuContext &context, uint32_t pushBytes)
{
    context_ = context;
    pushBytes_ = pushBytes;
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, pushBytes};
    VkPipelineLayoutCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    info.pushConstantRangeCount = 1;
    info.pPushConstantRanges = &range;
    return context.next->CreatePipelineLayout(context.device, &info, nullptr, &layout_);
}

InjectedPipelines::~InjectedPipelines()
{
    if (!context_.next)
        return;
    for (const auto &kind : pipelines_) {
        for (const VkPipeline pipeline : kind)
            if (pipeline)
                context_.next->DestroyPipeline(context_.device, pipeline, nullptr);
    }
    if (layout_)
        context_.next->DestroyPipelineLayout(context_.device, layout_, nullptr);
}

VkPipeline InjectedPipelines::get(InjectedShader shader, bool heaps)
{
    std::atomic<VkPipeline> &pipeline = pipelines_[heaps ? 1 : 0][static_cast<size_t>(shader)];
    if (const VkPipeline known = pipeline.load(std::memory_order_acquire))
        return known;
    const VkPipeline own = createPipeline(shader, heaps);
    VkPipeline first = VK_NULL_HANDLE;
    if (!own || pipeline.compare_exchange_strong(first, own))
        return own;
    context_.next->DestroyPipeline(context_.device, own, nullptr);
    return first;
}

VkPipeline InjectedPipelines::createPipeline(InjectedShader shader, bool heaps) const
{
    const std::span code = kInjectedWords[static_cast<size_t>(shader)];
    VkShaderModuleCreateInfo moduleInfo{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    moduleInfo.codeSize = code.size_bytes();
    moduleInfo.pCode = code.data();
    VkShaderModule module = VK_NULL_HANDLE;
    if (context_.next->CreateShaderModule(context_.device, &moduleInfo, nullptr, &module) != VK_SUCCESS)
        return VK_NULL_HANDLE;
    VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
    info.stage = {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                  nullptr,
                  0,
                  VK_SHADER_STAGE_COMPUTE_BIT,
                  module,
                  "main",
                  nullptr};
    VkPipelineCreateFlags2CreateInfoKHR flags{VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR, nullptr,
                                              VK_PIPELINE_CREATE_2_DESCRIPTOR_HEAP_BIT_EXT};
    if (heaps)
        info.pNext = &flags;
    else
        info.layout = layout_;
    VkPipeline pipeline = VK_NULL_HANDLE;
    if (context_.next->CreateComputePipelines(context_.device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline) !=
        VK_SUCCESS)
        pipeline = VK_NULL_HANDLE;
    context_.next->DestroyShaderModule(context_.device, module, nullptr);
    return pipeline;
}

InjectedWork::InjectedWork(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer)
    : device_(device), commandBuffer_(commandBuffer), state_(device.states.get(commandBuffer))
{
}

bool InjectedWork::rejectedIn(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, const char *command)
{
    const auto state = device.states.get(commandBuffer);
    if (!state || !state->inheritsConditionalRendering)
        return false;
    device.driver.report().notAvailable(std::string(command) +
                                        " in a secondary command buffer that inherits conditional rendering");
    return true;
}

VkPipeline InjectedWork::pipelineOf(InjectedShader shader)
{
    const VkPipeline pipeline = device_.injected.get(shader, usesHeaps());
    if (!pipeline)
        device_.driver.report().error("VELLUM-injected-pipeline",
                                      "the driver could not create the pipeline of a shader of the layer");
    return pipeline;
}

bool InjectedWork::bind(InjectedShader shader, const void *values, uint32_t bytes)
{
    const VkPipeline pipeline = pipelineOf(shader);
    if (!pipeline)
        return false;
    const DeviceTable &next = device_.driver.next;
    if (!disturbed_ && state_ && !usesHeaps() && device_.driver.keepsOldPushConstants)
        pushed_ = pushedConstants(); // here, since the destructor must not allocate
    if (!disturbed_ && state_ && state_->conditionalRendering) {
        // Conditional rendering affects the application's draws and dispatches, but no builds.
        next.CmdEndConditionalRenderingEXT(commandBuffer_);
    }
    disturbed_ = true;
    if (state_ && shader != InjectedShader::HitRecords)
        state_->hitTables.forget(); // builds may let indices of records reach further
    next.CmdBindPipeline(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    push(device_.injected.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, values, bytes);
    return true;
}

void InjectedWork::push(VkPipelineLayout layout, VkShaderStageFlags stages, uint32_t offset, const void *data,
                        size_t bytes)
{
    if (usesHeaps()) {
        const VkPushDataInfoEXT info{VK_STRUCTURE_TYPE_PUSH_DATA_INFO_EXT, nullptr, offset, {data, bytes}};
        device_.driver.next.CmdPushDataEXT(commandBuffer_, &info);
    } else {
        device_.driver.next.CmdPushConstants(commandBuffer_, layout, stages, offset, static_cast<uint32_t>(bytes),
                                             data);
    }
}

VkDispatchIndirectCommand InjectedWork::groupsOf(uint64_t invocations, uint32_t groupSize)
{
    // The shaders number their workgroups in x, then y, and ignore those beyond their count.
    const uint64_t groups = (invocations + groupSize - 1) / groupSize;
    const uint64_t rows = (groups + kMaxGroups - 1) / kMaxGroups;
    return {static_cast<uint32_t>(rows > 1 ? kMaxGroups : groups), static_cast<uint32_t>(rows), 1};
}

bool InjectedWork::run(InjectedShader shader, const void *values, uint32_t bytes,
                       const VkDispatchIndirectCommand &groups)
{
    if (!bind(shader, values, bytes))
        return false;
    device_.driver.next.CmdDispatch(commandBuffer_, groups.x, groups.y, groups.z);
    return true;
}

bool InjectedWork::runIndirect(InjectedShader shader, const void *values, uint32_t bytes, VkBuffer buffer,
                               VkDeviceSize offset)
{
    if (!bind(shader, values, bytes))
        return false;
    device_.driver.next.CmdDispatchIndirect(commandBuffer_, buffer, offset);
    return true;
}

void InjectedWork::barrier(bool forHost)
{
    const VkPipelineStageFlags host = forHost ? VK_PIPELINE_STAGE_HOST_BIT : 0;
    const VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr,
                                 VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT,
                                 VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT};
    device_.driver.next.CmdPipelineBarrier(commandBuffer_, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT,
                                           VK_PIPELINE_STAGE_ALL_COMMANDS_BIT | host, 0, 1, &memory, 0, nullptr, 0,
                                           nullptr);
}

std::vector<std::byte> InjectedWork::pushedConstants() const
{
    std::vector<std::byte> bytes(device_.injected.pushBytes());
    for (const CommandState::PushedConstants &earlier : state_->pushes) {
        if (earlier.offset < bytes.size())
            std::copy_n(earlier.bytes.begin(), std::min(earlier.bytes.size(), bytes.size() - earlier.offset),
                        bytes.data() + earlier.offset);
    }
    return bytes;
}

InjectedWork::~InjectedWork()
{
    if (!disturbed_ || !state_)
        return;
    const DeviceTable &next = device_.driver.next;
    if (!pushed_.empty()) { // the driver keeps those of the last dispatch, even if it is empty
        push(device_.injected.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, pushed_.data(), pushed_.size());
        next.CmdDispatch(commandBuffer_, 0, 1, 1);
    }
    if (state_->computePipeline) {
        next.CmdBindPipeline(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE, state_->computePipeline);
    } else if (state_->computeShader && next.CmdBindShadersEXT) {
        const VkShaderStageFlagBits stage = VK_SHADER_STAGE_COMPUTE_BIT;
        next.CmdBindShadersEXT(commandBuffer_, 1, &stage, &*state_->computeShader);
    }
    for (const CommandState::PushedConstants &earlier : state_->pushes)
        push(earlier.layout, earlier.stages, earlier.offset, earlier.bytes.data(), earlier.bytes.size());
    if (state_->conditionalRendering)
        next.CmdBeginConditionalRenderingEXT(commandBuffer_, &*state_->conditionalRendering);
}

} // namespace vellum::layer
