// SPDX-License-Identifier: Apache-2.0
#include "device_address/address_graphics.h"

#include "shaders/address_draws_feedback.h"
#include "shaders/address_draws_fragment.h"
#include "shaders/address_draws_mesh.h"
#include "shaders/address_draws_vertex.h"

namespace vt
{
namespace
{

constexpr VkFormat kFormat = VK_FORMAT_R32_UINT;

} // namespace

AddressGraphics::AddressGraphics(Gpu &gpu)
    : gpu_(gpu), image_(gpu, kFormat, kWidth, VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT),
      out_(gpu, kWidth * 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT)
{
    auto layout = vkInit<VkPipelineLayoutCreateInfo>();
    VT_CHECK(vkCreatePipelineLayout(gpu.device(), &layout, nullptr, &layout_));
}

AddressGraphics::~AddressGraphics()
{
    for (const VkPipeline pipeline : pipelines_)
        vkDestroyPipeline(gpu_.device(), pipeline, nullptr);
    vkDestroyPipelineLayout(gpu_.device(), layout_, nullptr);
}

VkPipeline AddressGraphics::pipeline(Kind kind)
{
    using Words = std::span<const uint32_t>;
    const Words first = kind == Kind::Mesh       ? Words(address_draws_mesh)
                        : kind == Kind::Feedback ? Words(address_draws_feedback)
                                                 : Words(address_draws_vertex);
    std::array<VkPipelineShaderStageCreateInfo, 2> stages{};
    for (size_t i = 0; i < 2; ++i) {
        stages[i] = vkInit<VkPipelineShaderStageCreateInfo>(
            {.stage = i == 1               ? VK_SHADER_STAGE_FRAGMENT_BIT
                      : kind == Kind::Mesh ? VK_SHADER_STAGE_MESH_BIT_EXT
                                           : VK_SHADER_STAGE_VERTEX_BIT,
             .module = gpu_.shader(i == 1 ? Words(address_draws_fragment) : first),
             .pName = "main"});
    }
    const std::array<VkVertexInputBindingDescription, 2> bindings{
        {{0, 4, VK_VERTEX_INPUT_RATE_VERTEX}, {1, 8, VK_VERTEX_INPUT_RATE_VERTEX}}};
    const std::array<VkVertexInputAttributeDescription, 2> attributes{{{0, 0, kFormat, 0}, {1, 1, kFormat, 0}}};
    auto input = vkInit<VkPipelineVertexInputStateCreateInfo>();
    input.vertexBindingDescriptionCount = input.vertexAttributeDescriptionCount = 2;
    input.pVertexBindingDescriptions = bindings.data();
    input.pVertexAttributeDescriptions = attributes.data();
    auto assembly = vkInit<VkPipelineInputAssemblyStateCreateInfo>({.topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST});
    const RowState state(kFormat, kWidth);
    const VkDynamicState stride = VK_DYNAMIC_STATE_VERTEX_INPUT_BINDING_STRIDE;
    auto dynamic = vkInit<VkPipelineDynamicStateCreateInfo>(
        {.dynamicStateCount = kind == Kind::DynamicStrides ? 1u : 0u, .pDynamicStates = &stride});
    auto info = vkInit<VkGraphicsPipelineCreateInfo>({.stageCount = 2,
                                                      .pStages = stages.data(),
                                                      .pVertexInputState = kind == Kind::Mesh ? nullptr : &input,
                                                      .pInputAssemblyState = kind == Kind::Mesh ? nullptr : &assembly,
                                                      .pDynamicState = &dynamic,
                                                      .layout = layout_});
    state.setIn(info);
    VkPipeline pipeline = VK_NULL_HANDLE;
    VT_CHECK(vkCreateGraphicsPipelines(gpu_.device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));
    pipelines_.push_back(pipeline);
    for (const VkPipelineShaderStageCreateInfo &stage : stages)
        vkDestroyShaderModule(gpu_.device(), stage.module, nullptr);
    return pipeline;
}

std::vector<uint32_t> AddressGraphics::render(VkPipeline pipeline, const std::function<void(VkCommandBuffer)> &record)
{
    const auto transition = [this](VkCommandBuffer commands, VkImageLayout before, VkImageLayout after) {
        auto ready = vkInit<VkImageMemoryBarrier2>();
        ready.srcStageMask = ready.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
        ready.srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT;
        ready.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
        ready.oldLayout = before;
        ready.newLayout = after;
        ready.srcQueueFamilyIndex = ready.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
        ready.image = image_.handle();
        ready.subresourceRange = RowImage::kAll;
        auto dependency = vkInit<VkDependencyInfo>({.imageMemoryBarrierCount = 1, .pImageMemoryBarriers = &ready});
        vkCmdPipelineBarrier2(commands, &dependency);
    };
    gpu_.submit([&](VkCommandBuffer commands) {
        transition(commands, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL);
        auto attachment = vkInit<VkRenderingAttachmentInfo>({.imageView = image_.view(),
                                                             .imageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
                                                             .loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR,
                                                             .storeOp = VK_ATTACHMENT_STORE_OP_STORE});
        auto rendering = vkInit<VkRenderingInfo>({.renderArea = {{0, 0}, {kWidth, 1}},
                                                  .layerCount = 1,
                                                  .colorAttachmentCount = 1,
                                                  .pColorAttachments = &attachment});
        vkCmdBeginRendering(commands, &rendering);
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
        record(commands);
        vkCmdEndRendering(commands);
        transition(commands, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
        VkBufferImageCopy region{};
        region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
        region.imageExtent = {kWidth, 1, 1};
        vkCmdCopyImageToBuffer(commands, image_.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, out_.handle(), 1,
                               &region);
    });
    const auto words = out_.as<uint32_t>();
    return {words.begin(), words.end()};
}

} // namespace vt
