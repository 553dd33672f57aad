#include "gltf/primitive.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "gltf/data/accessor.h"
#include "gltf/data/draco_mesh.h"

namespace vellum
{
namespace
{

// The corners of triangles, three for each, in the order and winding of glTF 2.0, 3.7.2.1 ("Overview" of meshes).
std::vector<std::uint32_t> unfold(int mode, std::vector<std::uint32_t> corners)
{
    const bool strip = mode == gltf_json::kTriangleStrip;
    if (!strip && mode != gltf_json::kTriangleFan)
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

// How the accessor of an attribute that Draco has compressed says its values become floats.
DracoMesh::As dracoTypeOf(const gltf_json::Model &model, int accessor, const std::string &what)
{
    static_cast<void>(accessorCount(model, accessor, what)); // that it exists
    const gltf_json::Accessor &source = model.accessors[static_cast<std::size_t>(accessor)];
    if (!source.normalized)
        return DracoMesh::As::IntegersOrFloats;
    switch (source.componentType) {
    case gltf_json::kByte: return DracoMesh::As::Signed8;
    case gltf_json::kUnsignedByte: return DracoMesh::As::Unsigned8;
    case gltf_json::kShort: return DracoMesh::As::Signed16;
    case gltf_json::kUnsignedShort: return DracoMesh::As::Unsigned16;
    default: return DracoMesh::As::IntegersOrFloats;
    }
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
    std::vector<float> readOne(const std::string &name, std::uint32_t components);

private:
    [[nodiscard]] int attribute(const std::string &name) const { return m_source.attribute(name); }
    [[nodiscard]] std::string named(const std::string &part) const { return m_what + " " + part; }
    void readDraco();
    [[nodiscard]] std::size_t countVertices() const;
    [[nodiscard]] std::int64_t dracoAttribute(const std::string &name) const;
    [[nodiscard]] std::vector<float> floatsOf(const std::string &name, std::uint32_t components) const;
    [[nodiscard]] std::vector<float> alphasOf(const std::string &name) const;
    [[nodiscard]] std::vector<std::uint32_t> readCorners() const;
    void readPositions();
    void readIndices();
    void readUvs(const Material &material);
    void readColors();
    [[nodiscard]] bool differsFromFallback(const Material &material) const;
    [[nodiscard]] bool morphs(const std::string &name) const;

    const Document &m_document;
    const BufferViews &m_views;
    std::string m_what;
    const gltf_json::Primitive &m_source;
    JsonValue m_dracoAttributes; // where it is compressed
    std::optional<DracoMesh> m_draco;
    std::size_t m_vertices = 0;
    Primitive m_primitive;
};

// KHR_draco_mesh_compression: the indices and those attributes that the extension lists are in a buffer view of its
// own.
void PrimitiveReader::readDraco()
{
    const JsonValue extension = m_source.extensions["KHR_draco_mesh_compression"];
    if (!extension.exists())
        return;
    const auto view = gltf_json::indexIn(extension, "bufferView", m_what + ": KHR_draco_mesh_compression");
    m_dracoAttributes = extension["attributes"];
    if (!view || !m_dracoAttributes.isObject())
        throw GltfError(m_what + ": KHR_draco_mesh_compression has no buffer view, or no attributes");
    if (m_source.mode != gltf_json::kTriangles)
        throw GltfUnsupported(m_what + " is a strip or fan compressed by Draco");
    m_draco.emplace(m_views.bytes(*view, m_what), m_what);
}

// -1 where the attribute is not compressed.
std::int64_t PrimitiveReader::dracoAttribute(const std::string &name) const
{
    if (!m_draco || !m_dracoAttributes[name].exists())
        return -1;
    const auto id = m_dracoAttributes[name].integer();
    if (!id || *id < 0)
        throw GltfError(named(name) + ": KHR_draco_mesh_compression has no integer for it");
    return *id;
}

std::vector<float> PrimitiveReader::floatsOf(const std::string &name, std::uint32_t components) const
{
    const int accessor = attribute(name);
    const std::int64_t id = dracoAttribute(name);
    if (id < 0)
        return readFloats(m_views, accessor, components, named(name));
    return m_draco->floats(id, components, dracoTypeOf(m_document.model(), accessor, named(name)), named(name));
}

std::vector<float> PrimitiveReader::alphasOf(const std::string &name) const
{
    const std::int64_t id = dracoAttribute(name);
    if (id < 0)
        return readAlphas(m_views, attribute(name), named(name));
    if (m_draco->components(id, named(name)) == 3)
        return {};
    const std::vector<float> colors = floatsOf(name, 4);
    std::vector<float> alphas;
    for (std::size_t i = 3; i < colors.size(); i += 4)
        alphas.push_back(colors[i]);
    return alphas;
}

std::vector<std::uint32_t> PrimitiveReader::readCorners() const
{
    if (m_draco)
        return m_draco->indices();
    if (m_source.indices != -1)
        return vellum::readIndices(m_views, m_source.indices, named("indices"));
    std::vector<std::uint32_t> corners(m_vertices);
    std::iota(corners.begin(), corners.end(), 0u);
    return corners;
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
    if (m_draco)
        return m_draco->vertexCount();
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
    if (attribute("POSITION") < 0)
        throw GltfUnsupported(m_what + " has no positions");
    const std::vector<float> values = floatsOf("POSITION", 3);
    m_primitive.positions.reserve(m_vertices);
    for (std::size_t i = 0; i + 2 < values.size(); i += 3)
        m_primitive.positions.push_back({values[i], values[i + 1], values[i + 2]});
}

void PrimitiveReader::readIndices()
{
    std::vector<std::uint32_t> corners = readCorners();
    for (const std::uint32_t index : corners)
        if (index >= m_vertices)
            throw GltfError(m_what + ": index " + std::to_string(index) + " of " + std::to_string(m_vertices) +
                            " vertices");
    m_primitive.indices = unfold(m_source.mode, std::move(corners));
    if (m_primitive.indices.size() % 3 != 0)
        throw GltfError(m_what + " has " + std::to_string(m_primitive.indices.size()) + " indices, no multiple of 3");
}

void PrimitiveReader::readUvs(const Material &material)
{
    const std::string name = "TEXCOORD_" + std::to_string(material.uvSet);
    if (material.image < 0 || attribute(name) < 0)
        return;
    const std::vector<float> uvs = floatsOf(name, 2);
    if (uvs.size() != 2 * m_vertices)
        throw GltfError(m_what + " has " + std::to_string(uvs.size() / 2) + " texture coordinates for " +
                        std::to_string(m_vertices) + " vertices");
    const std::array<double, 6> &m = material.uvTransform;
    const bool identity = m == std::array<double, 6>{1, 0, 0, 0, 1, 0};
    m_primitive.uvs.reserve(m_vertices);
    double terms = 0;
    for (std::size_t i = 0; i < m_vertices; ++i) {
        const float u = uvs[2 * i];
        const float v = uvs[2 * i + 1];
        if (identity)
            m_primitive.uvs.push_back({u, v});
        else
            m_primitive.uvs.push_back(
                {static_cast<float>(m[0] * u + m[1] * v + m[2]), static_cast<float>(m[3] * u + m[4] * v + m[5])});
        for (const std::size_t row : {0u, 3u}) {
            const double sum = std::abs(m[row] * u) + std::abs(m[row + 1] * v) + std::abs(m[row + 2]);
            if (!identity && std::isfinite(sum))
                terms = std::max(terms, sum);
        }
    }
    if (terms > 0)
        m_primitive.uvTerms = static_cast<float>(std::exp2(std::clamp(std::ceil(std::log2(terms)), -100.0, 100.0)));
    m_primitive.morphed |= morphs(name);
}

void PrimitiveReader::readColors()
{
    if (attribute("COLOR_0") < 0)
        return;
    std::vector<float> &alphas = m_primitive.alphas;
    alphas = alphasOf("COLOR_0");
    if (!alphas.empty() && alphas.size() != m_vertices)
        throw GltfError(m_what + " has " + std::to_string(alphas.size()) + " colours for " +
                        std::to_string(m_vertices) + " vertices");
    m_primitive.morphed |= !alphas.empty() && morphs("COLOR_0");
    if (std::all_of(alphas.begin(), alphas.end(), [](float a) { return a == 1.0f; }))
        alphas.clear();
}

// Of what decides a micromap: the triangles, their order and corners, and where the texture is read.
bool PrimitiveReader::differsFromFallback(const Material &material) const
{
    const gltf_json::Model &model = m_document.model();
    const std::string uvName = "TEXCOORD_" + std::to_string(material.uvSet);
    const int uvAccessor = attribute(uvName);
    std::vector<int> accessors{m_source.indices, uvAccessor, attribute("COLOR_0")};
    std::erase_if(accessors, [&](int a) { return a < 0 || static_cast<std::size_t>(a) >= model.accessors.size(); });
    const auto viewOf = [&](int a) { return model.accessors[static_cast<std::size_t>(a)].bufferView; };
    if (!m_draco)
        return std::any_of(accessors.begin(), accessors.end(), [&](int a) {
            return viewOf(a) >= 0 && m_views.differsFromFallback(viewOf(a), named("fallback"));
        });
    if (model.isRequired("KHR_draco_mesh_compression") || m_source.indices < 0 || viewOf(m_source.indices) < 0)
        return false;
    const std::vector<std::uint32_t> corners = m_draco->indices();
    const std::vector<std::uint32_t> others = vellum::readIndices(m_views, m_source.indices, named("indices"));
    if (corners.size() != others.size())
        return true;
    if (uvAccessor < 0)
        return corners != others;
    const std::vector<float> uvs = floatsOf(uvName, 2);
    const std::vector<float> otherUvs = readFloats(m_views, uvAccessor, 2, named(uvName));
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const std::size_t here = 2 * std::size_t{corners[i]};
        const std::size_t there = 2 * std::size_t{others[i]};
        if (here + 1 >= uvs.size() || there + 1 >= otherUvs.size() || uvs[here] != otherUvs[there] ||
            uvs[here + 1] != otherUvs[there + 1])
            return true;
    }
    return false;
}

Primitive PrimitiveReader::read(Positions positions)
{
    m_primitive.material = m_source.material;
    readDraco();
    m_vertices = countVertices();
    if (positions == Positions::Read)
        readPositions();
    readIndices();
    const Material material = readMaterial(m_document, m_source.material);
    readUvs(material);
    readColors();
    m_primitive.twofold = material.masked() && differsFromFallback(material);
    return std::move(m_primitive);
}

std::vector<float> PrimitiveReader::readOne(const std::string &name, std::uint32_t components)
{
    readDraco();
    m_vertices = countVertices();
    std::vector<float> values = floatsOf(name, components);
    if (values.size() != components * m_vertices)
        throw GltfError(named(name) + " has not one element for each of " + std::to_string(m_vertices) + " vertices");
    return values;
}

} // namespace

bool isMadeOfTriangles(const Document &document, PrimitivePlace place)
{
    const int mode = document.model().meshes.at(place.mesh).primitives.at(place.primitive).mode;
    return mode == gltf_json::kTriangles || mode == gltf_json::kTriangleStrip || mode == gltf_json::kTriangleFan;
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

std::vector<float> readAttribute(const Document &document, PrimitivePlace place, const std::string &name,
                                 std::uint32_t components)
{
    return document.named([&] { return PrimitiveReader(document, place).readOne(name, components); });
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
