#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "gltf/file/tinygltf.h"
#include "gltf/scene.h"

namespace vellum
{
namespace
{

using Matrix = std::array<double, 16>; // column-major, as glTF stores it

constexpr Matrix kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Matrix multiply(const Matrix &a, const Matrix &b)
{
    Matrix m{};
    for (std::size_t column = 0; column < 4; ++column)
        for (std::size_t row = 0; row < 4; ++row)
            for (std::size_t k = 0; k < 4; ++k)
                m[column * 4 + row] += a[k * 4 + row] * b[column * 4 + k];
    return m;
}

Matrix localMatrix(const tinygltf::Node &node)
{
    Matrix m = kIdentity;
    if (node.matrix.size() == 16) {
        std::copy(node.matrix.begin(), node.matrix.end(), m.begin());
        return m;
    }
    std::array<double, 3> scale = {1, 1, 1};
    if (node.scale.size() == 3)
        std::copy(node.scale.begin(), node.scale.end(), scale.begin());
    if (node.rotation.size() == 4) {
        const double x = node.rotation[0], y = node.rotation[1], z = node.rotation[2], w = node.rotation[3];
        m = {1 - 2 * (y * y + z * z),
             2 * (x * y + z * w),
             2 * (x * z - y * w),
             0,
             2 * (x * y - z * w),
             1 - 2 * (x * x + z * z),
             2 * (y * z + x * w),
             0,
             2 * (x * z + y * w),
             2 * (y * z - x * w),
             1 - 2 * (x * x + y * y),
             0,
             0,
             0,
             0,
             1};
    }
    for (std::size_t column = 0; column < 3; ++column)
        for (std::size_t row = 0; row < 3; ++row)
            m[column * 4 + row] *= scale[column];
    if (node.translation.size() == 3)
        std::copy(node.translation.begin(), node.translation.end(), m.begin() + 12);
    return m;
}

// Reads one file. Each step throws GltfError; readGltf puts the file's name in front.
class Reader
{
public:
    explicit Reader(const Document &document) : m_document(document), m_model(document.model()) {}

    Scene read();

private:
    struct Use { // a material in the scene
        std::uint32_t material;
        std::size_t geometry = std::numeric_limits<std::size_t>::max(); // none yet
    };

    void addNode(int index, const Matrix &parent, std::vector<bool> &seen, int depth);
    void addMesh(int index, const Matrix &transform);
    void addPrimitive(PrimitivePlace place, const Matrix &transform);
    Use &useMaterial(int index);
    int useImage(int index);

    const Document &m_document;
    const tinygltf::Model &m_model;
    Scene m_scene;
    std::map<int, Use> m_materials;
    std::map<int, int> m_images;
};

int Reader::useImage(int index)
{
    if (const auto known = m_images.find(index); known != m_images.end())
        return known->second;
    m_scene.images.push_back(index < 0 ? Image{1, 1, {255, 255, 255, 255}} : readImage(m_document, index));
    return m_images[index] = static_cast<int>(m_scene.images.size() - 1);
}

Reader::Use &Reader::useMaterial(int index)
{
    if (const auto known = m_materials.find(index); known != m_materials.end())
        return known->second;
    Material material = readMaterial(m_document, index);
    if (material.image >= 0 || material.masked())
        material.image = useImage(material.image);
    const Use use{static_cast<std::uint32_t>(m_scene.materials.size())};
    m_scene.materials.push_back(std::move(material));
    return m_materials.emplace(index, use).first->second;
}

void Reader::addPrimitive(PrimitivePlace place, const Matrix &transform)
{
    const Primitive primitive = readPrimitive(m_document, place, Positions::Read);
    const std::string what = m_document.nameOf(place);
    const std::size_t count = primitive.positions.size();
    if (primitive.indices.empty())
        return;
    Use &use = useMaterial(primitive.material);
    const Material &material = m_scene.materials[use.material];
    if (primitive.uvs.empty() && readMaterial(m_document, primitive.material).image >= 0 && material.masked())
        throw GltfError(what + " has the masked material \"" + material.name + "\" but no texture coordinates (" +
                        "TEXCOORD_" + std::to_string(material.uvSet) + ")");
    if (use.geometry == std::numeric_limits<std::size_t>::max()) {
        use.geometry = m_scene.geometries.size();
        m_scene.geometries.push_back({use.material, {}, {}, {}});
    }
    Geometry &geometry = m_scene.geometries[use.geometry];
    if (geometry.positions.size() + count > (1u << 28) ||
        geometry.indices.size() + primitive.indices.size() > (1u << 28))
        throw GltfError("the scene is too large");
    if (primitive.uvs.empty())
        geometry.uvs.resize(geometry.uvs.size() + count);
    else
        geometry.uvs.insert(geometry.uvs.end(), primitive.uvs.begin(), primitive.uvs.end());
    const auto first = static_cast<std::uint32_t>(geometry.positions.size());
    for (std::size_t i = 0; i < count; ++i) {
        Vec3 world{};
        for (std::size_t row = 0; row < 3; ++row) {
            double sum = transform[12 + row];
            for (std::size_t k = 0; k < 3; ++k)
                sum += transform[k * 4 + row] * primitive.positions[i][k];
            world[row] = static_cast<float>(sum);
            if (!std::isfinite(world[row]))
                throw GltfError(what + ": the position of vertex " + std::to_string(i) + " is not finite");
        }
        geometry.positions.push_back(world);
    }
    for (const std::uint32_t index : primitive.indices)
        geometry.indices.push_back(first + index);
}

void Reader::addMesh(int index, const Matrix &transform)
{
    if (index < 0 || static_cast<std::size_t>(index) >= m_model.meshes.size())
        throw GltfError("mesh " + std::to_string(index) + " does not exist");
    const tinygltf::Mesh &mesh = m_model.meshes[static_cast<std::size_t>(index)];
    for (std::uint32_t i = 0; i < mesh.primitives.size(); ++i)
        if (const PrimitivePlace place{static_cast<std::uint32_t>(index), i}; isMadeOfTriangles(m_document, place))
            addPrimitive(place, transform);
}

void Reader::addNode(int index, const Matrix &parent, std::vector<bool> &seen, int depth)
{
    if (index < 0 || static_cast<std::size_t>(index) >= m_model.nodes.size())
        throw GltfError("node " + std::to_string(index) + " does not exist");
    const auto place = static_cast<std::size_t>(index);
    // A node with several parents, or a cycle: without this, a small file could ask for endless work.
    if (seen[place])
        throw GltfError("node " + std::to_string(index) + " is used more than once");
    seen[place] = true;
    if (depth > 512)
        throw GltfError("the nodes are nested too deeply");
    const tinygltf::Node &node = m_model.nodes[place];
    const Matrix transform = multiply(parent, localMatrix(node));
    if (node.mesh >= 0)
        addMesh(node.mesh, transform);
    for (const int child : node.children)
        addNode(child, transform, seen, depth + 1);
}

Scene Reader::read()
{
    std::vector<bool> seen(m_model.nodes.size());
    if (!m_model.scenes.empty()) {
        const int wanted = m_model.defaultScene < 0 ? 0 : m_model.defaultScene;
        if (static_cast<std::size_t>(wanted) >= m_model.scenes.size())
            throw GltfError("scene " + std::to_string(wanted) + " does not exist");
        for (const int root : m_model.scenes[static_cast<std::size_t>(wanted)].nodes)
            addNode(root, kIdentity, seen, 0);
    } else {
        for (std::size_t i = 0; i < m_model.meshes.size(); ++i)
            addMesh(static_cast<int>(i), kIdentity);
    }
    if (m_scene.geometries.empty())
        throw GltfError("there are no triangles in it");
    return std::move(m_scene);
}

} // namespace

Scene readGltf(const std::filesystem::path &path)
{
    const Document document(path);
    return document.named([&] { return Reader(document).read(); });
}

} // namespace vellum
