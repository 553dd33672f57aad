// SPDX-License-Identifier: Apache-2.0
#include "cli/check/device.h"

#include "cli/vulkan/context.h"

namespace vellum::cli
{

DeviceSummary describeDevice(const check::SessionOptions &options)
{
    const Instance instance(options.layer);
    const DeviceInfo device = chooseDevice(instance, options.device);
    return {device.name, device.implementation, device.khrMicromaps, device.extMicromaps};
}

} // namespace vellum::cli
