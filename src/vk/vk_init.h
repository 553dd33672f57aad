// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "vk/structure_types.h"

// A Vulkan structure with its sType: vkInit<VkBufferCreateInfo>({.size = 64, .usage = usage}).
template <typename T>
[[nodiscard]] constexpr T vkInit(T structure = {})
{
    structure.sType = StructureType<T>::value;
    return structure;
}
