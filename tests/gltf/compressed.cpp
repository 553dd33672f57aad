// SPDX-License-Identifier: Apache-2.0
#include "compressed.h"

#include <cstring>
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>
#include <png.h>
#include <stdexcept>
#include <webp/encode.h>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#include <stb/stb_image_write.h>

namespace vellum::test
{

Bytes dracoTriangles(const std::vector<std::array<float, 3>> &positions, const std::vector<std::array<float, 2>> &uvs,
                     bool sequential)
{
    const auto faces = static_cast<int>(positions.size() / 3);
    draco::TriangleSoupMeshBuilder builder;
    builder.Start(faces);
    const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
    const int uv = builder.AddAttribute(draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
    for (int i = 0; i < faces; ++i) {
        const auto first = static_cast<size_t>(3 * i);
        const draco::FaceIndex face(static_cast<uint32_t>(i));
        builder.SetAttributeValuesForFace(position, face, positions[first].data(), positions[first + 1].data(),
                                          positions[first + 2].data());
        builder.SetAttributeValuesForFace(uv, face, uvs[first].data(), uvs[first + 1].data(), uvs[first + 2].data());
    }
    const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
    draco::Encoder encoder;
    encoder.SetEncodingMethod(sequential ? draco::MESH_SEQUENTIAL_ENCODING : draco::MESH_EDGEBREAKER_ENCODING);
    draco::EncoderBuffer buffer;
    if (mesh == nullptr || !encoder.EncodeMeshToBuffer(*mesh, &buffer).ok())
        throw std::runtime_error("Draco cannot encode the test's mesh");
    return {buffer.data(), buffer.data() + buffer.size()};
}

Bytes meshoptAttributes(const Bytes &vertices, size_t stride)
{
    Bytes encoded(meshopt_encodeVertexBufferBound(vertices.size() / stride, stride));
    encoded.resize(
        meshopt_encodeVertexBuffer(encoded.data(), encoded.size(), vertices.data(), vertices.size() / stride, stride));
    return encoded;
}

Bytes meshoptTriangles(const std::vector<uint32_t> &indices)
{
    meshopt_encodeIndexVersion(1); // glTF's
    Bytes encoded(meshopt_encodeIndexBufferBound(indices.size(), 1u << 16));
    encoded.resize(meshopt_encodeIndexBuffer(encoded.data(), encoded.size(), indices.data(), indices.size()));
    return encoded;
}

Bytes meshoptIndices(const std::vector<uint32_t> &indices)
{
    meshopt_encodeIndexVersion(1);
    Bytes encoded(meshopt_encodeIndexSequenceBound(indices.size(), 1u << 16));
    encoded.resize(meshopt_encodeIndexSequence(encoded.data(), encoded.size(), indices.data(), indices.size()));
    return encoded;
}

Bytes webpImage(uint32_t width, uint32_t height, const Bytes &rgba)
{
    uint8_t *encoded = nullptr;
    const size_t size = WebPEncodeLosslessRGBA(rgba.data(), static_cast<int>(width), static_cast<int>(height),
                                               static_cast<int>(4 * width), &encoded);
    const Bytes bytes(encoded, encoded + size);
    WebPFree(encoded);
    return bytes;
}

Bytes jpegImage(uint32_t width, uint32_t height, const Bytes &rgb)
{
    Bytes bytes;
    const auto append = [](void *context, void *data, int size) {
        const auto *first = static_cast<const uint8_t *>(data);
        static_cast<Bytes *>(context)->insert(static_cast<Bytes *>(context)->end(), first, first + size);
    };
    stbi_write_jpg_to_func(append, &bytes, static_cast<int>(width), static_cast<int>(height), 3, rgb.data(), 95);
    return bytes;
}

Bytes pngImage(uint32_t width, uint32_t height, int bitDepth, int colorType, bool interlaced, const Bytes &rows)
{
    Bytes bytes;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    png_set_write_fn(
        png, &bytes,
        [](png_structp writer, png_bytep data, size_t size) {
            auto *target = static_cast<Bytes *>(png_get_io_ptr(writer));
            target->insert(target->end(), data, data + size);
        },
        nullptr);
    png_set_IHDR(png, info, width, height, bitDepth, colorType, interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    std::vector<png_bytep> pointers;
    Bytes copy = rows;
    for (size_t row = 0; row < height; ++row)
        pointers.push_back(copy.data() + row * (rows.size() / height));
    png_write_image(png, pointers.data());
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    return bytes;
}

} // namespace vellum::test
