// What serializing and deserializing acceleration structures have in common. Layouts: core/records.h.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

inline constexpr VkDeviceSize kPlanBytes = 256; // before the driver's data in staging memory: shaders/serialized.glsl
// Of serialized data over the structure; 56 bytes on known drivers.
inline constexpr VkDeviceSize kDriverOverhead = 65536;

} // namespace vellum::layer
