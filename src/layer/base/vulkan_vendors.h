// SPDX-License-Identifier: Apache-2.0
// Commands of extensions that the oldest supported headers do not know.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::newer
{

// VK_EXT_device_generated_commands
struct GeneratedCommandsInfo {
    VkStructureType sType;
    const void *pNext;
    VkShaderStageFlags shaderStages;
    uint64_t indirectExecutionSet;
    uint64_t indirectCommandsLayout;
    // addresses, sizes and counts follow
};
using PFN_CmdExecuteGeneratedCommands = void(VKAPI_PTR *)(VkCommandBuffer, VkBool32, const GeneratedCommandsInfo *);
// VK_QCOM_tile_shading
struct DispatchTileInfo {
    VkStructureType sType;
    const void *pNext;
};
using PFN_CmdDispatchTile = void(VKAPI_PTR *)(VkCommandBuffer, const DispatchTileInfo *);

// VK_KHR_maintenance10, VK_EXT_fragment_density_map_offset
using PFN_CmdEndRendering2 = void(VKAPI_PTR *)(VkCommandBuffer, const void *);

} // namespace vellum::newer
