// SPDX-License-Identifier: Apache-2.0
#include "gpu/launch.h"

#include <algorithm>

namespace vellum::gpu
{

void recordBindings(const Device &gpu, VkCommandBuffer commands, const Bindings &bindings, bool maintenance6)
{
    const auto size = static_cast<uint32_t>(bindings.constants.size());
    if (!maintenance6) {
        vkCmdBindDescriptorSets(commands, bindings.point, bindings.layout, 0, 1, &bindings.set, 0, nullptr);
        // All of them, and then the first half, which replaces only that.
        const uint32_t first = size / 8 * 4;
        std::vector<std::byte> all(bindings.constants.begin(), bindings.constants.end());
        std::fill_n(all.begin(), first, std::byte{0x5a});
        vkCmdPushConstants(commands, bindings.layout, bindings.stages, 0, size, all.data());
        vkCmdPushConstants(commands, bindings.layout, bindings.stages, 0, first, bindings.constants.data());
        return;
    }
    const auto sets = vkInit<VkBindDescriptorSetsInfoKHR>({.stageFlags = bindings.stages,
                                                           .layout = bindings.layout,
                                                           .descriptorSetCount = 1,
                                                           .pDescriptorSets = &bindings.set});
    gpu.vk().CmdBindDescriptorSets2KHR(commands, &sets);
    const auto constants = vkInit<VkPushConstantsInfoKHR>(
        {.layout = bindings.layout, .stageFlags = bindings.stages, .size = size, .pValues = bindings.constants.data()});
    gpu.vk().CmdPushConstants2KHR(commands, &constants);
}

} // namespace vellum::gpu
