// Per-device state.
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/address/device_address_commands.h"
#include "layer/door/instance.h"
#include "layer/ground/dispatch.h"
#include "layer/ground/handle_map.h"
#include "layer/memory/address_map.h"
#include "layer/memory/gpu_memory.h"
#include "layer/memory/host_memory.h"
#include "layer/objects/private_data.h"
#include "layer/objects/root_table.h"
#include "layer/pipelines/ray_flag_probe.h"
#include "layer/pipelines/ray_tracing_pipeline.h"
#include "layer/queries/query_pool.h"
#include "layer/structures/blank_structure.h"
#include "layer/work/command_state.h"
#include "layer/work/complaints.h"
#include "layer/work/deferred.h"
#include "layer/work/injected_work.h"

namespace vellum::layer
{

struct BufferInfo {
    VkDeviceSize size = 0;
    VkFlags64 usage = 0; // as the driver knows it
};

// A micromap: the object of a VkMicromapEXT, whose handles are pointers to these, and part of an acceleration structure
// that is or may be one.
struct Micromap {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0;
    // As the application knows it, for messages.
    struct Object {
        VkObjectType type = VK_OBJECT_TYPE_MICROMAP_EXT;
        uint64_t handle = 0;
    } object;
};

// What the layer keeps of a VkAccelerationStructureKHR.
struct AccelerationStructure {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0;
    VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    // The same memory, of those that may hold a micromap. Of type OPACITY_MICROMAP the handle is the layer's own, a
    // pointer to this structure; the driver knows nothing of it.
    Micromap micromap;

    std::mutex mutex;                // guards what is below
    VkDeviceAddress micromapKey = 0; // of the cell that says that there is a micromap; once acquired
    VkDeviceAddress reference = 0;   // once acquired: this object is a user of that cell
    CellPlace cell;
    // Of what was recorded last into a GENERIC structure; itself, of others.
    VkAccelerationStructureTypeKHR content = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    uint32_t mostInstances = 0; // of all builds recorded
    std::shared_ptr<SlotRange> slots;
    std::vector<std::shared_ptr<SlotRange>> outgrownSlots; // may still be read by work recorded before
};

// What the application enabled on an emulated device.
struct Asked {
    bool ext = false;             // VK_EXT_opacity_micromap
    bool khr = false;             // VK_KHR_opacity_micromap
    bool addressCommands = false; // VK_KHR_device_address_commands
    bool extFeature = false;      // VkPhysicalDeviceOpacityMicromapFeaturesEXT::micromap
    bool khrFeature = false;      // VkPhysicalDeviceOpacityMicromapFeaturesKHR::micromap
    bool captureReplay = false;
    bool hostCommands = false;

    // With VK_EXT_opacity_micromap every ray query uses micromaps; without it, those whose entry point asks for it.
    [[nodiscard]] bool everyQueryUsesMicromaps() const { return ext; }
};

struct Device {
    VkDevice handle = VK_NULL_HANDLE;
    VkPhysicalDevice physicalDevice = VK_NULL_HANDLE;
    Instance *instance = nullptr;
    DeviceTable next;
    bool emulated = false; // otherwise every call but vkDestroyDevice goes straight through

    Asked asked;
    bool ownAddressCommands = false; // VK_KHR_device_address_commands is enabled, and the layer's
    bool nullIndexBuffer = false;    // VK_NULL_HANDLE may be bound as index buffer
    CarriedRayFlagBits carriesRayFlagBits;
    BlankStructure blank;              // see blank_structure.h
    bool queriesStructureSize = false; // VK_KHR_ray_tracing_maintenance1 is enabled

    GpuContext gpu;
    RootTable root;
    InjectedPipelines injected;
    Complaints complaints;
    HostMemory hostMemory;
    std::array<uint8_t, VK_UUID_SIZE> driverUuid{};
    uint32_t threads = 0; // of a device that is a CPU; 0: it is none
    HandleMap<VkBuffer, BufferInfo> buffers;
    AddressMap addresses;
    ZeroIndices zeroIndices;
    PrivateData privateData;
    HandleMap<VkQueryPool, std::shared_ptr<QueryPool>> queryPools;
    HandleMap<VkAccelerationStructureKHR, std::shared_ptr<AccelerationStructure>> accelerationStructures;
    std::mutex unnamedMutex;                                            // guards the next one
    std::vector<std::weak_ptr<AccelerationStructure>> unnamedMicromaps; // GENERIC ones, made before their memory

    // SPIR-V, as the application gave it, of modules that may have stages of ray tracing pipelines.
    HandleMap<VkShaderModule, std::shared_ptr<const std::vector<uint32_t>>> rayTracingModules;
    HandleMap<VkPipeline, std::shared_ptr<RayTracingPipeline>> rayTracingPipelines; // those that use micromaps
    AnyHitModules anyHitModules;
    std::atomic<uint32_t> anyHitStack = 0; // the most bytes that one of the layer's any-hit shaders takes
    HandleMap<VkDeferredOperationKHR, std::shared_ptr<DeferredOperation>> deferredOperations;

    [[nodiscard]] Reporter &report() const { return instance->report; }
    [[nodiscard]] VkDeviceAddress bufferAddress(VkBuffer buffer) const;
    // The reference that instances name a bottom-level structure by.
    [[nodiscard]] VkDeviceAddress structureAddress(VkAccelerationStructureKHR structure) const;
    // Whether a handle of the application's is the layer's own, which means nothing to the driver.
    [[nodiscard]] bool ownObject(VkObjectType type, uint64_t handle) const;
};

Device *deviceOfKey(void *key);
template <typename DispatchableHandle>
Device &deviceOf(DispatchableHandle handle)
{
    return *deviceOfKey(dispatchKey(handle));
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physicalDevice, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device);
VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice device, const VkAllocationCallbacks *allocator);

} // namespace vellum::layer
