// SPDX-License-Identifier: Apache-2.0
// The locations of acceleration structures. What was built belongs to the location and not to a handle: an application
// with its own allocator may create several handles for the same content, each as large as the rest of the buffer, and
// destroy them in any order.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/state/root_table.h"

namespace vellum::layer
{

struct AccelerationStructure;
class PlacedMicromaps; // khr_over_ext/placed_micromaps.h

// The state shared by all acceleration structures that begin at the same location.
struct StructureLocation {
    explicit StructureLocation(RootTable &table) : root(table) {}
    ~StructureLocation();
    StructureLocation(const StructureLocation &) = delete;
    StructureLocation &operator=(const StructureLocation &) = delete;

    RootTable &root;
    uint32_t users = 0; // guarded by StructureLocations
    std::mutex mutex;   // guards what is below
    // The structures that begin here and whose handles exist.
    AccelerationStructure *first = nullptr; // of a list by nextAtLocation
    // The addresses that were queried, by which instances may name the structures. Each is a user of the descriptor.
    // Only a GENERIC structure has to have the address of the buffer (vkGetAccelerationStructureDeviceAddressKHR), so
    // there may be several. The driver may reuse an address that no structure here has any more.
    struct Reference {
        VkDeviceAddress address = 0;
        uint32_t structures = 0;
    };
    std::vector<Reference> references;
    VkDeviceAddress heldKey = 0; // synthetic key of the descriptor, if no address leads to it; 0 = none
    StructureDescriptor descriptor;
    // The type of what was recorded last; GENERIC: nothing, or data whose type only the device knows.
    VkAccelerationStructureTypeKHR content = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    VkDeviceSize lastBytes =
        0; // size of what was recorded last, which may be less than that of the handle; 0 = unknown
    // Number of the last deserialization whose result only the device knows; 0 = none. The descriptor contains the
    // result as soon as it contains this number.
    uint32_t deserialization = 0;
    uint32_t lastInstances = 0; // of the top-level build recorded last
    uint32_t mostInstances = 0; // the greatest number of all builds recorded
    std::shared_ptr<SlotRange> slots;
    // Too few by now, but the content of the structure, or commands that build it, may still use them.
    std::vector<std::shared_ptr<SlotRange>> outgrownSlots;
    // If micromaps are translated: the driver's micromaps at this location, and whether a bottom-level structure with
    // micromaps was recorded last.
    std::shared_ptr<PlacedMicromaps> driverMicromaps;
    bool namesMicromaps = false;
};

class StructureLocations
{
public:
    explicit StructureLocations(RootTable &root) : root_(root) {}

    // The number of a buffer (BufferInfo), and an offset in it.
    using Key = std::pair<uint64_t, VkDeviceSize>;
    using Table = std::map<Key, StructureLocation>;
    using Position = Table::iterator;
    // The location of that key, which the first call creates. Each call is paired with a release. Calls
    // `enter(location, isNew)` with the table locked: no other thread knows a location that is new. If this throws, the
    // location is as before.
    template <typename Enter>
    Position acquire(const Key &key, Enter enter)
    {
        std::lock_guard lock(mutex_);
        const auto [position, isNew] = locations_.try_emplace(key, root_);
        enter(position->second, isNew);
        ++position->second.users;
        return position;
    }
    // Destroys the location if this was its last user. Otherwise calls `leave(location)` with the table locked.
    template <typename Leave>
    void release(Position position, Leave leave)
    {
        Table::node_type last; // destroyed without the mutex
        std::lock_guard lock(mutex_);
        if (position->second.users == 1) {
            last = locations_.extract(position);
            return;
        }
        leave(position->second);
        --position->second.users;
    }
    // Bytes to the next location in the same buffer; ~0 if there is none.
    [[nodiscard]] VkDeviceSize bytesToNext(Position position) const;

private:
    RootTable &root_;
    // Guards the table. It is locked before the mutex of a location, never after.
    mutable std::mutex mutex_;
    Table locations_;
};

} // namespace vellum::layer
