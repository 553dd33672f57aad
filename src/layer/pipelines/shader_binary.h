// Binaries of shader objects (VK_EXT_shader_object). A rewritten shader holds addresses of its device's tables, so its
// binary is of use only where a device has its tables at the same addresses: in later runs, where these are stable
// (RootTable::create). Binaries get a header of ours, and others' are refused with the result that the extension has
// for that.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan.h>

#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

// Tells this version of the layer from others that rewrite shaders in another way.
const std::array<uint8_t, VK_UUID_SIZE> &rewriterUuid();
// Tells this process from every other, for as long as it lives.
const std::array<uint8_t, VK_UUID_SIZE> &processUuid();

struct ShaderBinaryHeader {
    std::array<uint8_t, VK_UUID_SIZE> rewriter;
    VkDeviceAddress root;
    VkDeviceAddress firstSlots; // and in bit 63, whether all ray queries use micromaps
    bool operator==(const ShaderBinaryHeader &) const = default;
};
static_assert(sizeof(ShaderBinaryHeader) == 32); // keeps the 16-byte alignment that VUID-...-pCode-08492 asks for

// The header of this device's binaries.
struct DevicePipelines;
ShaderBinaryHeader shaderBinaryHeader(DevicePipelines &device);

VkResult getShaderBinaryData(DevicePipelines &, VkDevice, newer::ShaderEXT, size_t *, void *);

} // namespace vellum::layer
