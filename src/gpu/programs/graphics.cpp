// SPDX-License-Identifier: Apache-2.0
#include "gpu/programs/graphics.h"

#include <algorithm>

#include "gpu/micromap_commands.h"

namespace vellum::gpu
{
namespace
{

constexpr VkFormat kFormat = VK_FORMAT_R8G8B8A8_UNORM;
// Of the vertex buffers
constexpr uint32_t kFirstBinding = 1;
constexpr std::array<uint32_t, 2> kVertexStrides{4, 12};
constexpr uint32_t kMostDraws = LaunchPlan::kMostDraws;

} // namespace

RowImage::RowImage(Device &gpu, VkFormat format, uint32_t width, VkImageUsageFlags usage)
    : gpu_(gpu), image_(gpu, vkInit<VkImageCreateInfo>({.imageType = VK_IMAGE_TYPE_2D,
                                                        .format = format,
                                                        .extent = {width, 1, 1},
                                                        .mipLevels = 1,
                                                        .arrayLayers = 1,
                                                        .samples = VK_SAMPLE_COUNT_1_BIT,
                                                        .usage = usage}))
{
    auto view = vkInit<VkImageViewCreateInfo>(
        {.image = image_.handle(), .viewType = VK_IMAGE_VIEW_TYPE_2D, .format = format, .subresourceRange = kAll});
    CHECK_VK(vkCreateImageView(gpu.device(), &view, nullptr, &view_));
}

RowImage::~RowImage()
{
    vkDestroyImageView(gpu_.device(), view_, nullptr);
}

RowState::RowState(VkFormat colorFormat, uint32_t width)
    : format(colorFormat), viewport{0, 0, static_cast<float>(width), 1, 0, 1}, scissor{{0, 0}, {width, 1}},
      viewports(vkInit<VkPipelineViewportStateCreateInfo>(
          {.viewportCount = 1, .pViewports = &viewport, .scissorCount = 1, .pScissors = &scissor})),
      raster(vkInit<VkPipelineRasterizationStateCreateInfo>({.lineWidth = 1})),
      samples(vkInit<VkPipelineMultisampleStateCreateInfo>({.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT})),
      blend(vkInit<VkPipelineColorBlendStateCreateInfo>({.attachmentCount = 1, .pAttachments = &attachment})),
      rendering(vkInit<VkPipelineRenderingCreateInfo>({.colorAttachmentCount = 1, .pColorAttachmentFormats = &format}))
{
    attachment.colorWriteMask = 0xf;
}

void RowState::setIn(VkGraphicsPipelineCreateInfo &pipeline) const
{
    pipeline.pNext = &rendering;
    pipeline.pViewportState = &viewports;
    pipeline.pRasterizationState = &raster;
    pipeline.pMultisampleState = &samples;
    pipeline.pColorBlendState = &blend;
}

Graphics::Graphics(Device &gpu, VkPipelineLayout layout, const Shaders &shaders, uint32_t width)
    : gpu_(gpu), width_(width), mesh_(!shaders.mesh.empty()), vertexBuffers_(shaders.vertexBuffers),
      dynamicStrides_(shaders.dynamicStrides), points_(shaders.topology == VK_PRIMITIVE_TOPOLOGY_POINT_LIST),
      image_(gpu, kFormat, width, VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT)
{
    const VkDevice device = gpu.device();
    struct Source {
        VkShaderStageFlagBits stage;
        std::span<const uint32_t> original;
        std::vector<uint32_t> code; // of an inline module
        VkShaderModuleCreateInfo module{};
    };
    std::array<Source, 5> sources{{{VK_SHADER_STAGE_VERTEX_BIT, shaders.vertex},
                                   {VK_SHADER_STAGE_GEOMETRY_BIT, shaders.geometry},
                                   {VK_SHADER_STAGE_TASK_BIT_EXT, shaders.task},
                                   {VK_SHADER_STAGE_MESH_BIT_EXT, shaders.mesh},
                                   {VK_SHADER_STAGE_FRAGMENT_BIT, shaders.fragment}}};
    std::vector<VkPipelineShaderStageCreateInfo> stages; // the fragment shader's is last
    for (Source &source : sources) {
        if (source.original.empty())
            continue;
        source.code = gpu.code(source.original);
        source.module = vkInit<VkShaderModuleCreateInfo>(
            {.codeSize = source.code.size() * sizeof(uint32_t), .pCode = source.code.data()});
        auto stage = vkInit<VkPipelineShaderStageCreateInfo>(
            {.stage = source.stage, .pName = "main", .pSpecializationInfo = shaders.specialization});
        if (shaders.inlineModules)
            stage.pNext = &source.module;
        else
            stage.module = gpu.shader(source.original);
        stages.push_back(stage);
    }
    // Dynamic strides replace those of the pipeline.
    const uint32_t others = shaders.dynamicStrides ? 4 : 0;
    const std::array<VkVertexInputBindingDescription, 2> bindings{
        {{kFirstBinding, kVertexStrides[0] + others, VK_VERTEX_INPUT_RATE_VERTEX},
         {kFirstBinding + 1, kVertexStrides[1] + others, VK_VERTEX_INPUT_RATE_VERTEX}}};
    constexpr std::array<VkVertexInputAttributeDescription, 2> kAttributes{
        {{0, kFirstBinding, VK_FORMAT_R32_UINT, 0}, {1, kFirstBinding + 1, VK_FORMAT_R32_UINT, 0}}};
    auto input = vkInit<VkPipelineVertexInputStateCreateInfo>();
    if (vertexBuffers_) {
        input.vertexBindingDescriptionCount = bindings.size();
        input.pVertexBindingDescriptions = bindings.data();
        input.vertexAttributeDescriptionCount = kAttributes.size();
        input.pVertexAttributeDescriptions = kAttributes.data();
    }
    auto assembly = vkInit<VkPipelineInputAssemblyStateCreateInfo>({.topology = shaders.topology});
    RowState state(kFormat, width);
    state.rendering.pNext = shaders.pNext;
    auto pipeline = vkInit<VkGraphicsPipelineCreateInfo>();
    state.setIn(pipeline);
    pipeline.stageCount = static_cast<uint32_t>(stages.size());
    pipeline.pStages = stages.data();
    pipeline.pVertexInputState = &input;
    pipeline.pInputAssemblyState = &assembly;
    constexpr std::array kDynamic{VK_DYNAMIC_STATE_VERTEX_INPUT_BINDING_STRIDE};
    const auto dynamic = vkInit<VkPipelineDynamicStateCreateInfo>(
        {.dynamicStateCount = kDynamic.size(), .pDynamicStates = kDynamic.data()});
    if (dynamicStrides_)
        pipeline.pDynamicState = &dynamic;
    pipeline.layout = layout;
    if (shaders.libraries)
        link(pipeline);
    else
        CHECK_VK(vkCreateGraphicsPipelines(device, VK_NULL_HANDLE, 1, &pipeline, nullptr, &pipeline_));
    for (const VkPipelineShaderStageCreateInfo &stage : stages)
        vkDestroyShaderModule(device, stage.module, nullptr);
}

void Graphics::link(const VkGraphicsPipelineCreateInfo &whole)
{
    constexpr std::array<VkGraphicsPipelineLibraryFlagsEXT, 4> kParts{
        VK_GRAPHICS_PIPELINE_LIBRARY_VERTEX_INPUT_INTERFACE_BIT_EXT,
        VK_GRAPHICS_PIPELINE_LIBRARY_PRE_RASTERIZATION_SHADERS_BIT_EXT,
        VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_SHADER_BIT_EXT,
        VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_OUTPUT_INTERFACE_BIT_EXT};
    parts_.resize(kParts.size());
    for (size_t i = 0; i < kParts.size(); ++i) {
        auto library = vkInit<VkGraphicsPipelineLibraryCreateInfoEXT>(
            {.pNext = const_cast<void *>(whole.pNext), .flags = kParts[i]});
        VkGraphicsPipelineCreateInfo part = whole;
        part.pNext = &library;
        // which the part with the fragment shader must have
        auto depth = vkInit<VkPipelineDepthStencilStateCreateInfo>();
        part.pDepthStencilState = &depth;
        part.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        part.stageCount = i == 1 ? whole.stageCount - 1 : i == 2 ? 1 : 0;
        part.pStages = i == 2 ? whole.pStages + whole.stageCount - 1 : whole.pStages;
        CHECK_VK(vkCreateGraphicsPipelines(gpu_.device(), VK_NULL_HANDLE, 1, &part, nullptr, &parts_[i]));
    }
    auto libraries = vkInit<VkPipelineLibraryCreateInfoKHR>(
        {.libraryCount = static_cast<uint32_t>(parts_.size()), .pLibraries = parts_.data()});
    auto linked = vkInit<VkGraphicsPipelineCreateInfo>({.pNext = &libraries, .layout = whole.layout});
    CHECK_VK(vkCreateGraphicsPipelines(gpu_.device(), VK_NULL_HANDLE, 1, &linked, nullptr, &pipeline_));
}

Graphics::~Graphics()
{
    vkDestroyPipeline(gpu_.device(), pipeline_, nullptr);
    for (const VkPipeline part : parts_)
        vkDestroyPipeline(gpu_.device(), part, nullptr);
}

void Graphics::bind(VkCommandBuffer commands) const
{
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline_);
    if (indices_.size() == 0)
        return;
    std::array<VkBindVertexBuffer3InfoKHR, 2> infos{};
    for (size_t i = 0; i < infos.size(); ++i)
        infos[i] = vkInit<VkBindVertexBuffer3InfoKHR>(
            {.setStride = VkBool32{dynamicStrides_},
             .addressRange = {numbers_[i].address(), numbers_[i].size(), dynamicStrides_ ? kVertexStrides[i] : 0},
             .addressFlags = kUnknownUsage});
    gpu_.vk().CmdBindVertexBuffers3KHR(commands, kFirstBinding, infos.size(), infos.data());
    const auto indices = vkInit<VkBindIndexBuffer3InfoKHR>({.addressRange = {indices_.address(), indices_.size()},
                                                            .addressFlags = kUnknownUsage,
                                                            .indexType = VK_INDEX_TYPE_UINT32});
    gpu_.vk().CmdBindIndexBuffer3KHR(commands, &indices);
}

template <class Draw>
void Graphics::prepareDraws(const LaunchPlan &launch, const Draw &draw, uint32_t Draw::*vertices)
{
    struct Counted {
        std::array<Draw, kMostDraws> draws;
        uint32_t count;
    };
    counted_.reset();
    if (!launch.counted) {
        command_ = IndirectCommand(gpu_, launch, draw);
        return;
    }
    Draw first = draw;
    if (points_)
        first.*vertices = std::min(first.*vertices, 1u);
    command_ = IndirectCommand(gpu_, launch, Counted{{first, draw, {}}, 2});
    counted_ = {sizeof(Draw), offsetof(Counted, count)};
}

void Graphics::prepare(const LaunchPlan &launch, uint32_t vertices)
{
    vertices_ = vertices;
    if (mesh_)
        prepareDraws(launch, VkDrawMeshTasksIndirectCommandEXT{vertices, 1, 1},
                     &VkDrawMeshTasksIndirectCommandEXT::groupCountX);
    else if (vertexBuffers_)
        prepareDraws(launch, VkDrawIndexedIndirectCommand{vertices, 1, 0, 0, 0},
                     &VkDrawIndexedIndirectCommand::indexCount);
    else
        prepareDraws(launch, VkDrawIndirectCommand{vertices, 1, 0, 0}, &VkDrawIndirectCommand::vertexCount);
    if (!vertexBuffers_)
        return;
    const size_t count = std::max(vertices, 1u);
    std::vector<uint32_t> indices(count);
    std::array<std::vector<uint32_t>, 2> numbers;
    for (size_t b = 0; b < numbers.size(); ++b)
        numbers[b].resize(count * kVertexStrides[b] / 4);
    for (uint32_t i = 0; i < count; ++i) {
        indices[i] = static_cast<uint32_t>(count) - 1 - i;
        const uint32_t subtrahend = i * 0x9e3779b1u + 77;
        numbers[0][i * kVertexStrides[0] / 4] = i + subtrahend;
        numbers[1][i * kVertexStrides[1] / 4] = subtrahend;
    }
    indices_ = gpu_.upload(std::span<const uint32_t>(indices), VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
    for (size_t b = 0; b < numbers.size(); ++b)
        numbers_[b] = gpu_.upload(std::span<const uint32_t>(numbers[b]), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
}

void Graphics::recordDraw(VkCommandBuffer commands) const
{
    const Commands &vk = gpu_.vk();
    constexpr uint32_t kOne = 1;
    switch (command_.kind()) {
    case Launch::Direct:
        return mesh_            ? vk.CmdDrawMeshTasksEXT(commands, vertices_, 1, 1)
               : vertexBuffers_ ? vkCmdDrawIndexed(commands, vertices_, 1, 0, 0, 0)
                                : vkCmdDraw(commands, vertices_, 1, 0, 0);
    case Launch::Indirect: {
        if (counted_) {
            const auto draw = mesh_            ? vk.CmdDrawMeshTasksIndirectCountEXT
                              : vertexBuffers_ ? &vkCmdDrawIndexedIndirectCount
                                               : &vkCmdDrawIndirectCount;
            return draw(commands, command_.buffer(), command_.offset(), command_.buffer(),
                        command_.offset() + counted_->count, kMostDraws, counted_->stride);
        }
        const auto draw = mesh_            ? vk.CmdDrawMeshTasksIndirectEXT
                          : vertexBuffers_ ? &vkCmdDrawIndexedIndirect
                                           : &vkCmdDrawIndirect;
        return draw(commands, command_.buffer(), command_.offset(), kOne, 0);
    }
    case Launch::Indirect2: {
        const VkDeviceAddressRangeKHR range = command_.range();
        if (counted_) {
            const auto info = vkInit<VkDrawIndirectCount2InfoKHR>(
                {.addressRange = {range.address, kMostDraws * counted_->stride, counted_->stride},
                 .addressFlags = kUnknownUsage,
                 .countAddressRange = {range.address + counted_->count, sizeof(uint32_t)},
                 .countAddressFlags = kUnknownUsage,
                 .maxDrawCount = kMostDraws});
            const auto draw = mesh_            ? vk.CmdDrawMeshTasksIndirectCount2EXT
                              : vertexBuffers_ ? vk.CmdDrawIndexedIndirectCount2KHR
                                               : vk.CmdDrawIndirectCount2KHR;
            return draw(commands, &info);
        }
        const auto info = vkInit<VkDrawIndirect2InfoKHR>(
            {.addressRange = {range.address, range.size, 0}, .addressFlags = kUnknownUsage, .drawCount = kOne});
        const auto draw = mesh_            ? vk.CmdDrawMeshTasksIndirect2EXT
                          : vertexBuffers_ ? vk.CmdDrawIndexedIndirect2KHR
                                           : vk.CmdDrawIndirect2KHR;
        return draw(commands, &info);
    }
    }
}

void Graphics::draw(VkCommandBuffer commands) const
{
    render(commands, [&] { recordDraw(commands); });
}

void Graphics::draw(VkCommandBuffer commands, uint32_t vertices) const
{
    render(commands, [&] {
        if (mesh_)
            gpu_.vk().CmdDrawMeshTasksEXT(commands, vertices, 1, 1);
        else
            vkCmdDraw(commands, vertices, 1, 0, 0);
    });
}

void Graphics::render(VkCommandBuffer commands, const std::function<void()> &drawing) const
{
    auto ready = vkInit<VkImageMemoryBarrier2>({.dstStageMask = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT,
                                                .dstAccessMask = VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT,
                                                .newLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL});
    ready.srcQueueFamilyIndex = ready.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    ready.image = image_.handle();
    ready.subresourceRange = RowImage::kAll;
    auto dependency = vkInit<VkDependencyInfo>({.imageMemoryBarrierCount = 1, .pImageMemoryBarriers = &ready});
    vkCmdPipelineBarrier2(commands, &dependency);
    auto attachment = vkInit<VkRenderingAttachmentInfo>({.imageView = image_.view(),
                                                         .imageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
                                                         .loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR,
                                                         .storeOp = VK_ATTACHMENT_STORE_OP_STORE});
    auto rendering = vkInit<VkRenderingInfo>({.renderArea = {{0, 0}, {width_, 1}},
                                              .layerCount = 1,
                                              .colorAttachmentCount = 1,
                                              .pColorAttachments = &attachment});
    vkCmdBeginRendering(commands, &rendering);
    drawing();
    vkCmdEndRendering(commands);
}

} // namespace vellum::gpu
