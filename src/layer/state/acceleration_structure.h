// SPDX-License-Identifier: Apache-2.0
// An acceleration structure as an object: the layer's record of it, and what its commands share.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/state/buffer_range.h"
#include "layer/state/micromap_object.h"
#include "layer/state/structure_location.h"

namespace vellum::layer
{

struct Driver;

struct DeviceState;

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

// Reports errors that shaders have found in copies since the last call, unless validation does.
void reportGpuErrors(DeviceState &device);
// Reports all except those whose bit is set in `known` (one bit for each kGpuError*).
void reportGpuErrors(DeviceState &device, uint32_t known);

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
