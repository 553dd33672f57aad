// SPDX-License-Identifier: Apache-2.0
// Binaries of pipelines (VK_KHR_pipeline_binary). Those of rewritten shaders hold addresses of their device's tables.
// The layer puts a header before the data of a binary, and rejects data whose header does not match the device. All
// keys, including the global key, are the driver's, mixed with a mask of the device's tables (module_identifiers.h).
#pragma once

#include <vulkan/vulkan.h>

#include "layer/pipelines/ray_tracing_pipeline.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DevicePipelines;

// The binaries that a pipeline is created from, or null. The code of its stages is ignored then, and may be missing.
const VkPipelineBinaryInfoKHR *binariesOf(const void *pNext);

// How hidden ray flags travel in the ray tracing pipeline that the binaries come from. They travel in the same way in
// one that is created from the binaries.
HiddenInBinary hiddenFlagsIn(const DevicePipelines &device, const VkPipelineBinaryInfoKHR &info);

VkResult createPipelineBinaries(DevicePipelines &, VkDevice, const VkPipelineBinaryCreateInfoKHR *,
                                const VkAllocationCallbacks *, VkPipelineBinaryHandlesInfoKHR *);
void destroyPipelineBinary(DevicePipelines &, VkDevice, VkPipelineBinaryKHR, const VkAllocationCallbacks *);
VkResult getPipelineKey(DevicePipelines &, VkDevice, const VkPipelineCreateInfoKHR *, VkPipelineBinaryKeyKHR *);
VkResult getPipelineBinaryData(DevicePipelines &, VkDevice, const VkPipelineBinaryDataInfoKHR *,
                               VkPipelineBinaryKeyKHR *, size_t *, void *);

} // namespace vellum::layer
