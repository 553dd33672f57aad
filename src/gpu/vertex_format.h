// SPDX-License-Identifier: Apache-2.0
// Formats of vertices in acceleration structures: the positions that each can have, and how they lie in memory.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan.h>

namespace vellum::gpu
{

using Vec3 = std::array<float, 3>;

// All that cases use. The first six are those that every device has (VK_FORMAT_FEATURE_ACCELERATION_STRUCTURE_...).
inline constexpr std::array kVertexFormats{
    VK_FORMAT_R32G32B32_SFLOAT,    VK_FORMAT_R32G32_SFLOAT,
    VK_FORMAT_R16G16B16A16_SFLOAT, VK_FORMAT_R16G16_SFLOAT,
    VK_FORMAT_R16G16B16A16_SNORM,  VK_FORMAT_R16G16_SNORM,
    VK_FORMAT_R32G32B32A32_SFLOAT, VK_FORMAT_R16G16B16_SFLOAT,
    VK_FORMAT_R16G16B16_SNORM,     VK_FORMAT_R8G8B8A8_SNORM,
    VK_FORMAT_R8G8_SNORM,          VK_FORMAT_R16G16B16A16_UNORM,
    VK_FORMAT_R16G16_UNORM,        VK_FORMAT_R8G8B8A8_UNORM,
    VK_FORMAT_R8G8_UNORM,          VK_FORMAT_A2B10G10R10_UNORM_PACK32,
};
inline constexpr size_t kRequiredVertexFormats = 6;

// Describes one of these formats.
struct VertexFormat {
    enum class Kind { Float32, Float16, Snorm16, Snorm8, Unorm16, Unorm8, Unorm10 };
    Kind kind = Kind::Float32;
    uint32_t components = 3; // in memory; the fourth is ignored, and Z of two is 0
    uint32_t bytes = 12;
    uint32_t alignment = 4; // of addresses, offsets and strides

    [[nodiscard]] bool isFloat() const { return kind == Kind::Float32 || kind == Kind::Float16; }
    [[nodiscard]] bool isUnsigned() const
    {
        return kind == Kind::Unorm16 || kind == Kind::Unorm8 || kind == Kind::Unorm10;
    }
};
VertexFormat vertexFormat(VkFormat format);

// Writes the nearest position that the format has; what lies in a fourth component stays. NaN is any NaN: which, is up
// to `number`.
void writeVertex(VkFormat format, const Vec3 &position, uint32_t number, uint8_t *out);
// The position that a device reads after writeVertex.
Vec3 quantized(VkFormat format, const Vec3 &position);

} // namespace vellum::gpu
