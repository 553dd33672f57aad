// SPDX-License-Identifier: Apache-2.0
// Names, tags and private data of objects. The driver does not know layer objects; their names appear in the layer's
// messages.

#include "layer/base/commands.h"
#include "layer/state/device_state.h"

namespace vellum::layer
{
namespace
{

// Keeps the names that messages use. Returns whether the object is a layer object, whose handle the driver does not
// know. Micromaps and acceleration structures of the driver are named in messages as well, where the layer or
// validation sees their destruction, which ends the name.
bool keepName(DeviceState &device, VkObjectType type, uint64_t object, const char *name)
{
    const bool own = device.own(type, object);
    const Driver &driver = device.driver;
    const bool isSeen = driver.providesMicromaps() || (driver.enabled.any() && driver.settings->validate.any());
    if (own || ((type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR || type == VK_OBJECT_TYPE_MICROMAP_EXT) && isSeen))
        driver.report().setName(object, name ? name : "");
    return own;
}

} // namespace

// Applications that do not enable VK_EXT_debug_utils get its commands from some loaders all the same, which do nothing.
// Then the next layer has none.
VkResult setDebugUtilsObjectName(DeviceState &device, VkDevice handle, const VkDebugUtilsObjectNameInfoEXT *info)
{
    if (keepName(device, info->objectType, info->objectHandle, info->pObjectName))
        return VK_SUCCESS;
    const auto next = device.driver.next.SetDebugUtilsObjectNameEXT;
    return next ? next(handle, info) : VK_SUCCESS;
}

VkResult setDebugUtilsObjectTag(DeviceState &device, VkDevice handle, const VkDebugUtilsObjectTagInfoEXT *info)
{
    if (device.own(info->objectType, info->objectHandle))
        return VK_SUCCESS;
    const auto next = device.driver.next.SetDebugUtilsObjectTagEXT;
    return next ? next(handle, info) : VK_SUCCESS;
}

// VK_EXT_debug_marker has the object types of VK_EXT_debug_report: the same number for acceleration structures, and
// none for VkMicromapEXT.
static_assert(VkObjectType(VK_DEBUG_REPORT_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR_EXT) ==
              VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR);

VkResult debugMarkerSetObjectName(DeviceState &device, VkDevice handle, const VkDebugMarkerObjectNameInfoEXT *info)
{
    if (keepName(device, static_cast<VkObjectType>(info->objectType), info->object, info->pObjectName))
        return VK_SUCCESS;
    return device.driver.next.DebugMarkerSetObjectNameEXT(handle, info);
}

VkResult debugMarkerSetObjectTag(DeviceState &device, VkDevice handle, const VkDebugMarkerObjectTagInfoEXT *info)
{
    if (device.own(static_cast<VkObjectType>(info->objectType), info->object))
        return VK_SUCCESS;
    return device.driver.next.DebugMarkerSetObjectTagEXT(handle, info);
}

void PrivateData::set(VkPrivateDataSlot slot, uint64_t object, uint64_t value)
{
    std::lock_guard lock(mutex_);
    values_[{object, slot}] = value;
}

uint64_t PrivateData::get(VkPrivateDataSlot slot, uint64_t object) const
{
    std::lock_guard lock(mutex_);
    const auto it = values_.find({object, slot});
    return it == values_.end() ? 0 : it->second;
}

void PrivateData::forgetObject(uint64_t object)
{
    std::lock_guard lock(mutex_);
    // The entries of one object are sorted by slot, the null handle first.
    auto at = values_.lower_bound({object, VK_NULL_HANDLE});
    while (at != values_.end() && at->first.first == object)
        at = values_.erase(at);
}

void PrivateData::forgetSlot(VkPrivateDataSlot slot)
{
    std::lock_guard lock(mutex_);
    std::erase_if(values_, [slot](const auto &entry) { return entry.first.second == slot; });
}

VkResult setPrivateData(DeviceState &device, VkDevice handle, VkObjectType type, uint64_t object,
                        VkPrivateDataSlot slot, uint64_t value)
{
    if (!device.own(type, object))
        return device.driver.next.SetPrivateData(handle, type, object, slot, value);
    device.privateData.set(slot, object, value);
    return VK_SUCCESS;
}

void getPrivateData(DeviceState &device, VkDevice handle, VkObjectType type, uint64_t object, VkPrivateDataSlot slot,
                    uint64_t *value)
{
    if (!device.own(type, object))
        return device.driver.next.GetPrivateData(handle, type, object, slot, value);
    *value = device.privateData.get(slot, object);
}

void destroyPrivateDataSlot(DeviceState &device, VkDevice handle, VkPrivateDataSlot slot,
                            const VkAllocationCallbacks *allocator)
{
    device.privateData.forgetSlot(slot);
    device.driver.next.DestroyPrivateDataSlot(handle, slot, allocator);
}

} // namespace vellum::layer
