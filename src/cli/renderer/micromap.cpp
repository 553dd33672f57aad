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

std::unique_ptr<GpuMicromap> makeMicromap(Device &device, const Micromap &micromap)
{
    return device.micromapApi() == MicromapApi::Khr ? makeKhrMicromap(device, micromap)
                                                    : makeExtMicromap(device, micromap);
}

} // namespace vellum::cli
