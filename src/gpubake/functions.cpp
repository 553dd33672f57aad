// SPDX-License-Identifier: Apache-2.0
#include "gpubake/functions.h"

namespace vellum::gpubake
{

bool Functions::load(VkDevice device, PFN_vkGetDeviceProcAddr getDeviceProcAddr)
{
    if (getDeviceProcAddr == nullptr)
        return false;
#define VELLUM_GPU_BAKE_LOAD(name)                                                                                     \
    name = reinterpret_cast<PFN_vk##name>(getDeviceProcAddr(device, "vk" #name));                                      \
    if (name == nullptr)                                                                                               \
        return false;
    VELLUM_GPU_BAKE_FUNCTIONS(VELLUM_GPU_BAKE_LOAD)
#undef VELLUM_GPU_BAKE_LOAD
    return true;
}

} // namespace vellum::gpubake
