// SPDX-License-Identifier: Apache-2.0
#include "cli/renderer/acceleration.h"

namespace vellum::cli
{

GpuMicromap::GpuMicromap(Device &device, const Micromap &micromap)
    : device_(device), indices_(uploadBuffer(device, std::as_bytes(std::span(micromap.indices)),
                                             VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                                                 VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR))
{
}

void GpuMicromap::run(const std::function<void(VkCommandBuffer)> &recordBuild)
{
    const GpuTimer timer(device_);
    buildTime_ = timer.time([&] {
        device_.run([&](VkCommandBuffer commands) {
            timer.begin(commands);
            recordBuild(commands);
            timer.end(commands);
        });
    });
}

std::unique_ptr<GpuMicromap> makeMicromap(Device &device, const Micromap &micromap)
{
    return device.micromapApi() == MicromapApi::Khr ? makeKhrMicromap(device, micromap)
                                                    : makeExtMicromap(device, micromap);
}

} // namespace vellum::cli
