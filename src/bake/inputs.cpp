// SPDX-License-Identifier: Apache-2.0
#include "bake/inputs.h"

#include <cstring>
#include <limits>
#include <string>

#include "core/portable_math.h"

namespace vellum
{
namespace
{

template <typename T>
T load(const std::byte *from)
{
    T value;
    std::memcpy(&value, from, sizeof value);
    return value;
}

size_t sizeOf(AlphaFormat format)
{
    switch (format) {
    case AlphaFormat::Unorm8: return 1;
    case AlphaFormat::Unorm16:
    case AlphaFormat::Float16: return 2;
    case AlphaFormat::Float32: return 4;
    }
    throw BakeError("unknown format of alpha values");
}

// A row of values that are `stride` bytes apart, by a function from one of them to a float.
template <typename T, typename Function>
void readRow(const std::byte *from, size_t stride, std::span<float> to, Function &&function)
{
    for (size_t x = 0; x < to.size(); ++x)
        to[x] = function(load<T>(from + x * stride));
}

// Calls `use` with a function that converts rows of a format: readRow's arguments but the last.
template <typename Use>
void withRowsOf(AlphaFormat format, float scale, Use &&use)
{
    switch (format) {
    case AlphaFormat::Unorm8: throw BakeError("values of 8 bits are not converted");
    case AlphaFormat::Unorm16:
        use([scale](const std::byte *from, size_t stride, std::span<float> to) {
            readRow<uint16_t>(from, stride, to,
                              [scale](uint16_t value) { return static_cast<float>(value) / 65535.0f * scale; });
        });
        break;
    case AlphaFormat::Float16:
        use([scale](const std::byte *from, size_t stride, std::span<float> to) {
            readRow<uint16_t>(from, stride, to, [scale](uint16_t value) { return halfToFloat(value) * scale; });
        });
        break;
    case AlphaFormat::Float32:
        use([scale](const std::byte *from, size_t stride, std::span<float> to) {
            readRow<float>(from, stride, to, [scale](float value) { return value * scale; });
        });
        break;
    }
}

size_t componentSize(UvFormat format)
{
    switch (format) {
    case UvFormat::Float32: return 4;
    case UvFormat::Float16:
    case UvFormat::Unorm16: return 2;
    }
    throw BakeError("unknown format of texture coordinates");
}

float coordinateAt(const std::byte *from, UvFormat format)
{
    switch (format) {
    case UvFormat::Float16: return halfToFloat(load<uint16_t>(from));
    case UvFormat::Unorm16: return static_cast<float>(load<uint16_t>(from)) / 65535.0f;
    case UvFormat::Float32: break;
    }
    return load<float>(from);
}

size_t indexSize(IndexFormat format)
{
    switch (format) {
    case IndexFormat::None: return 0;
    case IndexFormat::Uint8: return 1;
    case IndexFormat::Uint16: return 2;
    case IndexFormat::Uint32: return 4;
    }
    throw BakeError("unknown format of indices");
}

size_t indexAt(const UvVertices &vertices, size_t i)
{
    const std::byte *from = vertices.indices.data() + i * indexSize(vertices.indexFormat);
    switch (vertices.indexFormat) {
    case IndexFormat::None: break;
    case IndexFormat::Uint8: return load<uint8_t>(from);
    case IndexFormat::Uint16: return load<uint16_t>(from);
    case IndexFormat::Uint32: return load<uint32_t>(from);
    }
    return i;
}

// The number of elements of `size` bytes, `stride` apart, within `bytes`.
size_t countWithin(size_t bytes, size_t size, size_t stride)
{
    return bytes < size ? 0 : (bytes - size) / stride + 1;
}

} // namespace

float halfToFloat(uint16_t bits)
{
    const int exponent = bits >> 10 & 31;
    const int mantissa = bits & 1023;
    float value = 0;
    if (exponent == 31)
        value = mantissa != 0 ? std::numeric_limits<float>::quiet_NaN() : std::numeric_limits<float>::infinity();
    else if (exponent == 0)
        value = std::ldexp(static_cast<float>(mantissa), -24);
    else
        value = std::ldexp(static_cast<float>(mantissa + 1024), exponent - 25);
    return (bits & 0x8000) != 0 ? -value : value;
}

AlphaTexture readAlpha(const AlphaPixels &pixels)
{
    const size_t size = sizeOf(pixels.format);
    const size_t rowStride = pixels.rowStride != 0 ? pixels.rowStride : pixels.width * pixels.pixelStride;
    AlphaTexture texture;
    texture.width = pixels.width;
    texture.height = pixels.height;
    if (pixels.width == 0 || pixels.height == 0)
        return texture;
    // Products of two 32-bit sizes and a stride could leave 64 bits: what remains is compared step by step.
    const auto within = [](size_t remaining, size_t steps, size_t stride) {
        return steps == 0 || stride <= remaining / steps;
    };
    const size_t total = pixels.bytes.size();
    const size_t inRow = pixels.width - size_t{1};
    const size_t inColumn = pixels.height - size_t{1};
    if (pixels.offset > total || size > total - pixels.offset ||
        !within(total - pixels.offset - size, inRow, pixels.pixelStride) ||
        !within(total - pixels.offset - size - inRow * pixels.pixelStride, inColumn, rowStride))
        throw BakeError("the alpha values of " + std::to_string(pixels.width) + " x " + std::to_string(pixels.height) +
                        " texels do not lie within " + std::to_string(total) + " bytes");
    if (pixels.format == AlphaFormat::Unorm8) // used where it is
        return AlphaTexture::fromUnorm8(pixels.width, pixels.height,
                                        reinterpret_cast<const uint8_t *>(pixels.bytes.data()) + pixels.offset,
                                        pixels.pixelStride, rowStride, pixels.scale);
    withRowsOf(pixels.format, pixels.scale, [&](const auto &read) {
        texture.appendRows([&](size_t y, float *to) {
            read(pixels.bytes.data() + pixels.offset + y * rowStride, pixels.pixelStride, std::span(to, pixels.width));
        });
    });
    return texture;
}

float UvTerms::value() const
{
    return largest_ > 0 ? std::ldexp(1.0f, std::clamp(ceilLog2(largest_), -100, 100)) : 0;
}

std::vector<TriangleUvs> readUvs(const UvVertices &vertices, double *uvTerms)
{
    const size_t component = componentSize(vertices.format);
    const size_t stride = vertices.stride != 0 ? vertices.stride : 2 * component;
    const size_t vertexCount = countWithin(vertices.bytes.size(), 2 * component, stride);
    const size_t size = indexSize(vertices.indexFormat);
    const size_t count = size != 0 ? vertices.indices.size() / size : vertexCount;
    const auto &m = vertices.transform;
    const bool identity = m == UvVertices().transform;
    UvTerms terms;
    std::vector<TriangleUvs> triangles(count / 3);
    for (size_t i = 0; i < triangles.size() * 3; ++i) {
        const size_t index = indexAt(vertices, i);
        if (index >= vertexCount)
            throw BakeError("index " + std::to_string(i) + " is " + std::to_string(index) + ", of " +
                            std::to_string(vertexCount) + " vertices");
        const std::byte *from = vertices.bytes.data() + index * stride;
        const float u = coordinateAt(from, vertices.format);
        const float v = coordinateAt(from + component, vertices.format);
        triangles[i / 3][i % 3] = {m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]};
        if (!identity)
            terms.add(m, u, v);
    }
    if (uvTerms != nullptr)
        *uvTerms = terms.value();
    return triangles;
}

} // namespace vellum
