// SPDX-License-Identifier: Apache-2.0
#include "gltf/primitive.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "bake/inputs.h"
#include "gltf/data/accessor.h"
#include "gltf/data/decompress.h"

namespace vellum
{
namespace
{

// The number of floats read in the time that Draco takes for a byte, an index or a vertex.
constexpr uint64_t kDracoNumbers = 64;

// The corners of triangles, three for each, in the order and winding of glTF 2.0, 3.7.2.1 ("Overview" of meshes).
// `restart`: an index after which another strip or fan begins.
std::vector<uint32_t> unfold(int mode, std::vector<uint32_t> corners, std::optional<uint32_t> restart)
{
    const bool strip = mode == gltf_json::kTriangleStrip;
    if (!strip && mode != gltf_json::kTriangleFan)
        return corners;
    std::vector<uint32_t> indices;
    indices.reserve(corners.size() < 3 ? 0 : 3 * (corners.size() - 2));
    for (auto first = corners.begin(); first != corners.end();) {
        const auto end = restart ? std::find(first, corners.end(), *restart) : corners.end();
        const std::span<const uint32_t> c(&*first, static_cast<size_t>(end - first));
        for (size_t i = 0; i + 2 < c.size(); ++i) {
            if (strip)
                indices.insert(indices.end(), {c[i], c[i + 1 + i % 2], c[i + 2 - i % 2]});
            else
                indices.insert(indices.end(), {c[i + 1], c[i + 2], c[0]});
        }
        first = end == corners.end() ? end : end + 1;
    }
    return indices;
}

// How the values of an attribute that Draco has compressed become floats, according to its accessor.
DracoMesh::As dracoTypeOf(const gltf_json::Model &model, int accessor, const std::string &what)
{
    static_cast<void>(accessorCount(model, accessor, what)); // checks that it exists
    const gltf_json::Accessor &source = model.accessors[static_cast<size_t>(accessor)];
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
        : document_(document), views_(document.bufferViews()), what_(document.nameOf(place)),
          source_(document.model().meshes.at(place.mesh).primitives.at(place.primitive))
    {
    }

    Primitive read(Positions positions);
    std::vector<float> readOne(const std::string &name, uint32_t components);

private:
    [[nodiscard]] int attribute(const std::string &name) const { return source_.attribute(name); }
    [[nodiscard]] std::string named(const std::string &part) const { return what_ + " " + part; }
    void readDraco();
    [[nodiscard]] size_t countVertices() const;
    [[nodiscard]] int64_t dracoAttribute(const std::string &name) const;
    [[nodiscard]] std::vector<float> floatsOf(const std::string &name, uint32_t components) const;
    [[nodiscard]] std::vector<float> alphasOf(const std::string &name) const;
    [[nodiscard]] std::vector<uint32_t> readCorners() const;
    [[nodiscard]] std::optional<uint32_t> restartIndex() const;
    void readPositions();
    void readIndices();
    void readUvs(const Material &material);
    void readColors();
    [[nodiscard]] bool differsFromFallback(const Material &material) const;
    [[nodiscard]] bool morphs(const std::string &name) const;

    const Document &document_;
    const BufferViews &views_;
    std::string what_;
    const gltf_json::Primitive &source_;
    JsonValue dracoAttributes_; // where it is compressed
    std::optional<DracoMesh> draco_;
    size_t vertices_ = 0;
    Primitive primitive_;
};

// KHR_draco_mesh_compression: the indices and those attributes that the extension lists are in a buffer view of its
// own.
void PrimitiveReader::readDraco()
{
    const JsonValue extension = source_.extensions["KHR_draco_mesh_compression"];
    if (!extension.exists())
        return;
    const auto view = gltf_json::indexIn(extension, "bufferView", what_ + ": KHR_draco_mesh_compression");
    dracoAttributes_ = extension["attributes"];
    if (!view || !dracoAttributes_.isObject())
        throw GltfError(what_ + ": KHR_draco_mesh_compression has no buffer view, or no attributes");
    if (source_.mode != gltf_json::kTriangles)
        throw GltfUnsupported(what_ + " is a strip or fan compressed by Draco");
    const auto encoded = views_.bytes(*view, what_);
    views_.countRead(kDracoNumbers * encoded.size(), what_);
    draco_.emplace(encoded, what_);
    views_.countRead(kDracoNumbers * (draco_->vertexCount() + draco_->indices().size()), what_);
}

// -1 where the attribute is not compressed.
int64_t PrimitiveReader::dracoAttribute(const std::string &name) const
{
    if (!draco_ || !dracoAttributes_[name].exists())
        return -1;
    const auto id = dracoAttributes_[name].integer();
    if (!id || *id < 0)
        throw GltfError(named(name) + ": KHR_draco_mesh_compression has no integer for it");
    return *id;
}

std::vector<float> PrimitiveReader::floatsOf(const std::string &name, uint32_t components) const
{
    const int accessor = attribute(name);
    const int64_t id = dracoAttribute(name);
    if (id < 0)
        return readFloats(views_, accessor, components, named(name));
    return draco_->floats(id, components, dracoTypeOf(document_.model(), accessor, named(name)), named(name));
}

std::vector<float> PrimitiveReader::alphasOf(const std::string &name) const
{
    const int64_t id = dracoAttribute(name);
    if (id < 0)
        return readAlphas(views_, attribute(name), named(name));
    if (draco_->components(id, named(name)) == 3)
        return {};
    const std::vector<float> colors = floatsOf(name, 4);
    std::vector<float> alphas;
    for (size_t i = 3; i < colors.size(); i += 4)
        alphas.push_back(colors[i]);
    return alphas;
}

std::vector<uint32_t> PrimitiveReader::readCorners() const
{
    if (draco_) {
        if (source_.indices != -1)
            static_cast<void>(
                accessorCount(document_.model(), source_.indices, named("indices"))); // checks that it exists
        return draco_->indices();
    }
    if (source_.indices != -1)
        return vellum::readIndices(views_, source_.indices, named("indices"));
    std::vector<uint32_t> corners(vertices_);
    std::iota(corners.begin(), corners.end(), 0u);
    return corners;
}

// KHR_mesh_primitive_restart: the highest number of the indices' type.
std::optional<uint32_t> PrimitiveReader::restartIndex() const
{
    const gltf_json::Model &model = document_.model();
    const auto &used = model.extensionsUsed;
    if (source_.indices < 0 || std::find(used.begin(), used.end(), "KHR_mesh_primitive_restart") == used.end())
        return std::nullopt;
    const int type = model.accessors[static_cast<size_t>(source_.indices)].componentType;
    return static_cast<uint32_t>((uint64_t{1} << 8 * gltf_json::bytesOf(type)) - 1);
}

bool PrimitiveReader::morphs(const std::string &name) const
{
    return std::any_of(source_.targets.begin(), source_.targets.end(),
                       [&](const auto &target) { return target.count(name) > 0; });
}

// All attributes have as many elements (glTF 2.0, 3.7.2.1).
size_t PrimitiveReader::countVertices() const
{
    if (source_.attributes.empty())
        throw GltfError(what_ + " has no attributes");
    if (draco_)
        return draco_->vertexCount();
    auto counted = source_.attributes.find("POSITION");
    if (counted == source_.attributes.end())
        counted = source_.attributes.begin();
    const size_t count = countElements(views_, counted->second, named(counted->first));
    if (count > std::numeric_limits<uint32_t>::max())
        throw GltfError(what_ + " has " + std::to_string(count) + " vertices");
    return count;
}

void PrimitiveReader::readPositions()
{
    if (attribute("POSITION") < 0)
        throw GltfUnsupported(what_ + " has no positions");
    const std::vector<float> values = floatsOf("POSITION", 3);
    if (values.size() != 3 * vertices_)
        throw GltfError(what_ + " has " + std::to_string(values.size() / 3) + " positions for " +
                        std::to_string(vertices_) + " vertices");
    primitive_.positions.reserve(vertices_);
    for (size_t i = 0; i + 2 < values.size(); i += 3)
        primitive_.positions.push_back({values[i], values[i + 1], values[i + 2]});
}

void PrimitiveReader::readIndices()
{
    std::vector<uint32_t> corners = readCorners(); // throws where there is no such accessor
    primitive_.indices = unfold(source_.mode, std::move(corners), restartIndex());
    for (const uint32_t index : primitive_.indices)
        if (index >= vertices_)
            throw GltfError(what_ + ": index " + std::to_string(index) + " of " + std::to_string(vertices_) +
                            " vertices");
    if (primitive_.indices.size() % 3 != 0)
        throw GltfError(what_ + " has " + std::to_string(primitive_.indices.size()) + " indices, no multiple of 3");
}

void PrimitiveReader::readUvs(const Material &material)
{
    const std::string name = "TEXCOORD_" + std::to_string(material.uvSet);
    if (material.image < 0 || attribute(name) < 0)
        return;
    const std::vector<float> uvs = floatsOf(name, 2);
    if (uvs.size() != 2 * vertices_)
        throw GltfError(what_ + " has " + std::to_string(uvs.size() / 2) + " texture coordinates for " +
                        std::to_string(vertices_) + " vertices");
    const std::array<double, 6> &m = material.uvTransform;
    const bool identity = m == std::array<double, 6>{1, 0, 0, 0, 1, 0};
    primitive_.uvs.reserve(vertices_);
    UvTerms terms;
    for (size_t i = 0; i < vertices_; ++i) {
        const float u = uvs[2 * i];
        const float v = uvs[2 * i + 1];
        if (identity)
            primitive_.uvs.push_back({u, v});
        else
            primitive_.uvs.push_back(
                {static_cast<float>(m[0] * u + m[1] * v + m[2]), static_cast<float>(m[3] * u + m[4] * v + m[5])});
        if (!identity)
            terms.add(m, u, v);
    }
    primitive_.uvTerms = terms.value();
    primitive_.morphed |= morphs(name);
}

void PrimitiveReader::readColors()
{
    if (attribute("COLOR_0") < 0)
        return;
    std::vector<float> &alphas = primitive_.alphas;
    alphas = alphasOf("COLOR_0");
    if (!alphas.empty() && alphas.size() != vertices_)
        throw GltfError(what_ + " has " + std::to_string(alphas.size()) + " colours for " + std::to_string(vertices_) +
                        " vertices");
    primitive_.morphed |= !alphas.empty() && morphs("COLOR_0");
    if (std::all_of(alphas.begin(), alphas.end(), [](float a) { return a == 1.0f; }))
        alphas.clear();
}

// Compares the data that determine a micromap: the triangles, their order and corners, and where the texture is read.
bool PrimitiveReader::differsFromFallback(const Material &material) const
{
    const gltf_json::Model &model = document_.model();
    const std::string uvName = "TEXCOORD_" + std::to_string(material.uvSet);
    const int uvAccessor = attribute(uvName);
    std::vector<int> accessors{source_.indices, uvAccessor, attribute("COLOR_0")};
    std::erase_if(accessors, [&](int a) { return a < 0 || static_cast<size_t>(a) >= model.accessors.size(); });
    const auto viewOf = [&](int a) { return model.accessors[static_cast<size_t>(a)].bufferView; };
    if (!draco_)
        return std::any_of(accessors.begin(), accessors.end(), [&](int a) {
            return viewOf(a) >= 0 && views_.differsFromFallback(viewOf(a), named("fallback"));
        });
    if (model.isRequired("KHR_draco_mesh_compression") || source_.indices < 0 || viewOf(source_.indices) < 0)
        return false;
    const std::vector<uint32_t> corners = draco_->indices();
    const std::vector<uint32_t> others = vellum::readIndices(views_, source_.indices, named("indices"));
    if (corners.size() != others.size())
        return true;
    // Compares values of corners, of which each vertex has `components`. Without values, all are 1.
    const auto differ = [&](const std::vector<float> &values, const std::vector<float> &otherValues,
                            size_t components) {
        const auto valueOf = [&](const std::vector<float> &of, size_t vertex, size_t component) {
            const size_t i = components * vertex + component;
            return of.empty() ? 1.0f : i < of.size() ? of[i] : std::numeric_limits<float>::quiet_NaN();
        };
        for (size_t i = 0; i < corners.size(); ++i)
            for (size_t c = 0; c < components; ++c)
                if (valueOf(values, corners[i], c) != valueOf(otherValues, others[i], c))
                    return true;
        return false;
    };
    if (uvAccessor >= 0 && differ(floatsOf(uvName, 2), readFloats(views_, uvAccessor, 2, named(uvName)), 2))
        return true;
    const int colors = attribute("COLOR_0");
    return colors >= 0 && differ(primitive_.alphas, readAlphas(views_, colors, named("COLOR_0")), 1);
}

Primitive PrimitiveReader::read(Positions positions)
{
    primitive_.material = source_.material;
    readDraco();
    vertices_ = countVertices();
    if (positions == Positions::Read)
        readPositions();
    readIndices();
    const Material material = readMaterial(document_, source_.material);
    readUvs(material);
    readColors();
    primitive_.twofold = material.masked() && differsFromFallback(material);
    return std::move(primitive_);
}

std::vector<float> PrimitiveReader::readOne(const std::string &name, uint32_t components)
{
    readDraco();
    vertices_ = countVertices();
    std::vector<float> values = floatsOf(name, components);
    if (values.size() != components * vertices_)
        throw GltfError(named(name) + " has not one element for each of " + std::to_string(vertices_) + " vertices");
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
    for (uint32_t m = 0; m < meshes.size(); ++m)
        for (uint32_t p = 0; p < meshes[m].primitives.size(); ++p)
            if (isMadeOfTriangles(document, {m, p}))
                places.push_back({m, p});
    return places;
}

Primitive readPrimitive(const Document &document, PrimitivePlace place, Positions positions)
{
    return document.named([&] { return PrimitiveReader(document, place).read(positions); });
}

std::vector<float> readAttribute(const Document &document, PrimitivePlace place, const std::string &name,
                                 uint32_t components)
{
    return document.named([&] { return PrimitiveReader(document, place).readOne(name, components); });
}

std::vector<TriangleUvs> triangleUvs(const Primitive &primitive)
{
    std::vector<TriangleUvs> triangles(primitive.triangleCount());
    if (primitive.uvs.empty())
        return triangles;
    for (size_t t = 0; t < triangles.size(); ++t)
        for (size_t corner = 0; corner < 3; ++corner)
            triangles[t][corner] = primitive.uvs[primitive.indices[3 * t + corner]];
    return triangles;
}

} // namespace vellum
