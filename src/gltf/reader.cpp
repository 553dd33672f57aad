#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "gltf/accessor.h"
#include "gltf/container.h"
#include "gltf/image.h"
#include "gltf/scene.h"
#include "gltf/tinygltf.h"

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

// KHR_texture_transform and the set of texture coordinates.
struct UvTransform {
    int set = 0;
    double offset[2] = {0, 0};
    double scale[2] = {1, 1};
    double rotation = 0;

    [[nodiscard]] TexCoord apply(float u, float v) const
    {
        if (offset[0] == 0 && offset[1] == 0 && scale[0] == 1 && scale[1] == 1 && rotation == 0)
            return {u, v};
        const double x = u * scale[0];
        const double y = v * scale[1];
        const double c = std::cos(rotation);
        const double s = std::sin(rotation);
        return {static_cast<float>(c * x + s * y + offset[0]), static_cast<float>(c * y - s * x + offset[1])};
    }
};

double numberOr(const tinygltf::Value &value, double other)
{
    return value.IsNumber() ? value.GetNumberAsDouble() : other;
}

UvTransform uvTransformOf(const tinygltf::TextureInfo &texture)
{
    UvTransform transform;
    transform.set = texture.texCoord;
    const auto found = texture.extensions.find("KHR_texture_transform");
    if (found == texture.extensions.end() || !found->second.IsObject())
        return transform;
    const tinygltf::Value &extension = found->second;
    const auto pair = [&](const char *name, double *values) {
        const tinygltf::Value &value = extension.Get(name);
        if (value.IsArray() && value.ArrayLen() == 2)
            for (std::size_t i = 0; i < 2; ++i)
                values[i] = numberOr(value.Get<tinygltf::Value::Array>()[i], values[i]);
    };
    pair("offset", transform.offset);
    pair("scale", transform.scale);
    transform.rotation = numberOr(extension.Get("rotation"), 0);
    transform.set = static_cast<int>(numberOr(extension.Get("texCoord"), transform.set));
    return transform;
}

Wrap wrapOf(int mode)
{
    switch (mode) {
    case TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE: return Wrap::Clamp;
    case TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT: return Wrap::Mirror;
    default: return Wrap::Repeat;
    }
}

// Reads one file. Each step throws GltfError; readGltf puts the file's name in front.
class Reader
{
public:
    explicit Reader(const std::filesystem::path &path) { loadModel(path, m_model); }

    Scene read();

private:
    struct Use { // a material in the scene
        std::uint32_t material;
        UvTransform uvs;
        std::size_t geometry = std::numeric_limits<std::size_t>::max(); // none yet
    };

    void addNode(int index, const Matrix &parent, std::vector<bool> &seen, int depth);
    void addMesh(int index, const Matrix &transform);
    void addPrimitive(const tinygltf::Primitive &primitive, const Matrix &transform, const std::string &what);
    void addUvs(const tinygltf::Primitive &primitive, const Use &use, std::size_t count, Geometry &geometry,
                const std::string &what);
    Use &useMaterial(int index);
    void readTexture(const tinygltf::TextureInfo &info, Material &material);
    int readImage(int index);

    tinygltf::Model m_model;
    Scene m_scene;
    std::map<int, Use> m_materials;
    std::map<int, int> m_images;
};

int Reader::readImage(int index)
{
    if (const auto known = m_images.find(index); known != m_images.end())
        return known->second;
    const std::string what = "image " + std::to_string(index);
    if (index < 0 || static_cast<std::size_t>(index) >= m_model.images.size())
        throw GltfError(what + " does not exist");
    const tinygltf::Image &image = m_model.images[static_cast<std::size_t>(index)];
    std::span<const std::uint8_t> encoded(image.image);
    if (image.bufferView >= 0)
        encoded = readBufferView(m_model, image.bufferView, what);
    if (encoded.empty())
        throw GltfError(what + (image.uri.empty() ? " is empty" : " (" + image.uri + ") cannot be read"));
    m_scene.images.push_back(decodeImage(encoded, what));
    return m_images[index] = static_cast<int>(m_scene.images.size() - 1);
}

void Reader::readTexture(const tinygltf::TextureInfo &info, Material &material)
{
    if (static_cast<std::size_t>(info.index) >= m_model.textures.size())
        throw GltfError("texture " + std::to_string(info.index) + " does not exist");
    const tinygltf::Texture &texture = m_model.textures[static_cast<std::size_t>(info.index)];
    material.image = readImage(texture.source);
    if (texture.sampler < 0)
        return;
    if (static_cast<std::size_t>(texture.sampler) >= m_model.samplers.size())
        throw GltfError("sampler " + std::to_string(texture.sampler) + " does not exist");
    const tinygltf::Sampler &sampler = m_model.samplers[static_cast<std::size_t>(texture.sampler)];
    material.wrapU = wrapOf(sampler.wrapS);
    material.wrapV = wrapOf(sampler.wrapT);
    material.filter = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST ? Filter::Nearest : Filter::Bilinear;
}

Reader::Use &Reader::useMaterial(int index)
{
    if (const auto known = m_materials.find(index); known != m_materials.end())
        return known->second;
    if (index >= 0 && static_cast<std::size_t>(index) >= m_model.materials.size())
        throw GltfError("material " + std::to_string(index) + " does not exist");
    Material material;
    Use use;
    if (index >= 0) {
        const tinygltf::Material &source = m_model.materials[static_cast<std::size_t>(index)];
        const tinygltf::PbrMetallicRoughness &pbr = source.pbrMetallicRoughness;
        material.name = source.name.empty() ? std::to_string(index) : source.name;
        material.masked = source.alphaMode == "MASK" || source.alphaMode == "BLEND";
        material.alphaCutoff = source.alphaMode == "MASK" ? static_cast<float>(source.alphaCutoff) : 0.5f;
        for (std::size_t i = 0; i < 4 && i < pbr.baseColorFactor.size(); ++i)
            material.baseColor[i] = static_cast<float>(pbr.baseColorFactor[i]);
        if (pbr.baseColorTexture.index >= 0) {
            readTexture(pbr.baseColorTexture, material);
            use.uvs = uvTransformOf(pbr.baseColorTexture);
        } else if (material.masked) {
            throw GltfError("masked material \"" + material.name + "\" has no base colour texture");
        }
    }
    use.material = static_cast<std::uint32_t>(m_scene.materials.size());
    m_scene.materials.push_back(std::move(material));
    return m_materials.emplace(index, use).first->second;
}

void Reader::addUvs(const tinygltf::Primitive &primitive, const Use &use, std::size_t count, Geometry &geometry,
                    const std::string &what)
{
    const Material &material = m_scene.materials[use.material];
    const std::string name = "TEXCOORD_" + std::to_string(use.uvs.set);
    const auto found = primitive.attributes.find(name);
    if (found == primitive.attributes.end() || material.image < 0) {
        if (material.masked)
            throw GltfError(what + " has the masked material \"" + material.name + "\" but no texture coordinates (" +
                            name + ")");
        geometry.uvs.resize(geometry.uvs.size() + count);
        return;
    }
    const std::vector<float> uvs = readFloats(m_model, found->second, 2, what + " " + name);
    if (uvs.size() != 2 * count)
        throw GltfError(what + " has " + std::to_string(uvs.size() / 2) + " texture coordinates for " +
                        std::to_string(count) + " vertices");
    for (std::size_t i = 0; i < count; ++i)
        geometry.uvs.push_back(use.uvs.apply(uvs[2 * i], uvs[2 * i + 1]));
}

void Reader::addPrimitive(const tinygltf::Primitive &primitive, const Matrix &transform, const std::string &what)
{
    if (primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP || primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN)
        throw GltfError(what + ": triangle strips and fans are not supported");
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES)
        return;
    const auto position = primitive.attributes.find("POSITION");
    if (position == primitive.attributes.end())
        throw GltfError(what + " has no positions");
    const std::vector<float> positions = readFloats(m_model, position->second, 3, what + " POSITION");
    const std::size_t count = positions.size() / 3;
    std::vector<std::uint32_t> indices;
    if (primitive.indices >= 0) {
        indices = readIndices(m_model, primitive.indices, what + " indices");
    } else {
        for (std::size_t i = 0; i < count; ++i)
            indices.push_back(static_cast<std::uint32_t>(i));
    }
    if (indices.size() % 3 != 0)
        throw GltfError(what + " has " + std::to_string(indices.size()) + " indices, no multiple of 3");
    for (const std::uint32_t index : indices)
        if (index >= count)
            throw GltfError(what + ": index " + std::to_string(index) + " of " + std::to_string(count) + " vertices");
    if (indices.empty())
        return;

    Use &use = useMaterial(primitive.material);
    if (use.geometry == std::numeric_limits<std::size_t>::max()) {
        use.geometry = m_scene.geometries.size();
        m_scene.geometries.push_back({use.material, {}, {}, {}});
    }
    Geometry &geometry = m_scene.geometries[use.geometry];
    if (geometry.positions.size() + count > (1u << 28) || geometry.indices.size() + indices.size() > (1u << 28))
        throw GltfError("the scene is too large");
    addUvs(primitive, use, count, geometry, what);
    const auto first = static_cast<std::uint32_t>(geometry.positions.size());
    for (std::size_t i = 0; i < count; ++i) {
        Vec3 world{};
        for (std::size_t row = 0; row < 3; ++row) {
            double sum = transform[12 + row];
            for (std::size_t k = 0; k < 3; ++k)
                sum += transform[k * 4 + row] * positions[3 * i + k];
            world[row] = static_cast<float>(sum);
            if (!std::isfinite(world[row]))
                throw GltfError(what + ": the position of vertex " + std::to_string(i) + " is not finite");
        }
        geometry.positions.push_back(world);
    }
    for (const std::uint32_t index : indices)
        geometry.indices.push_back(first + index);
}

void Reader::addMesh(int index, const Matrix &transform)
{
    if (index < 0 || static_cast<std::size_t>(index) >= m_model.meshes.size())
        throw GltfError("mesh " + std::to_string(index) + " does not exist");
    const tinygltf::Mesh &mesh = m_model.meshes[static_cast<std::size_t>(index)];
    for (std::size_t i = 0; i < mesh.primitives.size(); ++i)
        addPrimitive(mesh.primitives[i], transform,
                     "mesh " + std::to_string(index) + " primitive " + std::to_string(i));
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
    try {
        return Reader(path).read();
    } catch (const GltfError &error) {
        throw GltfError(path.string() + ": " + error.what());
    }
}

} // namespace vellum
