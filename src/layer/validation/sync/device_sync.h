// SPDX-License-Identifier: Apache-2.0
// The part of validation that checks synchronization (`sync`): commands record their accesses and barriers in the log
// of their command buffer, and submission gives them to the tracker in the order of execution. What only shaders access
// is unknown to it: traces and dispatches. A render pass counts as ordered with everything before and after it.
#pragma once

#include <array>
#include <atomic>

#include "layer/base/handle_map.h"
#include "layer/validation/sync/sync_tracker.h"

namespace vellum::layer
{

// The smallest size of scratch memory that the implementation reported for builds of a kind: what every build of that
// kind accesses.
class ScratchSizes
{
public:
    void reported(VkAccelerationStructureBuildTypeKHR where, const VkMicromapBuildSizesInfoEXT &sizes)
    {
        reported(where, kMicromapExt, sizes.buildScratchSize);
    }
    void reported(VkAccelerationStructureBuildTypeKHR where, VkAccelerationStructureTypeKHR type,
                  const VkAccelerationStructureBuildSizesInfoKHR &sizes)
    {
        reported(where, kindOf(type, false), sizes.buildScratchSize);
        reported(where, kindOf(type, true), sizes.updateScratchSize);
    }
    // 0: none, or unknown.
    [[nodiscard]] uint64_t smallest(size_t kind) const
    {
        const uint64_t size = sizes_[kind].load();
        return size == 0 ? 0 : size - 1;
    }
    static constexpr size_t kMicromapExt = 0;
    static size_t kindOf(VkAccelerationStructureTypeKHR type, bool update)
    {
        const size_t number = type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR      ? 0
                              : type == VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR ? 1
                                                                                        : 2;
        return 1 + 2 * number + (update ? 1 : 0);
    }

private:
    void reported(VkAccelerationStructureBuildTypeKHR where, size_t kind, uint64_t size)
    {
        uint64_t known = sizes_[kind].load();
        while (where != VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_KHR && (known == 0 || size < known - 1) &&
               !sizes_[kind].compare_exchange_weak(known, size + 1)) {
        }
    }

    std::array<std::atomic<uint64_t>, 7> sizes_{}; // 1 more; 0: unknown
};

struct DeviceSync {
    sync::Tracker tracker;
    HandleMap<VkSemaphore, bool> timelines;
    ScratchSizes scratch;
};

} // namespace vellum::layer
