// SPDX-License-Identifier: Apache-2.0
// Compaction of micromaps on the device (core/compaction.h): by queries of the compacted size and by compacting copies.
// Builds leave data in place; which triangles share data is found out here, and again for each query and copy, with the
// same result. The micromap itself is only read, so commands on other queues may use it at the same time.
#pragma once

#include <mutex>
#include <span>
#include <unordered_map>

#include <vulkan/vulkan.h>

#include "layer/state/acceleration_structure.h"

namespace vellum::layer
{

struct DeviceMicromaps;
class InjectedWork;

// The most that a micromap may have.
struct MicromapBound {
    uint64_t triangles = 0;
    VkDeviceSize bytes = 0;
};
// That of any micromap with so many bytes.
MicromapBound boundOf(VkDeviceSize bytes);

// Bounds of the micromaps in large handles, by their addresses. A handle may reach to the end of a buffer of hundreds
// of megabytes, and the scratch memory of a compaction must have tables for all triangles that the micromap may have. A
// bound is that of all micromaps that were ever recorded there: what is recorded last need not be executed yet. Without
// one, the size of the handle is the bound. A micromap with more triangles, which was recorded later, is left as it is;
// bounds only grow, so a copy that is recorded after a query fits in the size that the query reports.
class MicromapBounds
{
public:
    void record(VkDeviceAddress address, const MicromapBound &bound);
    [[nodiscard]] MicromapBound get(VkDeviceAddress address, VkDeviceSize size);

private:
    std::mutex mutex_;
    std::unordered_map<VkDeviceAddress, MicromapBound> bounds_;
};

// A micromap of at most that extent was recorded into, or written by the host to, a micromap's memory.
void recordMicromapBound(DeviceMicromaps &device, const Micromap &micromap, const MicromapBound &bound);
MicromapBound micromapBound(DeviceMicromaps &device, const Micromap &micromap);

// A query of the compacted size.
struct CompactedSize {
    Micromap micromap;
    VkDeviceAddress value = 0; // a 64-bit number, which has the size of the micromap
    bool marked = false;       // the size becomes kMicromapSizeMark modulo 256
};
void recordCompactedSizes(DeviceMicromaps &device, VkCommandBuffer commandBuffer, InjectedWork &work,
                          std::span<const CompactedSize> sizes);
// Records a compacting copy. A copy by micromap_move.comp must follow, with the address that is returned: micromaps
// that would not become smaller are copied as they are. 0: there is no memory.
VkDeviceAddress recordCompaction(DeviceMicromaps &device, VkCommandBuffer commandBuffer, InjectedWork &work,
                                 const Micromap &source, const Micromap &target);

} // namespace vellum::layer
