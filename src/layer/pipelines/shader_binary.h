// SPDX-License-Identifier: Apache-2.0
// Binaries of shader objects (VK_EXT_shader_object). A rewritten shader holds addresses of its device's tables, so its
// binary is valid only for devices whose tables have the same addresses, as in later runs with stable addresses
// (RootTable::create). The layer puts a header before binaries, and rejects others as incompatible.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan.h>

#include "vk/newer.h"

namespace vellum::layer
{

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

// The header of this device's binaries.
struct DevicePipelines;
ShaderBinaryHeader shaderBinaryHeader(DevicePipelines &device);

VkResult getShaderBinaryData(DevicePipelines &, VkDevice, VkShaderEXT, size_t *, void *);

} // namespace vellum::layer
