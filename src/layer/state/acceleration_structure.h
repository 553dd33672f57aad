// SPDX-License-Identifier: Apache-2.0
// Micromaps and acceleration structures as objects: the layer's records of them, and what their commands share.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/driver.h"
#include "layer/memory/address_map.h"
#include "layer/state/root_table.h"

namespace vellum::layer
{

struct DeviceState;
struct AccelerationStructure;
class PlacedMicromaps; // khr_over_ext/placed_micromaps.h

// The memory of a micromap, built or not. VkMicromapEXT handles are pointers to these.
struct Micromap {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0;
    // The application's handle, for messages.
    struct Object {
        VkObjectType type = VK_OBJECT_TYPE_MICROMAP_EXT;
        uint64_t handle = 0;
    } object;

    explicit operator bool() const { return buffer != VK_NULL_HANDLE; }
};

// The object of a handle; null for null.
inline const Micromap *micromapOf(VkMicromapEXT handle)
{
    return reinterpret_cast<const Micromap *>(handle);
}

// Device address of a micromap's memory; 0 without memory.
inline VkDeviceAddress micromapAddress(const Driver &driver, const Micromap &micromap)
{
    return micromap ? driver.bufferAddress(micromap.buffer) + micromap.offset : 0;
}

// The locations of acceleration structures. What was built belongs to the location and not to a handle: an application
// with its own allocator may create several handles for the same content, each as large as the rest of the buffer, and
// destroy them in any order.
//
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

// The record of a VkAccelerationStructureKHR.
struct AccelerationStructure {
    // The handle of a structure of type OPACITY_MICROMAP is a pointer to this record; the driver does not know it.
    VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0;
    AddressMap::Owner bufferOwner; // of vkCreateAccelerationStructure2KHR
    VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;

    VkDeviceAddress reference =
        0; // the address, once it leads to the location's descriptor; guarded by location->mutex
    StructureLocations::Position position{}; // of the location
    StructureLocation *location = nullptr;   // until the structure leaves it
    // The list of the structures at the location, guarded by location->mutex: the next one, and what points to this
    // one.
    AccelerationStructure *nextAtLocation = nullptr;
    AccelerationStructure **linkAtLocation = nullptr;

    std::mutex mutex;                // guards the members below
    VkDeviceAddress micromapKey = 0; // micromap descriptor; 0 until acquired
    struct ExactSizeHandle {
        VkDeviceSize bytes = 0;
        VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
    };
    // Other handles of the driver at this location (structures/exact_size_handle.h).
    std::vector<ExactSizeHandle> exactSizeHandles;
};

// The part of a buffer that a structure is created in.
struct BufferRange {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0;
    AddressMap::Owner owner{}; // of the buffer, if it was found by an address
};
std::shared_ptr<AccelerationStructure> newStructure(const BufferRange &range, VkAccelerationStructureTypeKHR type);

// Acquires and releases the location of a structure.
void enterLocation(DeviceState &device, AccelerationStructure &structure);
void leaveLocation(DeviceState &device, const AccelerationStructure &structure);

// The descriptor of the structure's location, to which the structure's address leads afterwards. Its address is 0 if
// there is no memory.
StructureDescriptor descriptorOf(DeviceState &device, AccelerationStructure &structure);

// The type of the content of a structure. For a GENERIC structure it follows from what was recorded last at its
// location. After a deserialization it is the type that the device found; before the device has executed it, the type
// that the size of the structure is marked for. GENERIC if the content is unknown. With translated micromaps the device
// does not store what it found: then a structure whose size is marked for a micromap holds one.
VkAccelerationStructureTypeKHR contentOf(const Driver &driver, const AccelerationStructure &structure);
// Content of that type and size was recorded into a structure. 0 bytes: only the device knows the size.
void becomes(AccelerationStructure &structure, VkAccelerationStructureTypeKHR type, VkDeviceSize bytes);
// A deserialization into a GENERIC structure was recorded, and only the device knows the type of the data. It stores
// what it found in the structure's descriptor, together with the number of the deserialization, which is not 0.
void becomesUnknown(AccelerationStructure &structure, uint32_t deserialization);
// A top-level build of up to that many instances was recorded.
void becomesTopLevel(AccelerationStructure &structure, uint32_t instances, VkDeviceSize bytes);
// With translated micromaps: records that a structure of that type was recorded, which may name micromaps.
void becomesStructure(AccelerationStructure &structure, VkAccelerationStructureTypeKHR type, bool namesMicromaps);
bool namesMicromaps(const AccelerationStructure &structure);
// The size of what was recorded last; 0: only the device knows it.
VkDeviceSize lastBytes(const AccelerationStructure &structure);

// Bytes that a structure may occupy before the next structure in the same buffer.
VkDeviceSize capacityOf(const DeviceState &device, const AccelerationStructure &structure);

// The slots for a build of `count` instances into this structure: its slots, unless they are too few. Before the caller
// lets them go, the command buffer has to keep their use(). Null if no slots are left.
//
// Old slots are returned once neither a command buffer nor the structure's content uses them: the device stores the
// first slot of what it built last in the descriptor.
std::shared_ptr<SlotRange> slotsFor(DeviceState &device, AccelerationStructure &structure, uint32_t count);

VkDeviceAddress beginOf(const Driver &driver, const AccelerationStructure &structure);

// Bytes in units of 16 bytes for shaders, rounded down; at most UINT32_MAX.
uint32_t unitsOf(VkDeviceSize bytes);

// --- structures that are or hold micromaps (VK_KHR_opacity_micromap) ---
// Returns whether a structure is a micromap, or GENERIC, so that it can hold one.
bool canHoldMicromap(const AccelerationStructure &structure);
// Returns whether the layer created the handle: the driver does not know it.
inline bool isLayerObject(const AccelerationStructure &structure)
{
    return structure.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
}
// Returns whether a structure holds a micromap. Nothing for a GENERIC structure with unknown content.
std::optional<bool> holdsMicromap(const Driver &driver, const AccelerationStructure &structure);
// The micromap in a structure; a GENERIC structure is treated as a micromap.
Micromap micromapIn(const AccelerationStructure &structure);
// A micromap was recorded into a structure.
void becomeMicromap(DeviceState &device, AccelerationStructure &structure);

// Returns whether a structure is or can hold a micromap that serialized structures may name by the address of its
// memory.
bool publishesMicromap(const DeviceState &device, const AccelerationStructure &structure);
// Publishes that micromap, if there is one.
void publishMicromap(DeviceState &device, AccelerationStructure &structure);
// As above, for a structure of vkCreateAccelerationStructureKHR: now, or when its buffer is bound to memory.
void publishMicromapOnceBound(DeviceState &device, const std::shared_ptr<AccelerationStructure> &structure);
void bufferHasAddress(DeviceState &device, VkBuffer buffer);

} // namespace vellum::layer
