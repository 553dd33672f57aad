// SPDX-License-Identifier: Apache-2.0
// Binaries of pipelines (VK_KHR_pipeline_binary) and of shader objects (VK_EXT_shader_object). Those of rewritten
// shaders hold addresses of their device's tables, so they are valid only for devices whose tables have the same
// addresses, as in later runs with stable addresses (RootTable::create). The layer puts a header before the data of a
// binary, and rejects data whose header does not match the device. All keys of pipelines, including the global key, are
// the driver's, mixed with a mask of the device's tables (module_identifiers.h).
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan.h>

#include "layer/pipelines/ray_tracing_pipeline.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DevicePipelines;

// --- shader objects ---

// Identifies this version of the rewriter.
const std::array<uint8_t, VK_UUID_SIZE> &rewriterUuid();
// Identifies this process.
const std::array<uint8_t, VK_UUID_SIZE> &processUuid();

struct ShaderBinaryHeader {
    std::array<uint8_t, VK_UUID_SIZE> rewriter;
    VkDeviceAddress root;
    VkDeviceAddress firstSlots; // bit 63: all ray queries use micromaps
    bool operator==(const ShaderBinaryHeader &) const = default;
};
static_assert(sizeof(ShaderBinaryHeader) == 32); // keeps the alignment of 16 bytes of VUID-...-pCode-08492

// The header of this device's binaries of shader objects.
ShaderBinaryHeader shaderBinaryHeader(DevicePipelines &device);

// --- pipelines ---

// The binaries that a pipeline is created from, or null. The code of its stages is ignored then, and may be missing.
const VkPipelineBinaryInfoKHR *binariesOf(const void *pNext);

// How hidden ray flags are passed in the ray tracing pipeline that the binaries come from. They are passed in the same
// way in one that is created from the binaries.
HiddenInBinary hiddenFlagsIn(const DevicePipelines &device, const VkPipelineBinaryInfoKHR &info);

} // namespace vellum::layer
