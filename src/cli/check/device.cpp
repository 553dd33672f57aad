// SPDX-License-Identifier: Apache-2.0
#include "cli/check/device.h"

#include <algorithm>
#include <vector>

#include "check/gpu/known_faults.h"
#include "cli/vulkan/context.h"

namespace vellum::cli
{

DeviceSummary describeDevice(const check::SessionOptions &options)
{
    const Instance instance(options.layer);
    const DeviceInfo device = chooseDevice(instance, options.device);
    const std::vector<DeviceInfo> all = listDevices(instance);
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const DeviceInfo &info) { return info.handle == device.handle; });
    DeviceSummary summary{static_cast<size_t>(found - all.begin()),
                          device.name,
                          device.implementation,
                          device.khrMicromaps,
                          device.extMicromaps,
                          {}};
    for (const check::KnownFault &fault : check::knownFaults(device.handle, true))
        summary.knownFaults.push_back({std::string(fault.text), std::string(fault.response)});
    return summary;
}

} // namespace vellum::cli
