// Queries of the sizes of acceleration structures.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

// Whether the driver's answers to queries of this type are corrected by a back end.
bool isStructureProperty(VkQueryType type);

} // namespace vellum::layer
