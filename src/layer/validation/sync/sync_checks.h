// SPDX-License-Identifier: Apache-2.0
// The check of synchronization (`sync`): commands record their accesses and barriers in the log of their command
// buffer, and submission gives them to the tracker in the order of execution. Accesses of shaders are unknown. A render
// pass counts as ordered with everything before and after it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/handle_map.h"
#include "layer/input/builds.h"
#include "layer/validation/model/device_model.h"
#include "layer/validation/sync/sync_references.h"
#include "layer/validation/sync/sync_tracker.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceSync {
    DeviceModel &device;
    sync::Tracker tracker{};
    UnorderedBuilds unorderedBuilds{};
    HandleMap<VkSemaphore, bool> timelines{};
};

namespace sync
{

// --- Accesses of commands; nothing is recorded where `sync` is off.

void recordBuilds(DeviceSync &, VkCommandBuffer, const input::Builds &builds);

// The build of a top-level structure, after those of its command: what its instances name. `contents`: with the
// instances, if they are captured.
void recordReferences(DeviceSync &, VkCommandBuffer, const input::Builds &builds, const input::StructureBuild &build,
                      const std::shared_ptr<const StructureContents> &contents);

// Copies and queries of structures and micromaps. A null one is unknown.
void recordCopy(DeviceSync &, VkCommandBuffer, const char *command, const std::shared_ptr<ValidatedStructure> &source,
                const std::shared_ptr<ValidatedStructure> &target);
void recordSerialization(DeviceSync &, VkCommandBuffer, const char *command,
                         const std::shared_ptr<ValidatedStructure> &source, VkDeviceAddress target);
void recordDeserialization(DeviceSync &, VkCommandBuffer, const char *command, VkDeviceAddress source,
                           const std::shared_ptr<ValidatedStructure> &target);
void recordQuery(DeviceSync &, VkCommandBuffer, const char *command, const char *array,
                 const std::vector<std::shared_ptr<ValidatedStructure>> &structures);

// The command uses the query pool; null: an unknown one.
void recordUse(DeviceSync &, VkCommandBuffer, const char *command, const std::shared_ptr<ValidatedQueryPool> &pool);

// Transfers.
void recordCopy(DeviceSync &, VkCommandBuffer, const char *command, VkBuffer from, VkBuffer to,
                const VkBufferCopy &region, uint32_t index);
void recordWrite(DeviceSync &, VkCommandBuffer, const char *command, VkBuffer to, VkDeviceSize offset,
                 VkDeviceSize size);
void recordCopy(DeviceSync &, VkCommandBuffer, const VkCopyDeviceMemoryInfoKHR &);
void recordWrite(DeviceSync &, VkCommandBuffer, const char *command, const VkDeviceAddressRangeKHR &range);

// --- Order, between commands and with the host.

// The semaphores that a batch of a submission waits for and signals.
struct BatchSemaphores {
    std::vector<SemaphoreUse> waits, signals;
};
BatchSemaphores semaphoresOf(const DeviceSync &, const VkSubmitInfo &);
BatchSemaphores semaphoresOf(const DeviceSync &, const VkSubmitInfo2 &);
BatchSemaphores semaphoresOf(const DeviceSync &, const VkBindSparseInfo &);
// Around the steps of its command buffers. `ordered`: SubmissionTurn::await().
// The number of the batch on its queue; 0: when it is complete is not known.
uint64_t beginBatch(DeviceSync &, VkQueue, const std::vector<SemaphoreUse> &waits, bool ordered);
void endBatch(DeviceSync &, VkQueue, const std::vector<SemaphoreUse> &signals, bool ordered);
void signalFence(DeviceSync &, VkQueue, VkFence, bool ordered);

// The arguments of vkCmdPipelineBarrier and vkCmdWaitEvents.
struct PipelineBarrier {
    VkPipelineStageFlags from, to;
    uint32_t memoryCount;
    const VkMemoryBarrier *memory;
    uint32_t bufferCount;
    const VkBufferMemoryBarrier *buffers;
};
void recordBarriers(DeviceSync &, VkCommandBuffer, const PipelineBarrier &);
// Subpass dependencies may order anything, and are not followed.
void recordAll(DeviceSync &, VkCommandBuffer);
void recordBarriers(DeviceSync &, VkCommandBuffer, const VkDependencyInfo &);
void recordSet(DeviceSync &, VkCommandBuffer, VkEvent);
void recordReset(DeviceSync &, VkCommandBuffer, VkEvent);
void recordWait(DeviceSync &, VkCommandBuffer, uint32_t, const VkEvent *, const PipelineBarrier &);
void recordWait(DeviceSync &, VkCommandBuffer, uint32_t, const VkEvent *, const VkDependencyInfo *);

// Called after a successful wait of the host. `all`: for all fences, not for any.
void fencesComplete(DeviceSync &, VkDevice, uint32_t, const VkFence *, bool all);
void semaphoresReached(DeviceSync &, VkDevice, const VkSemaphoreWaitInfo &);
// Before an object is destroyed, and a buffer cannot be found by its address any more. `rule`: that commands which
// refer to it must be complete. Returns whether that is so, as far as it is known.
bool checkUnused(DeviceSync &, const Place &command, const char *rule, const ReferredObject &);

// --- For the files of this folder.

// Memory, and what a message names for it.
struct Location {
    Range range; // empty: unknown, or of no interest
    bool exclusive = false;
    ObjectHandle object;
    std::shared_ptr<ReferredObject> buffer{}; // to which the command refers; null: to none
    VkDeviceAddress address = 0;              // by which it does
};

// The first bytes of a structure, which nothing but the structure accesses: how much of its size commands access is not
// known, and sizes may overlap.
Location locationOf(const ValidatedStructure *structure);
Location locationAt(const DeviceModel &device, VkDeviceAddress address, VkDeviceSize size);
// The location for buffers that structures or their builds may access; empty for others.
Location locationIn(const DeviceModel &device, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize size);

// For example "vkCmdBuildMicromapsEXT: pInfos[2]". `Part`: Access or CommandUse.
template <typename Part>
std::string placeOf(const Part &part)
{
    const Place command(part.command);
    return part.array ? command.element(part.array, part.element).text() : command.text();
}
// The structure of the later access is that of an instance.
struct ByInstance {
    ObjectHandle top; // the structure that has the instance
    uint32_t instance = 0;
    size_t others = 0; // structures of further instances, of which the same is true
};
void report(DeviceModel &device, const Hazard &hazard, const ByInstance *by = nullptr);
// Structures that a submitted command refers to.
void reportDestroyed(DeviceModel &device, const Submission &submission, const char *command,
                     const std::vector<std::shared_ptr<ValidatedStructure>> &structures);

} // namespace sync
} // namespace vellum::layer
