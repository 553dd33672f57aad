// SPDX-License-Identifier: Apache-2.0
// Commands on buffers and memory. Usage flags that the driver does not know are removed, and addresses are kept.
#include <vector>

#include "layer/base/commands.h"
#include "layer/base/pnext.h"
#include "layer/base/undo.h"
#include "layer/memory/device_buffers.h"

namespace vellum::layer
{

// The lifetime of the driver's buffers. A command or structure that has an address is recorded with a buffer that
// contains it. If buffers alias each other in memory that may not be the one that the application means, and the
// application may destroy it at any time: only memory must outlive commands by address. So each command buffer and
// structure that uses a buffer found by its address shares the ownership with the application, and the last owner
// destroys the buffer.
//
// The application may also free the memory of such a buffer first, as of any buffer (vkFreeMemory).
class DriverBuffer
{
public:
    DriverBuffer(DeviceBuffers &device, VkBuffer handle) : device_(device), handle_(handle) {}
    ~DriverBuffer();
    DriverBuffer(const DriverBuffer &) = delete;
    DriverBuffer &operator=(const DriverBuffer &) = delete;

    // Called when the application destroys the buffer. Without it, the destructor leaves the driver's buffer alone.
    void destroy() { destroyed_ = true; }

private:
    DeviceBuffers &device_;
    const VkBuffer handle_;
    bool destroyed_ = false; // written by an owner, read when no owner is left
};

namespace
{

constexpr VkFlags64 kMicromapUsages =
    VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT | VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT;

constexpr VkFlags64 kTileMemoryUsage = 0x08000000; // VK_BUFFER_USAGE_TILE_MEMORY_BIT_QCOM

VkFlags64 sameUsage(VkFlags64 usage, VkBufferCreateFlags)
{
    return usage;
}

VkFlags64 (*usageOn(const Driver &driver))(VkFlags64, VkBufferCreateFlags)
{
    if (driver.emulated())
        return emulatedUsage;
    return driver.translated() && driver.enabled.khr ? translatedUsage : sameUsage;
}

// The create info for the driver.
struct DriverBufferInfo {
    DriverBufferInfo(const Driver &driver, const VkBufferCreateInfo &application)
        : info(application), chain(application.pNext)
    {
        usage = editUsage(driver.report(), chain, info.usage, info.flags, usageOn(driver));
        info.pNext = chain.head();
    }
    VkBufferCreateInfo info;
    Chain chain;
    VkFlags64 usage;
};

// A buffer with an address may outlive the application's (DriverBuffer), and so its allocator.
const VkAllocationCallbacks *driversAllocator(VkFlags64 usage, const VkAllocationCallbacks *allocator)
{
    return (usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0 ? nullptr : allocator;
}

// Adds a buffer at an address, unless it is known.
void addAddress(DeviceBuffers &device, VkBuffer buffer, VkDeviceAddress address, const BufferInfo &info)
{
    device.addresses.add(address, buffer, info.size, info.usage, std::make_shared<DriverBuffer>(device, buffer));
}

} // namespace

DriverBuffer::~DriverBuffer()
{
    if (!destroyed_)
        return;
    device_.infos.take(handle_);
    device_.driver.next.DestroyBuffer(device_.driver.handle, handle_, nullptr);
}

VkFlags64 emulatedUsage(VkFlags64 usage, VkBufferCreateFlags flags)
{
    const VkFlags64 storage =
        VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR;
    const VkFlags64 inputs = VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT |
                             VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    VkFlags64 result = usage & ~kMicromapUsages;
    if ((flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0 || (usage & kTileMemoryUsage) != 0)
        return result;
    // Micromap data that needs no conversion is copied, and so are hit tables.
    if (usage & (inputs | VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR))
        result |= VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    if (usage & (inputs | storage))
        result |= VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    // Any such buffer may be the scratch memory of a micromap build, which has the arguments of indirect dispatches
    // there.
    const VkFlags64 scratch = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    if ((usage & scratch) == scratch)
        result |= VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
    // Micromaps are read in units of 16 bytes, so their memory is aligned like that of acceleration structures.
    if (usage & VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT)
        result |= VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR;
    // The driver builds a TLAS from instances in its own memory
    // (VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261 and -geometry-03673).
    if (usage & storage)
        result |= VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                  VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    return result;
}

VkFlags64 translatedUsage(VkFlags64 usage, VkBufferCreateFlags)
{
    VkFlags64 result = usage;
    if (usage & VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR)
        result |= VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT;
    if (usage & VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR)
        result |= VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT;
    return result;
}

VkFlags64 editUsage(Reporter &report, Chain &chain, VkBufferUsageFlags &usage, VkBufferCreateFlags flags,
                    VkFlags64 (*driversUsage)(VkFlags64 usage, VkBufferCreateFlags flags))
{
    const VkFlags64 usage32 = driversUsage(usage, flags);
    usage = static_cast<VkBufferUsageFlags>(usage32);
    const auto *application = findInChain<VkBufferUsageFlags2CreateInfoKHR>(
        chain.head(), VK_STRUCTURE_TYPE_BUFFER_USAGE_FLAGS_2_CREATE_INFO_KHR);
    if (!application)
        return usage32;
    const VkFlags64 usage64 = driversUsage(application->usage, flags);
    if (auto *own =
            chain.edit<VkBufferUsageFlags2CreateInfoKHR>(VK_STRUCTURE_TYPE_BUFFER_USAGE_FLAGS_2_CREATE_INFO_KHR))
        return own->usage = usage64;
    if (usage64 != application->usage)
        report.warning(
            "VELLUM-unknown-structure",
            "VkBufferUsageFlags2CreateInfo is behind a structure of unknown size: the driver gets the application's "
            "usage, without the flags that micromaps and acceleration structures need");
    return application->usage;
}

VkResult createBuffer(DeviceBuffers &device, VkDevice handle, const VkBufferCreateInfo *info,
                      const VkAllocationCallbacks *allocator, VkBuffer *buffer)
{
    const DriverBufferInfo driverInfo(device.driver, *info);
    const VkAllocationCallbacks *own = driversAllocator(driverInfo.usage, allocator);
    const VkResult result = device.driver.next.CreateBuffer(handle, &driverInfo.info, own, buffer);
    if (result != VK_SUCCESS)
        return result;
    Undo undo([&] { device.driver.next.DestroyBuffer(handle, *buffer, own); });
    device.infos.set(*buffer, {info->size, driverInfo.usage, ++device.numbers});
    undo.keep();
    return result;
}

void destroyBuffer(DeviceBuffers &device, VkDevice handle, VkBuffer buffer, const VkAllocationCallbacks *allocator)
{
    device.host.destroyed(buffer);
    if (const auto owner = device.addresses.remove(buffer))
        return owner->destroy();
    const VkFlags64 usage = device.infos.take(buffer).usage;
    device.driver.next.DestroyBuffer(handle, buffer, driversAllocator(usage, allocator));
}

void getDeviceBufferMemoryRequirements(DeviceBuffers &device, VkDevice handle,
                                       const VkDeviceBufferMemoryRequirements *info,
                                       VkMemoryRequirements2 *requirements)
{
    const DriverBufferInfo driverInfo(device.driver, *info->pCreateInfo);
    VkDeviceBufferMemoryRequirements driverQuery = *info;
    driverQuery.pCreateInfo = &driverInfo.info;
    device.driver.next.GetDeviceBufferMemoryRequirements(handle, &driverQuery, requirements);
}

VkResult allocateMemory(DeviceBuffers &device, VkDevice handle, const VkMemoryAllocateInfo *info,
                        const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    // Acceleration structure storage gets a device address (emulatedUsage), which its memory has to allow
    // (VUID-vkBindBufferMemory-bufferDeviceAddress-03339). Any memory may become such memory.
    VkMemoryAllocateInfo driverInfo = *info;
    Chain chain(info->pNext);
    VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
    if (auto *own = chain.edit<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO)) {
        own->flags |= VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    } else if (const auto *application =
                   findInChain<VkMemoryAllocateFlagsInfo>(info->pNext, VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO)) {
        if ((application->flags & VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT) == 0)
            device.driver.report().warning(
                "VELLUM-unknown-structure",
                "VkMemoryAllocateFlagsInfo is behind a structure of unknown size: the memory is allocated without "
                "DEVICE_ADDRESS, which buffers for micromaps and acceleration structures need");
    } else {
        flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
        chain.prepend(reinterpret_cast<VkBaseInStructure *>(&flags));
    }
    driverInfo.pNext = chain.head();
    const VkResult result = device.driver.next.AllocateMemory(handle, &driverInfo, allocator, memory);
    if (result != VK_SUCCESS)
        return result;
    Undo undo([&] { device.driver.next.FreeMemory(handle, *memory, allocator); });
    device.host.allocated(*memory, info->allocationSize,
                          device.gpu.memory.memoryTypes[info->memoryTypeIndex].propertyFlags);
    undo.keep();
    return result;
}

void rememberAddress(DeviceBuffers &device, VkBuffer buffer)
{
    const BufferInfo info = device.infos.get(buffer);
    if (device.driver.enabled.addressCommands && (info.usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0)
        addAddress(device, buffer, device.driver.bufferAddress(buffer), info);
    device.onAddress(buffer);
}

VkDeviceAddress getBufferDeviceAddress(DeviceBuffers &device, VkDevice handle, const VkBufferDeviceAddressInfo *info)
{
    const VkDeviceAddress address = device.driver.next.GetBufferDeviceAddress(handle, info);
    if (device.addresses.addressOf(info->buffer) == 0) { // the usual answer waits for no other thread
        addAddress(device, info->buffer, address, device.infos.get(info->buffer));
        device.onAddress(info->buffer);
    }
    return address;
}

void bindDescriptorBuffers(DeviceBuffers &device, VkCommandBuffer commandBuffer, uint32_t count,
                           const VkDescriptorBufferBindingInfoEXT *infos)
{
    // Either usage has to be that of the buffer (VUID-VkDescriptorBufferBindingInfoEXT-usage).
    std::vector<VkDescriptorBufferBindingInfoEXT> own(infos, infos + count);
    std::vector<Chain> chains;
    chains.reserve(count);
    for (VkDescriptorBufferBindingInfoEXT &info : own) {
        Chain &chain = chains.emplace_back(info.pNext);
        editUsage(device.driver.report(), chain, info.usage, 0, usageOn(device.driver));
        info.pNext = const_cast<void *>(chain.head());
    }
    device.driver.next.CmdBindDescriptorBuffersEXT(commandBuffer, count, own.data());
}

} // namespace vellum::layer
