// SPDX-License-Identifier: Apache-2.0
#include "cli/check/device.h"

#include "check/gpu/known_faults.h"
#include "cli/vulkan/context.h"

namespace vellum::cli
{

DeviceSummary describeDevice(const WorkerOptions &options)
{
    const Instance instance(options.layer);
    const DeviceInfo device = chooseDevice(instance, options.device);
    DeviceSummary summary{device.number,       device.name,         device.implementation,
                          device.khrMicromaps, device.extMicromaps, {}};
    for (const check::KnownFault &fault : check::knownFaults(device.handle, true))
        summary.knownFaults.push_back({std::string(fault.text), std::string(fault.response)});
    return summary;
}

} // namespace vellum::cli
