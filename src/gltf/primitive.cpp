#include "gltf/primitive.h"

#include <algorithm>

#include "gltf/data/accessor.h"
#include "gltf/file/tinygltf.h"

namespace vellum
{
namespace
{

// The corners of triangles, three for each, in the order and winding of glTF 2.0, 3.7.2.1 ("Overview" of meshes).
std::vector<std::uint32_t> unfold(int mode, const std::vector<std::uint32_t> &corners)
{
    const bool strip = mode == TINYGLTF_MODE_TRIANGLE_STRIP;
    if (!strip && mode != TINYGLTF_MODE_TRIANGLE_FAN)
        return corners;
    std::vector<std::uint32_t> indices;
    for (std::size_t i = 0; i + 2 < corners.size(); ++i) {
        if (strip)
            indices.insert(indices.end(), {corners[i], corners[i + 1 + i % 2], corners[i + 2 - i % 2]});
        else
            indices.insert(indices.end(), {corners[i + 1], corners[i + 2], corners[0]});
    }
    return indices;
}

class PrimitiveReader
{
public:
    PrimitiveReader(const Document &document, PrimitivePlace place)
        : m_document(document), m_model(document.model()), m_what(document.nameOf(place)),
          m_source(m_model.meshes.at(place.mesh).primitives.at(place.primitive))
    {
    }

    Primitive read(Positions positions);

private:
    [[nodiscard]] int attribute(const std::string &name) const;
    void readUvs(Primitive &primitive, std::size_t vertices) const;

    const Document &m_document;
    const tinygltf::Model &m_model;
    std::string m_what;
    const tinygltf::Primitive &m_source;
};

int PrimitiveReader::attribute(const std::string &name) const
{
    const auto found = m_source.attributes.find(name);
    return found == m_source.attributes.end() ? -1 : found->second;
}

void PrimitiveReader::readUvs(Primitive &primitive, std::size_t vertices) const
{
    const Material material = readMaterial(m_document, m_source.material);
    const std::string name = "TEXCOORD_" + std::to_string(material.uvSet);
    const int accessor = attribute(name);
    if (material.image < 0 || accessor < 0)
        return;
    const std::vector<float> uvs = readFloats(m_model, accessor, 2, m_what + " " + name);
    if (uvs.size() != 2 * vertices)
        throw GltfError(m_what + " has " + std::to_string(uvs.size() / 2) + " texture coordinates for " +
                        std::to_string(vertices) + " vertices");
    const std::array<double, 6> &m = material.uvTransform;
    const bool identity = m == std::array<double, 6>{1, 0, 0, 0, 1, 0};
    for (std::size_t i = 0; i < vertices; ++i) {
        const float u = uvs[2 * i];
        const float v = uvs[2 * i + 1];
        if (identity)
            primitive.uvs.push_back({u, v});
        else
            primitive.uvs.push_back(
                {static_cast<float>(m[0] * u + m[1] * v + m[2]), static_cast<float>(m[3] * u + m[4] * v + m[5])});
    }
}

Primitive PrimitiveReader::read(Positions positions)
{
    Primitive primitive{.material = m_source.material};
    const int position = attribute("POSITION");
    if (position < 0)
        throw GltfError(m_what + " has no positions");
    const std::size_t vertices = accessorCount(m_model, position, m_what + " POSITION");
    if (positions == Positions::Read) {
        const std::vector<float> values = readFloats(m_model, position, 3, m_what + " POSITION");
        for (std::size_t i = 0; i + 2 < values.size(); i += 3)
            primitive.positions.push_back({values[i], values[i + 1], values[i + 2]});
    }
    std::vector<std::uint32_t> corners;
    if (m_source.indices >= 0) {
        corners = readIndices(m_model, m_source.indices, m_what + " indices");
    } else {
        for (std::size_t i = 0; i < vertices; ++i)
            corners.push_back(static_cast<std::uint32_t>(i));
    }
    for (const std::uint32_t index : corners)
        if (index >= vertices)
            throw GltfError(m_what + ": index " + std::to_string(index) + " of " + std::to_string(vertices) +
                            " vertices");
    primitive.indices = unfold(m_source.mode, corners);
    if (primitive.indices.size() % 3 != 0)
        throw GltfError(m_what + " has " + std::to_string(primitive.indices.size()) + " indices, no multiple of 3");
    readUvs(primitive, vertices);
    if (const int colors = attribute("COLOR_0"); colors >= 0) {
        primitive.alphas = readAlphas(m_model, colors, m_what + " COLOR_0");
        if (!primitive.alphas.empty() && primitive.alphas.size() != vertices)
            throw GltfError(m_what + " has " + std::to_string(primitive.alphas.size()) + " colours for " +
                            std::to_string(vertices) + " vertices");
        if (std::all_of(primitive.alphas.begin(), primitive.alphas.end(), [](float a) { return a == 1.0f; }))
            primitive.alphas.clear();
    }
    return primitive;
}

} // namespace

bool isMadeOfTriangles(const Document &document, PrimitivePlace place)
{
    const int mode = document.model().meshes.at(place.mesh).primitives.at(place.primitive).mode;
    return mode == -1 || mode == TINYGLTF_MODE_TRIANGLES || mode == TINYGLTF_MODE_TRIANGLE_STRIP ||
           mode == TINYGLTF_MODE_TRIANGLE_FAN;
}

std::vector<PrimitivePlace> trianglePrimitives(const Document &document)
{
    std::vector<PrimitivePlace> places;
    const auto &meshes = document.model().meshes;
    for (std::uint32_t m = 0; m < meshes.size(); ++m)
        for (std::uint32_t p = 0; p < meshes[m].primitives.size(); ++p)
            if (isMadeOfTriangles(document, {m, p}))
                places.push_back({m, p});
    return places;
}

Primitive readPrimitive(const Document &document, PrimitivePlace place, Positions positions)
{
    return document.named([&] { return PrimitiveReader(document, place).read(positions); });
}

std::vector<TriangleUvs> triangleUvs(const Primitive &primitive)
{
    std::vector<TriangleUvs> triangles(primitive.triangleCount());
    if (primitive.uvs.empty())
        return triangles;
    for (std::size_t t = 0; t < triangles.size(); ++t)
        for (std::size_t corner = 0; corner < 3; ++corner)
            triangles[t][corner] = primitive.uvs[primitive.indices[3 * t + corner]];
    return triangles;
}

} // namespace vellum
