// SPDX-License-Identifier: Apache-2.0
// Graphics pipelines: points or one big triangle, drawn into an image of one row with dynamic rendering.
#pragma once

#include <cstdint>

#include "gpu/launch.h"

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
    [[nodiscard]] VkImage handle() const { return image_.handle(); }
    [[nodiscard]] VkImageView view() const { return view_; }

    static constexpr VkImageSubresourceRange kAll{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};

private:
    Device &gpu_;
    DeviceImage image_;
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
        // Vertices have two numbers, whose difference is the number of the vertex, in buffers that are bound by
        // addresses, and come by indices. They are drawn once, in reverse order. VK_KHR_device_address_commands
        bool vertexBuffers = false;
        bool dynamicStrides = false; // of the buffers: set when they are bound
    };
    Graphics(Device &gpu, VkPipelineLayout layout, const Shaders &shaders, uint32_t width);
    Graphics(const Graphics &) = delete;
    Graphics &operator=(const Graphics &) = delete;
    ~Graphics();

    void bind(VkCommandBuffer commands) const;
    // Renders with whatever is bound; with a mesh shader that many workgroups.
    void draw(VkCommandBuffer commands, uint32_t vertices) const;
    // The same by a command of that form.
    void prepare(const LaunchPlan &launch, uint32_t vertices);
    void draw(VkCommandBuffer commands) const;

private:
    // Where the draws and their number are in the parameters of an indirect command.
    struct CountedDraws {
        uint32_t stride;
        VkDeviceSize count;
    };
    template <class Draw>
    void prepareDraws(const LaunchPlan &launch, const Draw &draw, uint32_t Draw::*vertices);
    void link(const VkGraphicsPipelineCreateInfo &whole);
    void render(VkCommandBuffer commands, const std::function<void()> &drawing) const;
    void recordDraw(VkCommandBuffer commands) const;

    Device &gpu_;
    uint32_t width_;
    bool mesh_;
    bool vertexBuffers_, dynamicStrides_;
    std::array<Buffer, 2> numbers_; // of vertices
    Buffer indices_;
    uint32_t vertices_ = 0;
    bool points_;
    std::optional<CountedDraws> counted_;
    IndirectCommand command_;
    RowImage image_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
    std::vector<VkPipeline> parts_;
};

} // namespace vellum::gpu
