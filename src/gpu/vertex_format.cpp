// SPDX-License-Identifier: Apache-2.0
#include "gpu/vertex_format.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace vellum::gpu
{
namespace
{

using Kind = VertexFormat::Kind;

// Quiet and signalling ones, of either sign.
constexpr std::array<uint32_t, 4> kNans{0x7fc00000, 0x7f800001, 0xffc00000, 0xffffffff};
constexpr std::array<uint16_t, 4> kHalfNans{0x7e00, 0x7c01, 0xfe00, 0xffff};

uint16_t toHalf(float value)
{
    const auto sign = static_cast<uint16_t>(std::signbit(value) ? 0x8000 : 0);
    const float size = std::min(std::abs(value), 65504.0f);
    // The exponent of a unit in the last place: -24 for all below 2^-14.
    const int unit = size > 0 ? std::max(std::ilogb(size) - 10, -24) : -24;
    const auto units = static_cast<uint32_t>(std::nearbyint(std::ldexp(size, -unit)));
    // 1024 of them carry into the exponent by themselves.
    return static_cast<uint16_t>(sign | (static_cast<uint32_t>(unit + 24) * 1024 + units));
}

float fromHalf(uint16_t half)
{
    const int exponent = half >> 10 & 31;
    const int mantissa = half & 1023;
    const float size = exponent == 31  ? std::numeric_limits<float>::quiet_NaN()
                       : exponent == 0 ? std::ldexp(static_cast<float>(mantissa), -24)
                                       : std::ldexp(static_cast<float>(1024 + mantissa), exponent - 25);
    return (half & 0x8000) != 0 ? -size : size;
}

float largest(Kind kind)
{
    switch (kind) {
    case Kind::Snorm16: return 32767;
    case Kind::Snorm8: return 127;
    case Kind::Unorm16: return 65535;
    case Kind::Unorm8: return 255;
    default: return 1023;
    }
}

// Rounds a value to the integer of a normalized format.
int32_t toInteger(const VertexFormat &format, float value)
{
    const float most = largest(format.kind);
    return static_cast<int32_t>(std::nearbyint(std::clamp(value, format.isUnsigned() ? 0.0f : -1.0f, 1.0f) * most));
}

template <class T>
void write(uint8_t *out, T value)
{
    std::memcpy(out, &value, sizeof value);
}

} // namespace

VertexFormat vertexFormat(VkFormat format)
{
    switch (format) {
    case VK_FORMAT_R32G32_SFLOAT: return {Kind::Float32, 2, 8, 4};
    case VK_FORMAT_R32G32B32A32_SFLOAT: return {Kind::Float32, 4, 16, 4};
    case VK_FORMAT_R16G16_SFLOAT: return {Kind::Float16, 2, 4, 2};
    case VK_FORMAT_R16G16B16_SFLOAT: return {Kind::Float16, 3, 6, 2};
    case VK_FORMAT_R16G16B16A16_SFLOAT: return {Kind::Float16, 4, 8, 2};
    case VK_FORMAT_R16G16_SNORM: return {Kind::Snorm16, 2, 4, 2};
    case VK_FORMAT_R16G16B16_SNORM: return {Kind::Snorm16, 3, 6, 2};
    case VK_FORMAT_R16G16B16A16_SNORM: return {Kind::Snorm16, 4, 8, 2};
    case VK_FORMAT_R8G8_SNORM: return {Kind::Snorm8, 2, 2, 1};
    case VK_FORMAT_R8G8B8A8_SNORM: return {Kind::Snorm8, 4, 4, 1};
    case VK_FORMAT_R16G16_UNORM: return {Kind::Unorm16, 2, 4, 2};
    case VK_FORMAT_R16G16B16A16_UNORM: return {Kind::Unorm16, 4, 8, 2};
    case VK_FORMAT_R8G8_UNORM: return {Kind::Unorm8, 2, 2, 1};
    case VK_FORMAT_R8G8B8A8_UNORM: return {Kind::Unorm8, 4, 4, 1};
    case VK_FORMAT_A2B10G10R10_UNORM_PACK32: return {Kind::Unorm10, 4, 4, 4};
    default: return {};
    }
}

void writeVertex(VkFormat format, const Vec3 &position, uint32_t number, uint8_t *out)
{
    const VertexFormat of = vertexFormat(format);
    if (of.kind == Kind::Unorm10) {
        uint32_t word = 3u << 30; // the fourth component
        for (uint32_t i = 0; i < 3; ++i)
            word |= static_cast<uint32_t>(toInteger(of, position[i])) << (10 * i);
        return write(out, word);
    }
    for (uint32_t i = 0; i < std::min(of.components, 3u); ++i) {
        const float value = position[i];
        switch (of.kind) {
        case Kind::Float32:
            if (std::isnan(value))
                write(out + size_t{4} * i, kNans[number % kNans.size()]);
            else
                write(out + size_t{4} * i, value);
            break;
        case Kind::Float16:
            write(out + size_t{2} * i, std::isnan(value) ? kHalfNans[number % kHalfNans.size()] : toHalf(value));
            break;
        case Kind::Snorm16:
        case Kind::Unorm16: write(out + size_t{2} * i, static_cast<uint16_t>(toInteger(of, value))); break;
        default: write(out + i, static_cast<uint8_t>(toInteger(of, value))); break;
        }
    }
}

Vec3 quantized(VkFormat format, const Vec3 &position)
{
    const VertexFormat of = vertexFormat(format);
    Vec3 out{};
    for (uint32_t i = 0; i < std::min(of.components, 3u); ++i) {
        const float value = position[i];
        if (of.isFloat())
            out[i] = of.kind == Kind::Float32 || std::isnan(value) ? value : fromHalf(toHalf(value));
        else
            out[i] = static_cast<float>(toInteger(of, value)) / largest(of.kind);
    }
    return out;
}

} // namespace vellum::gpu
