// SPDX-License-Identifier: Apache-2.0
// Which graphics pipelines have shader stages. Others may have any pointer there.
#include "layer/base/pipeline_info.h"
#include "vk/vk_init.h"

#include <gtest/gtest.h>

namespace
{

using vellum::layer::hasShaderStages;

TEST(PipelineInfo, ShaderStages)
{
    const auto info = vkInit<VkGraphicsPipelineCreateInfo>();
    EXPECT_TRUE(hasShaderStages(info));

    auto linked = vkInit<VkPipelineLibraryCreateInfoKHR>({.libraryCount = 1});
    auto linking = vkInit<VkGraphicsPipelineCreateInfo>({.pNext = &linked});
    EXPECT_FALSE(hasShaderStages(linking));
    linked.libraryCount = 0;
    EXPECT_TRUE(hasShaderStages(linking));

    EXPECT_FALSE(hasShaderStages(vkInit<VkGraphicsPipelineCreateInfo>({.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR})));
}

TEST(PipelineInfo, ShaderStagesOfLibraries)
{
    const auto linked = vkInit<VkPipelineLibraryCreateInfoKHR>({.libraryCount = 1});
    const struct {
        VkGraphicsPipelineLibraryFlagsEXT parts;
        bool shaders;
    } cases[] = {{0, false},
                 {VK_GRAPHICS_PIPELINE_LIBRARY_VERTEX_INPUT_INTERFACE_BIT_EXT, false},
                 {VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_OUTPUT_INTERFACE_BIT_EXT, false},
                 {VK_GRAPHICS_PIPELINE_LIBRARY_PRE_RASTERIZATION_SHADERS_BIT_EXT, true},
                 {VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_SHADER_BIT_EXT, true}};
    for (const auto &c : cases) {
        const auto library = vkInit<VkGraphicsPipelineLibraryCreateInfoEXT>(
            {.pNext = const_cast<VkPipelineLibraryCreateInfoKHR *>(&linked), .flags = c.parts});
        EXPECT_EQ(hasShaderStages(vkInit<VkGraphicsPipelineCreateInfo>(
                      {.pNext = &library, .flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR})),
                  c.shaders)
            << c.parts;
    }
}

} // namespace
