// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/sync/sync_references.h"

#include <unordered_map>

#include "layer/validation/sync/sync_checks.h"

namespace vellum::layer
{
namespace
{

// Builds whose instances are not known yet. Where there are more, all count as ordered.
constexpr size_t kMostBuilds = 4096;

} // namespace

void UnorderedBuilds::add(const std::shared_ptr<const StructureContents> &contents, const sync::Access &read,
                          std::vector<sync::Hazard> writes)
{
    const std::lock_guard lock(mutex_);
    if (builds_.size() == kMostBuilds)
        builds_.clear();
    builds_.push_back({contents, contents->instances.memory->submissions, read, std::move(writes)});
    any_ = true;
}

void UnorderedBuilds::check(DeviceModel &device, const Build &build, std::span<const VkDeviceAddress> references)
{
    std::unordered_map<VkDeviceAddress, const sync::Hazard *> writes;
    for (const sync::Hazard &write : build.writes)
        writes.emplace(write.earlier.reference, &write);
    const std::span<const uint32_t> masks = build.contents->instances.masks();
    const sync::Hazard *first = nullptr;
    sync::ByInstance by{build.read.object};
    for (uint32_t i = 0; i < references.size(); ++i) {
        // Whether a build reads what no ray can meet is not stated.
        const auto found = masks[i] != 0 ? writes.find(references[i]) : writes.end();
        if (found == writes.end())
            continue;
        if (first)
            ++by.others;
        else
            by.instance = i;
        first = first ? first : found->second;
        writes.erase(found);
    }
    if (!first)
        return;
    sync::Hazard hazard = *first;
    hazard.later.object = hazard.earlier.object;
    sync::report(device, hazard, &by);
}

void UnorderedBuilds::report(DeviceModel &device)
{
    if (!any_)
        return;
    const HeldMessages held;
    const std::lock_guard submissions(device.logs.submissions); // builds are submitted
    const std::lock_guard lock(mutex_);
    std::erase_if(builds_, [&](const Build &build) {
        const CapturedInstances &instances = build.contents->instances;
        if (instances.memory->submissions != build.submissions)
            return true; // it was submitted again, maybe with other instances
        const auto references = instances.references();
        if (references)
            check(device, build, *references);
        return references.has_value();
    });
    any_ = !builds_.empty();
}

namespace sync
{

void recordReferences(DeviceSync &sync, VkCommandBuffer commandBuffer, const input::Builds &builds,
                      const input::StructureBuild &build, const std::shared_ptr<const StructureContents> &contents)
{
    if (!sync.device.checks.sync || !contents->instances.memory)
        return;
    Access read;
    read.scope = {VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                  VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR};
    read.command = nameOf(builds.command);
    read.array = "pInfos";
    read.element = build.element;
    read.subject = "acceleration structure";
    read.object = build.given->dstAccelerationStructure;
    sync.device.logs.add(commandBuffer, [&sync, read, contents](const Submission &submission) {
        std::vector<Hazard> writes = sync.tracker.unorderedStructures(uint64_t(submission.queue), read);
        if (submission.ordered && !writes.empty())
            sync.unorderedBuilds.add(contents, read, std::move(writes));
    });
}

} // namespace sync
} // namespace vellum::layer
