// SPDX-License-Identifier: Apache-2.0
#include "compressed.h"

#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>
#include <stdexcept>

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

const int kMeshoptVersion = MESHOPTIMIZER_VERSION;

Bytes meshoptAttributes(const Bytes &vertices, size_t stride, int version)
{
    const bool known = version == 0 || kMeshoptVersion >= 230;
    meshopt_encodeVertexVersion(known ? version : 0);
    Bytes encoded(meshopt_encodeVertexBufferBound(vertices.size() / stride, stride));
    encoded.resize(
        meshopt_encodeVertexBuffer(encoded.data(), encoded.size(), vertices.data(), vertices.size() / stride, stride));
    if (!known)
        encoded[0] = static_cast<uint8_t>(0xa0 | version);
    return encoded;
}

Bytes meshoptColors(const std::vector<float> &rgba)
{
    Bytes filtered(rgba.size());
#if MESHOPTIMIZER_VERSION >= 1000
    meshopt_encodeFilterColor(filtered.data(), rgba.size() / 4, 4, 8, rgba.data());
#endif
    return meshoptAttributes(filtered, 4);
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

} // namespace vellum::test
