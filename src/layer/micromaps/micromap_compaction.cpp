// SPDX-License-Identifier: Apache-2.0
// Compaction of micromaps on the device (core/compaction.h): by queries of the compacted size and by compacting copies.
// Builds leave data in place; which triangles share data is found out here, and again for each query and copy, with the
// same result. The micromap itself is only read, so commands on other queues may use it at the same time.
#include <algorithm>
#include <vector>

#include "core/align.h"
#include "core/compaction.h"
#include "core/records.h"
#include "layer/micromaps/device_micromaps.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// Smaller handles need no bounds: the tables for as many triangles as they can have are small.
constexpr VkDeviceSize kLargeHandle = VkDeviceSize{4} << 20;
// Every bound is at least that of a micromap of this size.
constexpr VkDeviceSize kLeastBound = VkDeviceSize{256} << 10;
constexpr size_t kMostBounds = 1 << 16;
// Compactions of one command whose scratch memory has this size in total run side by side.
constexpr VkDeviceSize kScratchAtOnce = VkDeviceSize{64} << 20;

VkDeviceSize scratchBytes(const MicromapCompactPush &push)
{
    const uint64_t words = kCompactionTables + blocksOf(push.most) + 2 * uint64_t{push.partCapacity} +
                           kTriangleWords * uint64_t{push.most} + shareTable(push.most, kShareRounds);
    return words * 4;
}

MicromapCompactPush pushOf(DeviceMicromaps &device, const Micromap &source, const MicromapBound &bound)
{
    MicromapCompactPush push{};
    push.source = micromapAddress(device.driver, source);
    push.sourceUnits = static_cast<uint32_t>(std::min<VkDeviceSize>(source.size / kDataUnitBytes, UINT32_MAX));
    push.most = static_cast<uint32_t>(std::min<uint64_t>(bound.triangles, kMostSharing));
    push.partCapacity = static_cast<uint32_t>(
        std::min<VkDeviceSize>(bound.bytes / (VkDeviceSize{kPartUnits} * kDataUnitBytes), kMostSharing));
    push.root = device.objects.root.address();
    push.invocations = std::clamp(alignUp(push.most, 128), 128u, enoughInvocations(device.driver));
    return push;
}

InjectedShader shaderOf(uint32_t pass)
{
    switch (pass) {
    case kCompactAnalyse:
    case kCompactAnalyseParts: return InjectedShader::MicromapCompactAnalyse;
    case kCompactCount:
    case kCompactScan: return InjectedShader::MicromapCompactPlace;
    case kCompactWrite:
    case kCompactWriteParts: return InjectedShader::MicromapCompactWrite;
    default: return InjectedShader::MicromapCompactShare;
    }
}

// Records some passes of several compactions, pass by pass: they are not ordered among each other.
bool recordPasses(InjectedWork &work, std::span<MicromapCompactPush> pushes, uint32_t end)
{
    for (uint32_t pass = 0; pass < end; ++pass) {
        if (!work.prepare(shaderOf(pass)))
            return false;
    }
    for (uint32_t pass = 0; pass < end; ++pass) {
        const uint32_t groupSize = shaderOf(pass) == InjectedShader::MicromapCompactPlace ? 128 : 64;
        bool some = false;
        for (MicromapCompactPush &push : pushes) {
            const bool parts = pass == kCompactAnalyseParts || pass == kCompactWriteParts;
            if (parts && push.partCapacity < 2) // smaller than a triangle of level 7
                continue;
            some = true;
            push.pass = pass;
            work.dispatch(shaderOf(pass), push, pass == kCompactScan ? 1 : push.invocations, groupSize);
        }
        if (some)
            work.barrier();
    }
    return true;
}

} // namespace

MicromapBound boundOf(VkDeviceSize bytes)
{
    return {bytes / (kTriangleRecordWords * 4), bytes};
}

void MicromapBounds::record(VkDeviceAddress address, const MicromapBound &bound)
{
    std::lock_guard lock(mutex_);
    if (const auto known = bounds_.find(address); known != bounds_.end())
        known->second = {std::max(known->second.triangles, bound.triangles),
                         std::max(known->second.bytes, bound.bytes)};
    else if (bounds_.size() < kMostBounds)
        bounds_.emplace(address, bound);
}

MicromapBound MicromapBounds::get(VkDeviceAddress address, VkDeviceSize size)
{
    const MicromapBound least = boundOf(kLeastBound), most = boundOf(size);
    std::lock_guard lock(mutex_);
    const auto found = bounds_.find(address);
    if (found == bounds_.end())
        return most;
    return {std::clamp(found->second.triangles, least.triangles, most.triangles),
            std::clamp(found->second.bytes, least.bytes, most.bytes)};
}

void recordMicromapBound(DeviceMicromaps &device, const Micromap &micromap, const MicromapBound &bound)
{
    if (micromap.size > kLargeHandle)
        device.bounds.record(micromapAddress(device.driver, micromap), bound);
}

MicromapBound micromapBound(DeviceMicromaps &device, const Micromap &micromap)
{
    return micromap.size > kLargeHandle ? device.bounds.get(micromapAddress(device.driver, micromap), micromap.size)
                                        : boundOf(micromap.size);
}

void recordCompactedSizes(DeviceMicromaps &device, VkCommandBuffer commandBuffer, InjectedWork &work,
                          std::span<const CompactedSize> sizes)
{
    CommandState *const state = device.commands.states.get(commandBuffer);
    std::vector<MicromapCompactPush> pushes;
    VkDeviceSize total = 0;
    const auto record = [&] {
        const bool recorded = recordPasses(work, pushes, kCompactScan + 1);
        pushes.clear();
        total = 0;
        if (state)
            state->scratch.restart();
        return recorded;
    };
    if (state)
        state->scratch.restart();
    work.barrier();
    for (const CompactedSize &size : sizes) {
        if (size.micromap.size < kMicromapHeaderWords * 4)
            continue;
        MicromapCompactPush push = pushOf(device, size.micromap, micromapBound(device, size.micromap));
        if (!pushes.empty() && total + scratchBytes(push) > kScratchAtOnce && !record())
            return;
        push.scratch = state ? state->scratch.allocate(scratchBytes(push)) : 0;
        // Without memory, the query has the size of a clone, in which a compacted copy fits as well.
        if (push.scratch == 0)
            continue;
        push.value = size.value;
        push.mark = size.marked ? kQueryMarked : 0;
        total += scratchBytes(push);
        pushes.push_back(push);
    }
    if (!pushes.empty())
        record();
}

VkDeviceAddress recordCompaction(DeviceMicromaps &device, VkCommandBuffer commandBuffer, InjectedWork &work,
                                 const Micromap &source, const Micromap &target)
{
    CommandState *const state = device.commands.states.get(commandBuffer);
    // A target holds all triangles of what is compacted into it. A small one may have been recorded before they were.
    MicromapBound bound = micromapBound(device, source);
    bound.triangles = std::clamp(bound.triangles, boundOf(std::min({source.size, target.size, kLargeHandle})).triangles,
                                 boundOf(target.size).triangles);
    MicromapCompactPush push = pushOf(device, source, bound);
    if (state) {
        state->scratch.restart();
        push.scratch = state->scratch.allocate(scratchBytes(push));
    }
    push.target = micromapAddress(device.driver, target);
    push.targetBytes = target.size;
    work.barrier();
    return push.scratch != 0 && recordPasses(work, std::span(&push, 1), kCompactPasses) ? push.scratch : 0;
}

} // namespace vellum::layer
