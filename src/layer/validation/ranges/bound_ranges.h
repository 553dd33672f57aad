// SPDX-License-Identifier: Apache-2.0
// The parts of a sparse buffer that are bound to memory, in the order of vkQueueBindSparse.
#pragma once

#include <map>
#include <mutex>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

class BoundRanges
{
public:
    void set(VkDeviceSize begin, VkDeviceSize end, bool bound)
    {
        const std::lock_guard lock(mutex_);
        split(begin);
        split(end);
        ends_.erase(ends_.lower_bound(begin), ends_.lower_bound(end));
        if (bound && begin < end)
            ends_[begin] = end;
    }
    [[nodiscard]] bool contain(VkDeviceSize begin, VkDeviceSize end) const
    {
        const std::lock_guard lock(mutex_);
        while (begin < end) {
            auto part = ends_.upper_bound(begin);
            if (part == ends_.begin() || (--part)->second <= begin)
                return false;
            begin = part->second;
        }
        return true;
    }

private:
    // Makes a part end, and another begin, at `offset` if it is inside of one.
    void split(VkDeviceSize offset)
    {
        auto part = ends_.upper_bound(offset);
        if (part == ends_.begin() || (--part)->second <= offset || part->first == offset)
            return;
        ends_[offset] = part->second;
        part->second = offset;
    }

    mutable std::mutex mutex_;
    std::map<VkDeviceSize, VkDeviceSize> ends_; // of disjoint parts, by their beginnings
};

} // namespace vellum::layer
