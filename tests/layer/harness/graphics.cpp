#include "harness/graphics.h"

namespace vt
{
namespace
{

constexpr VkFormat kFormat = VK_FORMAT_R8G8B8A8_UNORM;

} // namespace

RowImage::RowImage(Gpu &gpu, VkFormat format, uint32_t width, VkImageUsageFlags usage) : gpu_(gpu)
{
    const VkDevice device = gpu.device();
    VkImageCreateInfo image{};
    image.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
    image.imageType = VK_IMAGE_TYPE_2D;
    image.format = format;
    image.extent = {width, 1, 1};
    image.mipLevels = image.arrayLayers = 1;
    image.samples = VK_SAMPLE_COUNT_1_BIT;
    image.usage = usage;
    VT_CHECK(vkCreateImage(device, &image, nullptr, &image_));
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(device, image_, &needs);
    VkMemoryAllocateInfo allocation{};
    allocation.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
    allocation.allocationSize = needs.size;
    allocation.memoryTypeIndex = gpu.memoryType(needs.memoryTypeBits, 0);
    VT_CHECK(vkAllocateMemory(device, &allocation, nullptr, &memory_));
    VT_CHECK(vkBindImageMemory(device, image_, memory_, 0));
    VkImageViewCreateInfo view{};
    view.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
    view.image = image_;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = format;
    view.subresourceRange = kAll;
    VT_CHECK(vkCreateImageView(device, &view, nullptr, &view_));
}

RowImage::~RowImage()
{
    vkDestroyImageView(gpu_.device(), view_, nullptr);
    vkDestroyImage(gpu_.device(), image_, nullptr);
    vkFreeMemory(gpu_.device(), memory_, nullptr);
}

Graphics::Graphics(Gpu &gpu, VkPipelineLayout layout, const Shaders &shaders, uint32_t width)
    : gpu_(gpu), width_(width), image_(gpu, kFormat, width, VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT)
{
    const VkDevice device = gpu.device();
    std::array<std::vector<uint32_t>, 2> code; // of inline modules
    std::array<VkShaderModuleCreateInfo, 2> modules{};
    std::array<VkPipelineShaderStageCreateInfo, 2> stages{};
    for (size_t i = 0; i < 2; ++i) {
        const auto original = i == 0 ? shaders.vertex : shaders.fragment;
        const auto &words = code[i] = gpu.code(original);
        modules[i].sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
        modules[i].codeSize = words.size() * sizeof(uint32_t);
        modules[i].pCode = words.data();
        stages[i].sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
        stages[i].stage = i == 0 ? VK_SHADER_STAGE_VERTEX_BIT : VK_SHADER_STAGE_FRAGMENT_BIT;
        stages[i].pName = "main";
        if (shaders.inlineModules)
            stages[i].pNext = &modules[i];
        else
            stages[i].module = gpu.shader(original);
    }
    VkPipelineVertexInputStateCreateInfo input{};
    input.sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO;
    VkPipelineInputAssemblyStateCreateInfo assembly{};
    assembly.sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO;
    assembly.topology = shaders.topology;
    const VkViewport viewport{0, 0, static_cast<float>(width), 1, 0, 1};
    const VkRect2D scissor{{0, 0}, {width, 1}};
    VkPipelineViewportStateCreateInfo viewports{};
    viewports.sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO;
    viewports.viewportCount = viewports.scissorCount = 1;
    viewports.pViewports = &viewport;
    viewports.pScissors = &scissor;
    VkPipelineRasterizationStateCreateInfo raster{};
    raster.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO;
    raster.lineWidth = 1;
    VkPipelineMultisampleStateCreateInfo samples{};
    samples.sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO;
    samples.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
    VkPipelineColorBlendAttachmentState attachment{};
    attachment.colorWriteMask = 0xf;
    VkPipelineColorBlendStateCreateInfo blend{};
    blend.sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO;
    blend.attachmentCount = 1;
    blend.pAttachments = &attachment;
    VkPipelineRenderingCreateInfo rendering{};
    rendering.sType = VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO;
    rendering.colorAttachmentCount = 1;
    rendering.pColorAttachmentFormats = &kFormat;
    VkGraphicsPipelineCreateInfo pipeline{};
    pipeline.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO;
    rendering.pNext = shaders.pNext;
    pipeline.pNext = &rendering;
    pipeline.stageCount = 2;
    pipeline.pStages = stages.data();
    pipeline.pVertexInputState = &input;
    pipeline.pInputAssemblyState = &assembly;
    pipeline.pViewportState = &viewports;
    pipeline.pRasterizationState = &raster;
    pipeline.pMultisampleState = &samples;
    pipeline.pColorBlendState = &blend;
    pipeline.layout = layout;
    if (shaders.libraries)
        link(pipeline);
    else
        VT_CHECK(vkCreateGraphicsPipelines(device, VK_NULL_HANDLE, 1, &pipeline, nullptr, &pipeline_));
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
        VkGraphicsPipelineLibraryCreateInfoEXT library{};
        library.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_LIBRARY_CREATE_INFO_EXT;
        library.pNext = const_cast<void *>(whole.pNext);
        library.flags = kParts[i];
        VkGraphicsPipelineCreateInfo part = whole;
        part.pNext = &library;
        VkPipelineDepthStencilStateCreateInfo depth{}; // which the part with the fragment shader must have
        depth.sType = VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO;
        part.pDepthStencilState = &depth;
        part.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        part.stageCount = i == 1 || i == 2 ? 1 : 0;
        part.pStages = i == 2 ? whole.pStages + 1 : whole.pStages;
        VT_CHECK(vkCreateGraphicsPipelines(gpu_.device(), VK_NULL_HANDLE, 1, &part, nullptr, &parts_[i]));
    }
    VkPipelineLibraryCreateInfoKHR libraries{};
    libraries.sType = VK_STRUCTURE_TYPE_PIPELINE_LIBRARY_CREATE_INFO_KHR;
    libraries.libraryCount = static_cast<uint32_t>(parts_.size());
    libraries.pLibraries = parts_.data();
    VkGraphicsPipelineCreateInfo linked{};
    linked.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO;
    linked.pNext = &libraries;
    linked.layout = whole.layout;
    VT_CHECK(vkCreateGraphicsPipelines(gpu_.device(), VK_NULL_HANDLE, 1, &linked, nullptr, &pipeline_));
}

Graphics::~Graphics()
{
    vkDestroyPipeline(gpu_.device(), pipeline_, nullptr);
    for (const VkPipeline part : parts_)
        vkDestroyPipeline(gpu_.device(), part, nullptr);
}

void Graphics::draw(VkCommandBuffer commands, uint32_t vertices) const
{
    VkImageMemoryBarrier2 ready{};
    ready.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2;
    ready.dstStageMask = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT;
    ready.dstAccessMask = VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT;
    ready.newLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    ready.srcQueueFamilyIndex = ready.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    ready.image = image_.handle();
    ready.subresourceRange = RowImage::kAll;
    VkDependencyInfo dependency{};
    dependency.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO;
    dependency.imageMemoryBarrierCount = 1;
    dependency.pImageMemoryBarriers = &ready;
    vkCmdPipelineBarrier2(commands, &dependency);
    VkRenderingAttachmentInfo attachment{};
    attachment.sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO;
    attachment.imageView = image_.view();
    attachment.imageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    attachment.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
    attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    VkRenderingInfo rendering{};
    rendering.sType = VK_STRUCTURE_TYPE_RENDERING_INFO;
    rendering.renderArea = {{0, 0}, {width_, 1}};
    rendering.layerCount = 1;
    rendering.colorAttachmentCount = 1;
    rendering.pColorAttachments = &attachment;
    vkCmdBeginRendering(commands, &rendering);
    vkCmdDraw(commands, vertices, 1, 0, 0);
    vkCmdEndRendering(commands);
}

} // namespace vt
