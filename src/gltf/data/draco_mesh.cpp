// SPDX-License-Identifier: Apache-2.0
#include "gltf/data/decompress.h"

#include <algorithm>
#include <draco/compression/config/decoder_options.h>
#include <draco/compression/decode.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>

#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

// The library trusts the numbers of faces and points at the beginning of a stream, so a few bytes could allocate
// gigabytes. These limits are far above what an encoder needs for real meshes.
constexpr uint64_t kElementsAlwaysAllowed = uint64_t{1} << 17;
constexpr uint64_t kMostPerByte = 8;
constexpr uint64_t kMostAttributeBytes = uint64_t{64} << 20;
constexpr uint64_t kMostAttributeBytesPerByte = 256;

// One of the library's decoders, with checks between its steps.
template <typename Decoder>
class CheckedDecoder : public Decoder
{
public:
    explicit CheckedDecoder(size_t encodedBytes) : encodedBytes_(encodedBytes) {}

protected:
    // The stream begins with the numbers (of version 2.2): of vertices and faces, or of faces and points.
    bool DecodeConnectivity() override
    {
        draco::DecoderBuffer ahead(*this->buffer());
        uint32_t first = 0;
        uint32_t second = 0;
        const uint64_t most = kElementsAlwaysAllowed + kMostPerByte * encodedBytes_;
        return draco::DecodeVarint(&first, &ahead) && draco::DecodeVarint(&second, &ahead) && first <= most &&
               second <= most && Decoder::DecodeConnectivity();
    }

    // All attributes are known, and none is decoded yet.
    bool DecodeAllAttributes() override
    {
        uint64_t bytes = 0;
        for (int i = 0; i < this->point_cloud()->num_attributes(); ++i)
            bytes += uint64_t{this->point_cloud()->num_points()} *
                     static_cast<uint64_t>(this->point_cloud()->attribute(i)->byte_stride());
        return bytes <= kMostAttributeBytes + kMostAttributeBytesPerByte * encodedBytes_ &&
               Decoder::DecodeAllAttributes();
    }

private:
    size_t encodedBytes_;
};

template <typename Decoder>
bool decode(std::span<const uint8_t> encoded, draco::Mesh &mesh)
{
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char *>(encoded.data()), encoded.size());
    const draco::DecoderOptions options;
    CheckedDecoder<Decoder> decoder(encoded.size());
    return decoder.Decode(options, &buffer, &mesh).ok();
}

// glTF requires version 2.2; the library's code for older versions is never used.
void checkHeader(std::span<const uint8_t> encoded, const std::string &what)
{
    constexpr size_t kHeaderBytes = 11;
    constexpr std::string_view kMagic = "DRACO";
    if (encoded.size() < kHeaderBytes || !std::equal(kMagic.begin(), kMagic.end(), encoded.begin()))
        throw GltfError(what + ": what it is compressed to is not Draco's");
    if (encoded[5] != 2 || encoded[6] != 2)
        throw GltfUnsupported(what + ": Draco's version " + std::to_string(encoded[5]) + "." +
                              std::to_string(encoded[6]) + " is not 2.2");
}

float normalized(int32_t value, DracoMesh::As as)
{
    const auto f = static_cast<float>(value);
    switch (as) {
    case DracoMesh::As::Signed8: return std::max(f / 127.0f, -1.0f);
    case DracoMesh::As::Unsigned8: return f / 255.0f;
    case DracoMesh::As::Signed16: return std::max(f / 32767.0f, -1.0f);
    case DracoMesh::As::Unsigned16: return f / 65535.0f;
    default: return f;
    }
}

} // namespace

struct DracoMesh::Decoded {
    draco::Mesh mesh;

    [[nodiscard]] const draco::PointAttribute &attribute(int64_t id, const std::string &what) const
    {
        const draco::PointAttribute *found =
            id < 0 || id > 0xffffffff ? nullptr : mesh.GetAttributeByUniqueId(static_cast<uint32_t>(id));
        if (found == nullptr)
            throw GltfError(what + ": Draco's attribute " + std::to_string(id) + " does not exist");
        return *found;
    }
};

DracoMesh::DracoMesh(std::span<const uint8_t> encoded, const std::string &what) : decoded_(std::make_unique<Decoded>())
{
    checkHeader(encoded, what);
    draco::Mesh &mesh = decoded_->mesh;
    const bool isMesh = encoded[7] == draco::TRIANGULAR_MESH;
    const bool edgebreaker = encoded[8] == draco::MESH_EDGEBREAKER_ENCODING;
    if (!isMesh || !(edgebreaker ? decode<draco::MeshEdgebreakerDecoder>(encoded, mesh)
                                 : decode<draco::MeshSequentialDecoder>(encoded, mesh)))
        throw GltfError(what + ": what it is compressed to by Draco cannot be decoded");
    for (draco::FaceIndex face(0); face < mesh.num_faces(); ++face)
        for (const draco::PointIndex &corner : mesh.face(face))
            if (corner.value() >= mesh.num_points())
                throw GltfError(what + ": index " + std::to_string(corner.value()) + " of " +
                                std::to_string(mesh.num_points()) + " vertices");
}

DracoMesh::~DracoMesh() = default;

size_t DracoMesh::vertexCount() const
{
    return decoded_->mesh.num_points();
}

std::vector<uint32_t> DracoMesh::indices() const
{
    std::vector<uint32_t> indices;
    indices.reserve(size_t{3} * decoded_->mesh.num_faces());
    for (draco::FaceIndex face(0); face < decoded_->mesh.num_faces(); ++face)
        for (const draco::PointIndex &corner : decoded_->mesh.face(face))
            indices.push_back(corner.value());
    return indices;
}

uint32_t DracoMesh::components(int64_t id, const std::string &what) const
{
    return static_cast<uint32_t>(std::max(int{decoded_->attribute(id, what).num_components()}, 0));
}

std::vector<float> DracoMesh::floats(int64_t id, uint32_t components, As as, const std::string &what) const
{
    constexpr uint32_t kMostComponents = 4;
    const draco::PointAttribute &attribute = decoded_->attribute(id, what);
    if (components > kMostComponents || this->components(id, what) < components)
        throw GltfError(what + ": Draco's attribute " + std::to_string(id) + " has the wrong type");
    if (attribute.buffer() == nullptr ||
        attribute.byte_offset() + static_cast<int64_t>(attribute.size()) * attribute.byte_stride() >
            static_cast<int64_t>(attribute.buffer()->data_size()))
        throw GltfError(what + ": Draco's attribute " + std::to_string(id) + " is not whole");
    const bool isFloat = attribute.data_type() == draco::DT_FLOAT32;
    std::vector<float> values;
    values.reserve(vertexCount() * components);
    std::array<float, kMostComponents> reals{};
    std::array<int32_t, kMostComponents> integers{};
    for (draco::PointIndex vertex(0); vertex < decoded_->mesh.num_points(); ++vertex) {
        const draco::AttributeValueIndex place = attribute.mapped_index(vertex);
        const auto count = static_cast<int8_t>(components);
        if (place.value() >= attribute.size() || !(isFloat ? attribute.ConvertValue(place, count, reals.data())
                                                           : attribute.ConvertValue(place, count, integers.data())))
            throw GltfError(what + ": Draco's attribute " + std::to_string(id) + " is not whole");
        for (uint32_t c = 0; c < components; ++c)
            values.push_back(isFloat ? reals[c] : normalized(integers[c], as));
    }
    return values;
}

} // namespace vellum
