#include "layer/base/dispatch.h"

namespace vellum::layer
{

void InstanceTable::load(VkInstance instance, PFN_vkGetInstanceProcAddr next, bool core)
{
    GetInstanceProcAddr = next;
#define VELLUM_LOAD(name, alias)                                                                                       \
    name = reinterpret_cast<PFN_vk##name>(next(instance, core ? "vk" #name : "vk" #alias));                            \
    if (!name)                                                                                                         \
        name = reinterpret_cast<PFN_vk##name>(next(instance, core ? "vk" #alias : "vk" #name));
    VELLUM_INSTANCE_COMMANDS(VELLUM_LOAD)
#undef VELLUM_LOAD
}

void DeviceTable::load(VkDevice device, PFN_vkGetDeviceProcAddr next)
{
    GetDeviceProcAddr = next;
#define VELLUM_LOAD(name, alias)                                                                                       \
    name = reinterpret_cast<PFN_vk##name>(next(device, "vk" #name));                                                   \
    if (!name)                                                                                                         \
        name = reinterpret_cast<PFN_vk##name>(next(device, "vk" #alias));
    VELLUM_DEVICE_COMMANDS(VELLUM_LOAD)
#undef VELLUM_LOAD
    CmdBindIndexBuffer2 = reinterpret_cast<newer::PFN_CmdBindIndexBuffer2>(next(device, "vkCmdBindIndexBuffer2"));
    if (!CmdBindIndexBuffer2)
        CmdBindIndexBuffer2 =
            reinterpret_cast<newer::PFN_CmdBindIndexBuffer2>(next(device, "vkCmdBindIndexBuffer2KHR"));
    CmdPushConstants2 = reinterpret_cast<newer::PFN_CmdPushConstants2>(next(device, "vkCmdPushConstants2"));
    if (!CmdPushConstants2)
        CmdPushConstants2 = reinterpret_cast<newer::PFN_CmdPushConstants2>(next(device, "vkCmdPushConstants2KHR"));
    MapMemory2 = reinterpret_cast<newer::PFN_MapMemory2>(next(device, "vkMapMemory2"));
    if (!MapMemory2)
        MapMemory2 = reinterpret_cast<newer::PFN_MapMemory2>(next(device, "vkMapMemory2KHR"));
    UnmapMemory2 = reinterpret_cast<newer::PFN_UnmapMemory2>(next(device, "vkUnmapMemory2"));
    if (!UnmapMemory2)
        UnmapMemory2 = reinterpret_cast<newer::PFN_UnmapMemory2>(next(device, "vkUnmapMemory2KHR"));
    CreateShadersEXT = reinterpret_cast<newer::PFN_CreateShaders>(next(device, "vkCreateShadersEXT"));
    GetShaderBinaryDataEXT = reinterpret_cast<newer::PFN_GetShaderBinaryData>(next(device, "vkGetShaderBinaryDataEXT"));
    CmdBindShadersEXT = reinterpret_cast<newer::PFN_CmdBindShaders>(next(device, "vkCmdBindShadersEXT"));
    CreatePipelineBinariesKHR =
        reinterpret_cast<newer::PFN_CreatePipelineBinaries>(next(device, "vkCreatePipelineBinariesKHR"));
    DestroyPipelineBinaryKHR =
        reinterpret_cast<newer::PFN_DestroyPipelineBinary>(next(device, "vkDestroyPipelineBinaryKHR"));
    GetPipelineKeyKHR = reinterpret_cast<newer::PFN_GetPipelineKey>(next(device, "vkGetPipelineKeyKHR"));
    GetPipelineBinaryDataKHR =
        reinterpret_cast<newer::PFN_GetPipelineBinaryData>(next(device, "vkGetPipelineBinaryDataKHR"));
}

} // namespace vellum::layer
