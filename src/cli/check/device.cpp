// SPDX-License-Identifier: Apache-2.0
#include "cli/check/worker.h"

#include "gpu/device.h"
#include "gpu/device_selection.h"

namespace vellum::cli
{

DeviceSummary describeDevice(const WorkerOptions &options)
{
    const gpu::Instance instance(options.layer);
    const gpu::DeviceInfo device = options.device.from(instance);
    DeviceSummary summary{device.number,       device.name,         device.implementation,
                          device.khrMicromaps, device.extMicromaps, {}};
    for (const check::KnownFault &fault : check::knownFaults(device.handle, true))
        summary.knownFaults.push_back({std::string(fault.text), std::string(fault.response)});
    return summary;
}

} // namespace vellum::cli
