// SPDX-License-Identifier: Apache-2.0
// The build of a top-level structure reads the structures that its instances name, in the stage
// ACCELERATION_STRUCTURE_BUILD with the access ACCELERATION_STRUCTURE_READ ("read access to an acceleration structure
// as part of a trace, build, or copy command"). Which these are is known once the build is complete: until then, the
// writes that nothing orders before the build are kept.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "layer/validation/model/device_model.h"
#include "layer/validation/sync/sync_tracker.h"

namespace vellum::layer
{

// Builds of top-level structures that something unordered was written before.
class UnorderedBuilds
{
public:
    // The build is submitted. `read`: what its messages name. CommandLogs::submissions is held.
    void add(const std::shared_ptr<const StructureContents> &contents, const sync::Access &read,
             std::vector<sync::Hazard> writes);
    // Reports builds of which the instances are known now.
    void report(DeviceModel &device);

private:
    struct Build {
        std::shared_ptr<const StructureContents> contents;
        uint32_t submissions = 0; // of the build, with this one
        sync::Access read;
        std::vector<sync::Hazard> writes;
    };
    static void check(DeviceModel &device, const Build &build, std::span<const VkDeviceAddress> references);

    std::atomic<bool> any_ = false; // read without the mutex
    std::mutex mutex_;
    std::vector<Build> builds_;
};

} // namespace vellum::layer
