// SPDX-License-Identifier: Apache-2.0
#include "layer/state/private_data.h"

#include "layer/state/device_state.h"

namespace vellum::layer
{

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
