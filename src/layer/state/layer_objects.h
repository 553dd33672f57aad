// SPDX-License-Identifier: Apache-2.0
// Names, tags and private data of objects. The driver does not know layer objects; their names appear in the layer's
// messages.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

// VK_EXT_private_data of layer objects, whose handles the driver does not know.
class PrivateData
{
public:
    void set(VkPrivateDataSlot slot, uint64_t object, uint64_t value);
    [[nodiscard]] uint64_t get(VkPrivateDataSlot slot, uint64_t object) const; // 0 if nothing was set
    void forgetObject(uint64_t object);
    void forgetSlot(VkPrivateDataSlot slot);

private:
    mutable std::mutex mutex_;
    std::map<std::pair<uint64_t, VkPrivateDataSlot>, uint64_t> values_;
};

} // namespace vellum::layer
