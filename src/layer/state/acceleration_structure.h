// An acceleration structure as an object: what the layer keeps of it, and what its commands share.
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

// What the layer keeps of a VkAccelerationStructureKHR.
struct AccelerationStructure {
    // Of type OPACITY_MICROMAP the handle is the layer's own, a pointer to this structure; the driver does not know it.
    VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0;
    VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;

    VkDeviceAddress reference = 0; // its address, once it leads to the descriptor of its place, whose mutex guards this
    StructureLocations::Key key;   // of its place
    std::shared_ptr<StructureLocation> location; // never null

    std::mutex mutex;                // guards what is below
    VkDeviceAddress micromapKey = 0; // of the descriptor that says that there is a micromap; once acquired
    struct ExactSizeHandle {
        VkDeviceSize bytes = 0;
        VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
    };
    std::vector<ExactSizeHandle>
        exactSizeHandles; // handles of the driver's at the same place, structures/exact_size_handle.h
};

std::shared_ptr<AccelerationStructure> newStructure(const BufferRange &range, VkAccelerationStructureTypeKHR type);

// Finds the place of a structure that was made in `buffer`, and lets go of it.
void enterLocation(DeviceState &device, AccelerationStructure &structure);
void leaveLocation(DeviceState &device, const AccelerationStructure &structure);

// Makes the structure's place a user of its reference's descriptor, if it is none yet. Address 0: no memory.
StructureDescriptor descriptorOf(DeviceState &device, AccelerationStructure &structure);

// What is in a structure by what was recorded last into it or into another one at its place: its type, unless it is
// GENERIC. Of a GENERIC one that data was deserialized to that only the device has looked at: what it found; before
// that copy was executed, what the structure's size is marked for. GENERIC: nothing tells.
VkAccelerationStructureTypeKHR contentOf(const AccelerationStructure &structure);
// Something of that type, and of so many bytes, is recorded into a structure. 0 bytes: only the device knows.
void becomes(AccelerationStructure &structure, VkAccelerationStructureTypeKHR type, VkDeviceSize bytes);
// Data is deserialized into a GENERIC structure of which only the device knows what it holds. The structure has a
// descriptor, in which the device leaves that number, not 0, with what it has found.
void becomesUnknown(AccelerationStructure &structure, uint32_t deserialization);
// A top-level build for up to so many instances.
void becomesTopLevel(AccelerationStructure &structure, uint32_t instances, VkDeviceSize bytes);
// Where micromaps are the driver's: a structure of that type, with or without names of micromaps, is recorded into it.
void becomesStructure(AccelerationStructure &structure, VkAccelerationStructureTypeKHR type, bool namesMicromaps);
bool namesMicromaps(const AccelerationStructure &structure);
// The bytes of what was recorded last, 0: only the device knows.
VkDeviceSize lastBytes(const AccelerationStructure &structure);

// Bytes that a structure may take without touching another one that begins behind it in the same buffer.
VkDeviceSize capacityOf(const DeviceState &device, const AccelerationStructure &structure);

// The slots that a build of `count` instances into this structure uses: those it has, unless they are too few. Work
// recorded before may still write or read the old ones, so they stay with the structure; growing by half keeps them
// few. Null where there are none left.
std::shared_ptr<SlotRange> slotsFor(DeviceState &device, AccelerationStructure &structure, uint32_t count);

VkDeviceAddress beginOf(const Driver &driver, const AccelerationStructure &structure);

// Bytes as a number of 16-byte units for shaders, rounded down; UINT32_MAX where they are more.
uint32_t unitsOf(VkDeviceSize bytes);

// Sends messages about what shaders found wrong with copies that were executed in the meantime.
void reportGpuErrors(DeviceState &device);

// --- structures that are or hold micromaps (VK_KHR_opacity_micromap) ---
// Whether a structure is a micromap, or a GENERIC one, which may become one.
bool canHoldMicromap(const AccelerationStructure &structure);
// Whether the layer made the handle: the driver must not see it.
inline bool isLayerObject(const AccelerationStructure &structure)
{
    return structure.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
}
// Whether a structure is a micromap, or a GENERIC one that something of a micromap was recorded into last. Nothing: it
// is a GENERIC one, and its content is unknown.
std::optional<bool> holdsMicromap(const Driver &driver, const AccelerationStructure &structure);
// The micromap that a structure is, or that a GENERIC one is taken for.
Micromap micromapIn(const AccelerationStructure &structure);
// Something of a micromap is recorded into a structure: a GENERIC one is what was recorded into it last.
void becomeMicromap(DeviceState &device, AccelerationStructure &structure);

// Serialized structures may name the micromap that a structure is or may become, by the address of its memory.
void publishMicromap(DeviceState &device, AccelerationStructure &structure);
// The same of one that vkCreateAccelerationStructureKHR has made: now, or when its buffer gets memory.
void publishMicromapOnceBound(DeviceState &device, const std::shared_ptr<AccelerationStructure> &structure);
void bufferHasAddress(DeviceState &device, VkBuffer buffer);

} // namespace vellum::layer
