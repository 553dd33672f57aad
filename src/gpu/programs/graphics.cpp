// SPDX-License-Identifier: Apache-2.0
#include "gpu/programs/graphics.h"

namespace vellum::gpu
{
namespace
{

constexpr VkFormat kFormat = VK_FORMAT_R8G8B8A8_UNORM;

} // namespace

RowImage::RowImage(Device &gpu, VkFormat format, uint32_t width, VkImageUsageFlags usage) : gpu_(gpu)
{
    const VkDevice device = gpu.device();
    auto image = vkInit<VkImageCreateInfo>({.imageType = VK_IMAGE_TYPE_2D, .format = format, .extent = {width, 1, 1}});
    image.mipLevels = image.arrayLayers = 1;
    image.samples = VK_SAMPLE_COUNT_1_BIT;
    image.usage = usage;
    CHECK_VK(vkCreateImage(device, &image, nullptr, &image_));
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(device, image_, &needs);
    auto allocation = vkInit<VkMemoryAllocateInfo>(
        {.allocationSize = needs.size, .memoryTypeIndex = gpu.memoryType(needs.memoryTypeBits, 0)});
    CHECK_VK(vkAllocateMemory(device, &allocation, nullptr, &memory_));
    CHECK_VK(vkBindImageMemory(device, image_, memory_, 0));
    auto view = vkInit<VkImageViewCreateInfo>(
        {.image = image_, .viewType = VK_IMAGE_VIEW_TYPE_2D, .format = format, .subresourceRange = kAll});
    CHECK_VK(vkCreateImageView(device, &view, nullptr, &view_));
}

RowImage::~RowImage()
{
    vkDestroyImageView(gpu_.device(), view_, nullptr);
    vkDestroyImage(gpu_.device(), image_, nullptr);
    vkFreeMemory(gpu_.device(), memory_, nullptr);
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
    : gpu_(gpu), width_(width), mesh_(!shaders.mesh.empty()),
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
    auto input = vkInit<VkPipelineVertexInputStateCreateInfo>();
    auto assembly = vkInit<VkPipelineInputAssemblyStateCreateInfo>({.topology = shaders.topology});
    RowState state(kFormat, width);
    state.rendering.pNext = shaders.pNext;
    auto pipeline = vkInit<VkGraphicsPipelineCreateInfo>();
    state.setIn(pipeline);
    pipeline.stageCount = static_cast<uint32_t>(stages.size());
    pipeline.pStages = stages.data();
    pipeline.pVertexInputState = &input;
    pipeline.pInputAssemblyState = &assembly;
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

void Graphics::draw(VkCommandBuffer commands, uint32_t vertices) const
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
    if (mesh_)
        gpu_.vk().CmdDrawMeshTasksEXT(commands, vertices, 1, 1);
    else
        vkCmdDraw(commands, vertices, 1, 0, 0);
    vkCmdEndRendering(commands);
}

} // namespace vellum::gpu
