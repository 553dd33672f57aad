#include "layer/memory/buffers.h"

#include <vector>

#include "layer/door/device.h"
#include "layer/ground/pnext.h"
#include "layer/micromaps/micromap_structure.h"

namespace vellum::layer
{
namespace
{

constexpr VkFlags64 kMicromapUsages =
    VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT | VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT;

// The layer's shaders read the inputs and write the storage of micromaps and acceleration structures by address, and
// copies of micromaps are buffer copies.
VkFlags64 driverUsage(VkFlags64 usage)
{
    const VkFlags64 storage =
        VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR;
    const VkFlags64 inputs = VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT |
                             VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    VkFlags64 result = usage & ~kMicromapUsages;
    // Micromap data is copied, where it can stay as it lies.
    if (usage & inputs)
        result |= VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    if (usage & (inputs | storage))
        result |= VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    // Any such buffer may be the scratch memory of a TLAS build, into which the layer writes the instances that the
    // driver is to build from (VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261 and -geometry-03673); or that of a
    // micromap build, which has the arguments of its dispatches there.
    const VkFlags64 scratch = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    if ((usage & scratch) == scratch)
        result |= VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                  VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
    // Micromaps are read in 16-byte units: their memory is aligned like that of acceleration structures.
    if (usage & VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT)
        result |= VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR;
    if (usage & storage)
        result |= VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    return result;
}

// The application's create info as the driver is to see it.
struct DriverBufferInfo {
    explicit DriverBufferInfo(const VkBufferCreateInfo &application) : info(application), chain(application.pNext)
    {
        usage = driverUsage(application.usage);
        info.usage = static_cast<VkBufferUsageFlags>(usage);
        // Where it is given, it replaces the 32-bit flags (VK_KHR_maintenance5).
        if (findInChain(application.pNext, newer::kBufferUsageFlags2CreateInfo)) {
            if (auto *flags2 = chain.edit<newer::BufferUsageFlags2CreateInfo>(newer::kBufferUsageFlags2CreateInfo))
                usage = flags2->usage = driverUsage(flags2->usage);
        }
        info.pNext = chain.head();
    }
    VkBufferCreateInfo info;
    Chain chain;
    VkFlags64 usage;
};

} // namespace

VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice handle, const VkBufferCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    Device &device = deviceOf(handle);
    const DriverBufferInfo driverInfo(*info);
    const VkResult result = device.next.CreateBuffer(handle, &driverInfo.info, allocator, buffer);
    if (result == VK_SUCCESS)
        device.buffers.set(*buffer, {info->size, driverInfo.usage});
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice handle, VkBuffer buffer, const VkAllocationCallbacks *allocator)
{
    Device &device = deviceOf(handle);
    device.addresses.remove(buffer);
    device.buffers.take(buffer);
    device.hostMemory.destroyed(buffer);
    device.next.DestroyBuffer(handle, buffer, allocator);
}

VKAPI_ATTR void VKAPI_CALL getDeviceBufferMemoryRequirements(VkDevice handle,
                                                             const VkDeviceBufferMemoryRequirements *info,
                                                             VkMemoryRequirements2 *requirements)
{
    Device &device = deviceOf(handle);
    const DriverBufferInfo driverInfo(*info->pCreateInfo);
    VkDeviceBufferMemoryRequirements driverQuery = *info;
    driverQuery.pCreateInfo = &driverInfo.info;
    device.next.GetDeviceBufferMemoryRequirements(handle, &driverQuery, requirements);
}

VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice handle, const VkMemoryAllocateInfo *info,
                                              const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    Device &device = deviceOf(handle);
    // Acceleration structure storage gets a device address (driverUsage above), which its memory must allow
    // (VUID-vkBindBufferMemory-bufferDeviceAddress-03339). Which memory that will be is not known here.
    VkMemoryAllocateInfo driverInfo = *info;
    Chain chain(info->pNext);
    VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
    if (auto *own = chain.edit<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO)) {
        own->flags |= VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    } else if (!findInChain(info->pNext, VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO)) {
        flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
        chain.prepend(reinterpret_cast<VkBaseInStructure *>(&flags));
    }
    driverInfo.pNext = chain.head();
    const VkResult result = device.next.AllocateMemory(handle, &driverInfo, allocator, memory);
    if (result == VK_SUCCESS)
        device.hostMemory.allocated(*memory, info->allocationSize,
                                    device.gpu.memory.memoryTypes[info->memoryTypeIndex].propertyFlags);
    return result;
}

void rememberAddress(Device &device, VkBuffer buffer)
{
    const BufferInfo info = device.buffers.get(buffer);
    if (device.asked.addressCommands && (info.usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0)
        device.addresses.add(device.bufferAddress(buffer), buffer, info.size, info.usage);
    bufferHasAddress(device, buffer);
}

VKAPI_ATTR VkDeviceAddress VKAPI_CALL getBufferDeviceAddress(VkDevice handle, const VkBufferDeviceAddressInfo *info)
{
    Device &device = deviceOf(handle);
    const VkDeviceAddress address = device.next.GetBufferDeviceAddress(handle, info);
    const BufferInfo buffer = device.buffers.get(info->buffer);
    device.addresses.add(address, info->buffer, buffer.size, buffer.usage);
    bufferHasAddress(device, info->buffer);
    return address;
}

VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceExternalBufferProperties(VkPhysicalDevice physicalDevice,
                                                                     const VkPhysicalDeviceExternalBufferInfo *info,
                                                                     VkExternalBufferProperties *properties)
{
    Instance &instance = instanceOf(physicalDevice);
    VkPhysicalDeviceExternalBufferInfo driverInfo = *info;
    if (implementationsOn(instance, physicalDevice).anyEmulated())
        driverInfo.usage = static_cast<VkBufferUsageFlags>(driverUsage(info->usage));
    instance.next.GetPhysicalDeviceExternalBufferProperties(physicalDevice, &driverInfo, properties);
}

VKAPI_ATTR void VKAPI_CALL cmdBindDescriptorBuffers(VkCommandBuffer commandBuffer, uint32_t count,
                                                    const VkDescriptorBufferBindingInfoEXT *infos)
{
    // The usage here is that of the buffer (VUID-VkDescriptorBufferBindingInfoEXT-usage).
    std::vector<VkDescriptorBufferBindingInfoEXT> own(infos, infos + count);
    for (VkDescriptorBufferBindingInfoEXT &info : own)
        info.usage = static_cast<VkBufferUsageFlags>(driverUsage(info.usage));
    deviceOf(commandBuffer).next.CmdBindDescriptorBuffersEXT(commandBuffer, count, own.data());
}

VKAPI_ATTR VkResult VKAPI_CALL setDebugUtilsObjectName(VkDevice handle, const VkDebugUtilsObjectNameInfoEXT *info)
{
    // A micromap is the layer's own object: its handle means nothing below, its name is used in the layer's messages.
    Device &device = deviceOf(handle);
    if (device.ownObject(info->objectType, info->objectHandle)) {
        device.report().setName(info->objectHandle, info->pObjectName ? info->pObjectName : "");
        return VK_SUCCESS;
    }
    return device.next.SetDebugUtilsObjectNameEXT(handle, info);
}

VKAPI_ATTR VkResult VKAPI_CALL setDebugUtilsObjectTag(VkDevice handle, const VkDebugUtilsObjectTagInfoEXT *info)
{
    Device &device = deviceOf(handle);
    if (device.ownObject(info->objectType, info->objectHandle))
        return VK_SUCCESS;
    return device.next.SetDebugUtilsObjectTagEXT(handle, info);
}

// VK_EXT_debug_marker has the object types of VK_EXT_debug_report: the same numbers, as far as acceleration structures
// go, and none for VkMicromapEXT.
static_assert(VkObjectType(VK_DEBUG_REPORT_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR_EXT) ==
              VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR);

VKAPI_ATTR VkResult VKAPI_CALL debugMarkerSetObjectName(VkDevice handle, const VkDebugMarkerObjectNameInfoEXT *info)
{
    Device &device = deviceOf(handle);
    if (device.ownObject(static_cast<VkObjectType>(info->objectType), info->object)) {
        device.report().setName(info->object, info->pObjectName ? info->pObjectName : "");
        return VK_SUCCESS;
    }
    return device.next.DebugMarkerSetObjectNameEXT(handle, info);
}

VKAPI_ATTR VkResult VKAPI_CALL debugMarkerSetObjectTag(VkDevice handle, const VkDebugMarkerObjectTagInfoEXT *info)
{
    Device &device = deviceOf(handle);
    if (device.ownObject(static_cast<VkObjectType>(info->objectType), info->object))
        return VK_SUCCESS;
    return device.next.DebugMarkerSetObjectTagEXT(handle, info);
}

} // namespace vellum::layer
