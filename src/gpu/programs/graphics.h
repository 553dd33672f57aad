// SPDX-License-Identifier: Apache-2.0
// Graphics pipelines: points or one big triangle, drawn into an image of one row with dynamic rendering.
#pragma once

#include <cstdint>

#include "gpu/device.h"

namespace vellum::gpu
{

// An image of one row, with its memory and view.
class RowImage
{
public:
    RowImage(Device &gpu, VkFormat format, uint32_t width, VkImageUsageFlags usage);
    RowImage(const RowImage &) = delete;
    RowImage &operator=(const RowImage &) = delete;
    ~RowImage();
    [[nodiscard]] VkImage handle() const { return image_; }
    [[nodiscard]] VkImageView view() const { return view_; }

    static constexpr VkImageSubresourceRange kAll{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};

private:
    Device &gpu_;
    VkImage image_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkImageView view_ = VK_NULL_HANDLE;
};

// Fixed-function state of a pipeline that renders into an image of one row, without blending.
struct RowState {
    RowState(VkFormat colorFormat, uint32_t width);
    RowState(const RowState &) = delete;
    RowState &operator=(const RowState &) = delete;
    // Sets all of it in a pipeline that is created during the lifetime of this object; `rendering` becomes its pNext.
    void setIn(VkGraphicsPipelineCreateInfo &pipeline) const;

    VkFormat format;
    VkViewport viewport;
    VkRect2D scissor;
    VkPipelineColorBlendAttachmentState attachment{};
    VkPipelineViewportStateCreateInfo viewports;
    VkPipelineRasterizationStateCreateInfo raster;
    VkPipelineMultisampleStateCreateInfo samples;
    VkPipelineColorBlendStateCreateInfo blend;
    VkPipelineRenderingCreateInfo rendering;
};

class Graphics
{
public:
    struct Shaders {
        std::span<const uint32_t> vertex, fragment;
        bool inlineModules = false; // VkShaderModuleCreateInfo in the stages' pNext
        VkPrimitiveTopology topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
        const void *pNext = nullptr;                          // of the pipeline
        bool libraries = false;                               // it is linked of four (VK_EXT_graphics_pipeline_library)
        std::span<const uint32_t> geometry, task, mesh;       // mesh: instead of a vertex shader
        const VkSpecializationInfo *specialization = nullptr; // of all shaders
    };
    Graphics(Device &gpu, VkPipelineLayout layout, const Shaders &shaders, uint32_t width);
    Graphics(const Graphics &) = delete;
    Graphics &operator=(const Graphics &) = delete;
    ~Graphics();

    void bind(VkCommandBuffer commands) const
    {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline_);
    }
    // Renders with whatever is bound; with a mesh shader that many workgroups.
    void draw(VkCommandBuffer commands, uint32_t vertices) const;

private:
    void link(const VkGraphicsPipelineCreateInfo &whole);

    Device &gpu_;
    uint32_t width_;
    bool mesh_;
    RowImage image_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
    std::vector<VkPipeline> parts_;
};

} // namespace vellum::gpu
