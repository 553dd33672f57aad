// The places that acceleration structures are made at. What was built somewhere belongs to the place and not to a
// handle: an application with an allocator of its own makes several handles for one content, each as large as the
// buffer is long, and destroys them in any order.
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

// What all acceleration structures share that begin at the same place.
struct StructureLocation {
    explicit StructureLocation(RootTable &table) : root(table) {}
    ~StructureLocation();
    StructureLocation(const StructureLocation &) = delete;
    StructureLocation &operator=(const StructureLocation &) = delete;

    RootTable &root;
    std::mutex mutex; // guards what is below
    // The structures that begin here, each as long as its handle lives.
    std::vector<AccelerationStructure *> structures;
    // The addresses of those that were asked for theirs, each a user of the descriptor: what instances may name. Only
    // the address of a GENERIC one must be that of the buffer (vkGetAccelerationStructureDeviceAddressKHR), so there
    // may be several. One that no structure has any more may be given to a structure somewhere else.
    struct Reference {
        VkDeviceAddress address = 0;
        uint32_t structures = 0;
    };
    std::vector<Reference> references;
    VkDeviceAddress heldKey = 0; // of the descriptor, where there was nothing else that led to it; 0: none
    StructureDescriptor descriptor;
    // Of what was recorded last; GENERIC: nothing was, or data of which only the device knows what it holds.
    VkAccelerationStructureTypeKHR content = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    VkDeviceSize lastBytes =
        0; // of what was recorded last: what is written of a handle, however large it is; 0: unknown
    // The latter: the descriptor tells it, once it has the number of the command that was recorded last; 0: none.
    uint32_t deserialization = 0;
    uint32_t lastInstances = 0; // of the top-level build recorded last
    uint32_t mostInstances = 0; // of all builds recorded
    std::shared_ptr<SlotRange> slots;
    std::vector<std::shared_ptr<SlotRange>> outgrownSlots; // may still be read by work recorded before
    // Where micromaps are translated: those of the driver's at this place, and whether what was recorded last is a
    // bottom-level structure with micromaps.
    std::shared_ptr<PlacedMicromaps> driverMicromaps;
    bool namesMicromaps = false;
};

class StructureLocations
{
public:
    explicit StructureLocations(RootTable &root) : root_(root) {}

    // A buffer, by its number of all of the device, and an offset in it.
    using Key = std::pair<uint64_t, VkDeviceSize>;
    // The place of that key; made when it is asked for first. Each call is paired with a release.
    std::shared_ptr<StructureLocation> acquire(const Key &key);
    void release(const Key &key);
    // Bytes to the next place behind it in the same buffer; ~0 where there is none.
    [[nodiscard]] VkDeviceSize bytesToNext(const Key &key) const;

private:
    struct Entry {
        std::shared_ptr<StructureLocation> location;
        uint32_t users = 0;
    };
    RootTable &root_;
    mutable std::mutex mutex_;
    std::map<Key, Entry> locations_;
};

} // namespace vellum::layer
