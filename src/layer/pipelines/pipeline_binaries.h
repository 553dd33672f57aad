// Binaries of pipelines (VK_KHR_pipeline_binary). They are made of rewritten shaders, and so hold addresses of their
// device's tables. What the application keeps of them gets a header of ours, and is refused where it does not fit; and
// all keys, with the one by which an application knows whether anything that it has kept is still of use, are those of
// what the driver gets, mixed with a mask of the device's tables (module_identifiers.h).
#pragma once

#include <vulkan/vulkan.h>

#include "layer/base/vulkan_newer.h"
#include "layer/pipelines/ray_tracing_pipeline.h"

namespace vellum::layer
{

struct DevicePipelines;

// Whether the pipeline is made of binaries: its stages need no code, and the driver ignores what they have.
const newer::PipelineBinaryInfo *binariesOf(const void *pNext);

// How the ray flags travel that are hidden from the driver, in a ray tracing pipeline that was made of code: the same
// must be so in one that is made of its binaries.
HiddenInBinary hiddenFlagsIn(const DevicePipelines &device, const newer::PipelineBinaryInfo &info);

VkResult createPipelineBinaries(DevicePipelines &, VkDevice, const newer::PipelineBinaryCreateInfo *,
                                const VkAllocationCallbacks *, newer::PipelineBinaryHandlesInfo *);
void destroyPipelineBinary(DevicePipelines &, VkDevice, newer::PipelineBinary, const VkAllocationCallbacks *);
VkResult getPipelineKey(DevicePipelines &, VkDevice, const newer::PipelineCreateInfo *, newer::PipelineBinaryKey *);
VkResult getPipelineBinaryData(DevicePipelines &, VkDevice, const newer::PipelineBinaryDataInfo *,
                               newer::PipelineBinaryKey *, size_t *, void *);

} // namespace vellum::layer
