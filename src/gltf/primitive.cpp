#include "gltf/primitive.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "gltf/data/accessor.h"
#include "gltf/file/tinygltf.h"

namespace vellum
{
namespace
{

// The corners of triangles, three for each, in the order and winding of glTF 2.0, 3.7.2.1 ("Overview" of meshes).
std::vector<std::uint32_t> unfold(int mode, std::vector<std::uint32_t> corners)
{
    const bool strip = mode == TINYGLTF_MODE_TRIANGLE_STRIP;
    if (!strip && mode != TINYGLTF_MODE_TRIANGLE_FAN)
        return corners;
    std::vector<std::uint32_t> indices;
    indices.reserve(corners.size() < 3 ? 0 : 3 * (corners.size() - 2));
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
        : m_document(document), m_views(document.bufferViews()), m_what(document.nameOf(place)),
          m_source(document.model().meshes.at(place.mesh).primitives.at(place.primitive))
    {
    }

    Primitive read(Positions positions);

private:
    [[nodiscard]] int attribute(const std::string &name) const;
    [[nodiscard]] std::string named(const std::string &part) const { return m_what + " " + part; }
    [[nodiscard]] std::size_t countVertices() const;
    void readPositions();
    void readIndices();
    void readUvs(const Material &material);
    void readColors();
    [[nodiscard]] bool morphs(const std::string &name) const;

    const Document &m_document;
    const BufferViews &m_views;
    std::string m_what;
    const tinygltf::Primitive &m_source;
    std::size_t m_vertices = 0;
    Primitive m_primitive;
};

int PrimitiveReader::attribute(const std::string &name) const
{
    const auto found = m_source.attributes.find(name);
    return found == m_source.attributes.end() ? -1 : found->second;
}

bool PrimitiveReader::morphs(const std::string &name) const
{
    return std::any_of(m_source.targets.begin(), m_source.targets.end(),
                       [&](const auto &target) { return target.count(name) > 0; });
}

// All attributes have as many elements (glTF 2.0, 3.7.2.1).
std::size_t PrimitiveReader::countVertices() const
{
    if (m_source.attributes.empty())
        throw GltfError(m_what + " has no attributes");
    auto teller = m_source.attributes.find("POSITION");
    if (teller == m_source.attributes.end())
        teller = m_source.attributes.begin();
    const std::size_t count = countElements(m_views, teller->second, named(teller->first));
    if (count > std::numeric_limits<std::uint32_t>::max())
        throw GltfError(m_what + " has " + std::to_string(count) + " vertices");
    return count;
}

void PrimitiveReader::readPositions()
{
    const int position = attribute("POSITION");
    if (position < 0)
        throw GltfUnsupported(m_what + " has no positions");
    const std::vector<float> values = readFloats(m_views, position, 3, named("POSITION"));
    m_primitive.positions.reserve(m_vertices);
    for (std::size_t i = 0; i + 2 < values.size(); i += 3)
        m_primitive.positions.push_back({values[i], values[i + 1], values[i + 2]});
}

void PrimitiveReader::readIndices()
{
    std::vector<std::uint32_t> corners;
    if (m_source.indices != -1) {
        corners = vellum::readIndices(m_views, m_source.indices, named("indices"));
        for (const std::uint32_t index : corners)
            if (index >= m_vertices)
                throw GltfError(m_what + ": index " + std::to_string(index) + " of " + std::to_string(m_vertices) +
                                " vertices");
    } else {
        corners.resize(m_vertices);
        std::iota(corners.begin(), corners.end(), 0u);
    }
    m_primitive.indices = unfold(m_source.mode, std::move(corners));
    if (m_primitive.indices.size() % 3 != 0)
        throw GltfError(m_what + " has " + std::to_string(m_primitive.indices.size()) + " indices, no multiple of 3");
}

void PrimitiveReader::readUvs(const Material &material)
{
    const std::string name = "TEXCOORD_" + std::to_string(material.uvSet);
    const int accessor = attribute(name);
    if (material.image < 0 || accessor < 0)
        return;
    const std::vector<float> uvs = readFloats(m_views, accessor, 2, named(name));
    if (uvs.size() != 2 * m_vertices)
        throw GltfError(m_what + " has " + std::to_string(uvs.size() / 2) + " texture coordinates for " +
                        std::to_string(m_vertices) + " vertices");
    const std::array<double, 6> &m = material.uvTransform;
    const bool identity = m == std::array<double, 6>{1, 0, 0, 0, 1, 0};
    m_primitive.uvs.reserve(m_vertices);
    for (std::size_t i = 0; i < m_vertices; ++i) {
        const float u = uvs[2 * i];
        const float v = uvs[2 * i + 1];
        if (identity)
            m_primitive.uvs.push_back({u, v});
        else
            m_primitive.uvs.push_back(
                {static_cast<float>(m[0] * u + m[1] * v + m[2]), static_cast<float>(m[3] * u + m[4] * v + m[5])});
    }
    m_primitive.morphed |= morphs(name);
}

void PrimitiveReader::readColors()
{
    const int colors = attribute("COLOR_0");
    if (colors < 0)
        return;
    std::vector<float> &alphas = m_primitive.alphas;
    alphas = readAlphas(m_views, colors, named("COLOR_0"));
    if (!alphas.empty() && alphas.size() != m_vertices)
        throw GltfError(m_what + " has " + std::to_string(alphas.size()) + " colours for " +
                        std::to_string(m_vertices) + " vertices");
    m_primitive.morphed |= !alphas.empty() && morphs("COLOR_0");
    if (std::all_of(alphas.begin(), alphas.end(), [](float a) { return a == 1.0f; }))
        alphas.clear();
}

Primitive PrimitiveReader::read(Positions positions)
{
    m_primitive.material = m_source.material;
    m_vertices = countVertices();
    if (positions == Positions::Read)
        readPositions();
    readIndices();
    readUvs(readMaterial(m_document, m_source.material));
    readColors();
    return std::move(m_primitive);
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
