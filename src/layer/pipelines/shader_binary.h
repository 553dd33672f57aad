// Binaries of shader objects (VK_EXT_shader_object). A rewritten shader holds the address of its device's root table,
// so its binary is of no use to any other device or process: binaries get a header of ours, and others' are refused
// with the result that the extension has for that.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan.h>

#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

// Tells this process from every other, for as long as it lives.
const std::array<uint8_t, VK_UUID_SIZE> &processUuid();

struct ShaderBinaryHeader {
    std::array<uint8_t, VK_UUID_SIZE> process;
    VkDeviceAddress root;
    uint64_t device; // Driver::number
    bool operator==(const ShaderBinaryHeader &) const = default;
};
static_assert(sizeof(ShaderBinaryHeader) == 32); // keeps the 16-byte alignment that VUID-...-pCode-08492 asks for

// The header of this device's binaries.
struct DevicePipelines;
ShaderBinaryHeader shaderBinaryHeader(const DevicePipelines &device);

VkResult getShaderBinaryData(DevicePipelines &, VkDevice, newer::ShaderEXT, size_t *, void *);

} // namespace vellum::layer
