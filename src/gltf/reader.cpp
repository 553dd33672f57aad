// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <vector>

#include "gltf/alpha_textures.h"
#include "gltf/data/accessor.h"
#include "gltf/file/model.h"
#include "gltf/primitive.h"
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
    for (size_t column = 0; column < 4; ++column)
        for (size_t row = 0; row < 4; ++row)
            for (size_t k = 0; k < 4; ++k)
                m[column * 4 + row] += a[k * 4 + row] * b[column * 4 + k];
    return m;
}

// translation * rotation * scale; `rotation` is a quaternion x, y, z, w.
Matrix compose(const std::array<double, 3> &translation, const std::array<double, 4> &rotation,
               const std::array<double, 3> &scale)
{
    const auto [x, y, z, w] = rotation;
    Matrix m = kIdentity;
    const double turn[9] = {1 - 2 * (y * y + z * z), 2 * (x * y + z * w),     2 * (x * z - y * w),
                            2 * (x * y - z * w),     1 - 2 * (x * x + z * z), 2 * (y * z + x * w),
                            2 * (x * z + y * w),     2 * (y * z - x * w),     1 - 2 * (x * x + y * y)};
    for (size_t column = 0; column < 3; ++column)
        for (size_t row = 0; row < 3; ++row)
            m[column * 4 + row] = turn[column * 3 + row] * scale[column];
    std::copy(translation.begin(), translation.end(), m.begin() + 12);
    return m;
}

// A node's own.
Matrix localMatrix(const gltf_json::Node &node)
{
    if (node.matrix.size() == 16) {
        Matrix m = kIdentity;
        std::copy(node.matrix.begin(), node.matrix.end(), m.begin());
        return m;
    }
    std::array<double, 3> translation = {0, 0, 0};
    std::array<double, 4> rotation = {0, 0, 0, 1};
    std::array<double, 3> scale = {1, 1, 1};
    if (node.translation.size() == 3)
        std::copy(node.translation.begin(), node.translation.end(), translation.begin());
    if (node.rotation.size() == 4)
        std::copy(node.rotation.begin(), node.rotation.end(), rotation.begin());
    if (node.scale.size() == 3)
        std::copy(node.scale.begin(), node.scale.end(), scale.begin());
    return compose(translation, rotation, scale);
}

std::array<double, 3> transformed(const Matrix &matrix, const std::array<double, 3> &point)
{
    std::array<double, 3> result{};
    for (size_t row = 0; row < 3; ++row)
        result[row] =
            matrix[row] * point[0] + matrix[4 + row] * point[1] + matrix[8 + row] * point[2] + matrix[12 + row];
    return result;
}

// The limit for sets of joints and weights; they are in memory together.
constexpr int kMostSets = 8;

const gltf_json::Primitive &primitiveAt(const Document &document, PrimitivePlace place)
{
    return document.model().meshes.at(place.mesh).primitives.at(place.primitive);
}

// `components` values for each vertex.
std::vector<float> readAttribute(const Document &document, int accessor, uint32_t components, size_t vertices,
                                 const std::string &what)
{
    if (accessorCount(document.model(), accessor, what) != vertices)
        throw GltfError(what + " has not one element for each of " + std::to_string(vertices) + " vertices");
    return readFloats(document.bufferViews(), accessor, components, what);
}

// The default weights of a mesh's morph targets: those of the node that shows it, or else its own; empty where all are
// zero.
std::vector<double> morphWeights(const Document &document, uint32_t mesh, const std::vector<double> &ofNode)
{
    const std::vector<double> &weights = ofNode.empty() ? document.model().meshes.at(mesh).weights : ofNode;
    if (std::all_of(weights.begin(), weights.end(), [](double weight) { return weight == 0; }))
        return {};
    return weights;
}

// Adds the primitive's morph targets to `positions`, each times its weight. Throws GltfError.
void morph(const Document &document, PrimitivePlace place, const std::vector<double> &weights,
           std::vector<Vec3> &positions)
{
    const gltf_json::Primitive &primitive = primitiveAt(document, place);
    for (size_t target = 0; target < std::min(weights.size(), primitive.targets.size()); ++target) {
        const auto found = primitive.targets[target].find("POSITION");
        if (weights[target] == 0 || found == primitive.targets[target].end())
            continue;
        const std::string what = document.nameOf(place) + " morph target " + std::to_string(target) + " POSITION";
        const std::vector<float> moves = readAttribute(document, found->second, 3, positions.size(), what);
        for (size_t i = 0; i < positions.size(); ++i)
            for (size_t k = 0; k < 3; ++k)
                positions[i][k] += static_cast<float>(weights[target] * static_cast<double>(moves[3 * i + k]));
    }
}

// A skin's matrices, one for each joint, from the joints' own matrices in the world: `world` has one for each node.
// Throws GltfError.
std::vector<Matrix> jointMatrices(const Document &document, int index, const std::vector<Matrix> &world)
{
    const gltf_json::Model &model = document.model();
    const std::string what = "skin " + std::to_string(index);
    if (index < 0 || static_cast<size_t>(index) >= model.skins.size())
        throw GltfError(what + " does not exist");
    const gltf_json::Skin &skin = model.skins[static_cast<size_t>(index)];
    std::vector<float> inverse;
    if (skin.inverseBindMatrices >= 0)
        inverse = readFloats(document.bufferViews(), skin.inverseBindMatrices, 16, what + " inverseBindMatrices");
    if (!inverse.empty() && inverse.size() < 16 * skin.joints.size())
        throw GltfError(what + " has " + std::to_string(inverse.size() / 16) + " inverse bind matrices for " +
                        std::to_string(skin.joints.size()) + " joints");
    std::vector<Matrix> matrices;
    for (size_t i = 0; i < skin.joints.size(); ++i) {
        const auto joint = static_cast<size_t>(skin.joints[i]);
        if (joint >= world.size())
            throw GltfError(what + ": node " + std::to_string(skin.joints[i]) + " does not exist");
        Matrix bind = kIdentity;
        if (!inverse.empty())
            std::copy_n(inverse.begin() + static_cast<ptrdiff_t>(16 * i), 16, bind.begin());
        matrices.push_back(multiply(world[joint], bind));
    }
    return matrices;
}

// glTF 2.0, 3.7.3.3 ("Skinned Mesh Attributes"): the weighted sum of the matrices of all sets of joints.
// Moves `positions` to the world: JOINTS_n and WEIGHTS_n say by which joints. Throws GltfError.
void moveBySkin(const Document &document, PrimitivePlace place, const std::vector<Matrix> &joints,
                std::vector<Vec3> &positions)
{
    struct Set { // four for each vertex
        std::vector<float> joints, weights;
    };
    const gltf_json::Primitive &primitive = primitiveAt(document, place);
    std::vector<Set> sets;
    for (int n = 0; primitive.attribute("JOINTS_" + std::to_string(n)) >= 0; ++n) {
        if (n == kMostSets)
            throw GltfUnsupported(document.nameOf(place) + " has more than " + std::to_string(kMostSets) +
                                  " sets of joints");
        const auto read = [&](const std::string &name) { return readAttribute(document, place, name, 4); };
        sets.push_back({read("JOINTS_" + std::to_string(n)), read("WEIGHTS_" + std::to_string(n))});
    }
    if (sets.empty())
        return;
    for (size_t vertex = 0; vertex < positions.size(); ++vertex) {
        Matrix sum{};
        for (const Set &set : sets) {
            for (size_t i = 4 * vertex; i < 4 * vertex + 4; ++i) {
                if (set.weights[i] == 0)
                    continue;
                if (!(set.joints[i] >= 0 && set.joints[i] < static_cast<float>(joints.size())))
                    throw GltfError(document.nameOf(place) + ": vertex " + std::to_string(vertex) +
                                    " is moved by a joint that the skin does not have");
                const Matrix &joint = joints[static_cast<size_t>(set.joints[i])];
                for (size_t k = 0; k < 16; ++k)
                    sum[k] += static_cast<double>(set.weights[i]) * joint[k];
            }
        }
        Vec3 &p = positions[vertex];
        const auto moved = transformed(sum, {p[0], p[1], p[2]});
        for (size_t k = 0; k < 3; ++k)
            p[k] = static_cast<float>(moved[k]);
    }
}

constexpr size_t kMostInstances = size_t{1} << 20;
constexpr size_t kMostVertices = size_t{1} << 26; // and triangles
constexpr int kDeepest = 512;

Transform toTransform(const Matrix &matrix, const std::string &what)
{
    Transform transform{};
    for (size_t row = 0; row < 3; ++row) {
        for (size_t column = 0; column < 4; ++column) {
            transform[row][column] = static_cast<float>(matrix[4 * column + row]);
            if (!std::isfinite(transform[row][column]))
                throw GltfError(what + " stands at a place that is not finite");
        }
    }
    return transform;
}

// Reads one file. Each step throws GltfError; readScene puts the file's name in front.
class Reader
{
public:
    Reader(const Document &document, SceneUse use)
        : document_(document), model_(document.model()), use_(use), imageDecoder_(document)
    {
    }

    Scene read();

private:
    // Identifies a mesh as it is shown: its skin belongs to one node, and so may its weights.
    using MeshKey = std::tuple<int, int, std::vector<double>>; // mesh, node with a skin or -1, weights

    [[nodiscard]] std::vector<int> roots() const;
    void findNodes(int index, const Matrix &parent, int depth);
    void addNode(int index);
    void addInstance(uint32_t mesh, const Matrix &matrix, const std::string &what);
    [[nodiscard]] std::vector<Matrix> gpuInstances(const gltf_json::Node &node, const std::string &what) const;
    // Nothing for a mesh without triangles.
    std::optional<uint32_t> useMesh(const MeshKey &key);
    const std::vector<Matrix> &jointsOf(int skin);
    void addPrimitive(PrimitivePlace place, const MeshKey &key, const std::vector<Matrix> &joints);
    uint32_t useMaterial(int index);
    int useImage(const Material &material);

    const Document &document_;
    const gltf_json::Model &model_;
    SceneUse use_;
    Scene scene_;
    std::vector<Matrix> world_; // by node
    std::vector<bool> seen_;    // by node
    std::vector<int> nodes_;    // with a mesh, in the order in which they are met
    std::map<MeshKey, std::optional<uint32_t>> meshes_;
    std::vector<double> reach_;                 // by mesh of the scene: the largest coordinate
    std::map<int, std::vector<Matrix>> joints_; // by skin
    std::map<int, uint32_t> materials_;
    ImageDecoder imageDecoder_;
    std::map<int, int> images_;
    size_t vertices_ = 0;
    size_t corners_ = 0;
};

int Reader::useImage(const Material &material)
{
    if (const auto known = images_.find(material.image); known != images_.end())
        return known->second;
    int &place = images_[material.image] = -1;
    try {
        scene_.images.push_back(material.image < 0 ? Image{1, 1, {255, 255, 255, 255}}
                                                   : imageDecoder_.decode(material.image));
    } catch (const GltfUnsupported &) {
        // The image only affects the colour.
        if (material.masked())
            throw;
        images_.erase(material.image);
        return -1;
    }
    return place = static_cast<int>(scene_.images.size() - 1);
}

uint32_t Reader::useMaterial(int index)
{
    if (const auto known = materials_.find(index); known != materials_.end())
        return known->second;
    Material material = readMaterial(document_, index);
    if (use_ == SceneUse::Drawing && (material.image >= 0 || material.masked()))
        material.image = useImage(material);
    const auto place = static_cast<uint32_t>(scene_.materials.size());
    scene_.materials.push_back(std::move(material));
    return materials_[index] = place;
}

void Reader::addPrimitive(PrimitivePlace place, const MeshKey &key, const std::vector<Matrix> &joints)
{
    const std::string what = document_.nameOf(place);
    Primitive primitive = readPrimitive(document_, place, Positions::Read);
    if (primitive.indices.empty())
        return;
    const uint32_t use = useMaterial(primitive.material);
    const Material &material = scene_.materials[use];
    if (use_ == SceneUse::Drawing && primitive.uvs.empty() && material.masked() &&
        readMaterial(document_, primitive.material).image >= 0)
        throw GltfError(what + " has the masked material \"" + material.name + "\" but no texture coordinates (" +
                        "TEXCOORD_" + std::to_string(material.uvSet) + ")");
    vertices_ += primitive.positions.size();
    corners_ += primitive.indices.size();
    if (vertices_ > kMostVertices || corners_ > 3 * kMostVertices)
        throw GltfError("the scene is too large");
    morph(document_, place, std::get<2>(key), primitive.positions);
    if (!joints.empty())
        moveBySkin(document_, place, joints, primitive.positions);
    for (size_t i = 0; i < primitive.positions.size(); ++i)
        for (const float coordinate : primitive.positions[i])
            if (!std::isfinite(coordinate))
                throw GltfError(what + ": the position of vertex " + std::to_string(i) + " is not finite");
    Geometry &geometry = scene_.geometries.emplace_back();
    geometry.material = use;
    geometry.positions = std::move(primitive.positions);
    geometry.uvs = std::move(primitive.uvs);
    geometry.uvTerms = primitive.uvTerms;
    geometry.uvs.resize(geometry.positions.size());
    geometry.indices = std::move(primitive.indices);
    geometry.alphas = std::move(primitive.alphas);
    geometry.place = place;
}

const std::vector<Matrix> &Reader::jointsOf(int skin)
{
    const auto known = joints_.find(skin);
    return known != joints_.end() ? known->second
                                  : joints_.emplace(skin, jointMatrices(document_, skin, world_)).first->second;
}

std::optional<uint32_t> Reader::useMesh(const MeshKey &key)
{
    const auto known = meshes_.find(key);
    if (known != meshes_.end())
        return known->second;
    const auto &[index, node, weights] = key;
    if (index < 0 || static_cast<size_t>(index) >= model_.meshes.size())
        throw GltfError("mesh " + std::to_string(index) + " does not exist");
    const std::vector<Matrix> none;
    const std::vector<Matrix> &joints = node >= 0 ? jointsOf(model_.nodes[static_cast<size_t>(node)].skin) : none;
    Mesh mesh{static_cast<uint32_t>(scene_.geometries.size()), 0};
    const size_t primitives = model_.meshes[static_cast<size_t>(index)].primitives.size();
    for (uint32_t i = 0; i < primitives; ++i)
        if (const PrimitivePlace place{static_cast<uint32_t>(index), i}; isMadeOfTriangles(document_, place))
            addPrimitive(place, key, joints);
    mesh.geometryCount = static_cast<uint32_t>(scene_.geometries.size()) - mesh.firstGeometry;
    if (mesh.geometryCount == 0)
        return meshes_[key] = std::nullopt;
    double reach = 0;
    for (uint32_t i = 0; i < mesh.geometryCount; ++i)
        for (const Vec3 &position : scene_.geometries[mesh.firstGeometry + i].positions)
            for (const float coordinate : position)
                reach = std::max(reach, std::abs(static_cast<double>(coordinate)));
    reach_.push_back(reach);
    scene_.meshes.push_back(mesh);
    return meshes_[key] = static_cast<uint32_t>(scene_.meshes.size() - 1);
}

void Reader::addInstance(uint32_t mesh, const Matrix &matrix, const std::string &what)
{
    if (scene_.instances.size() == kMostInstances)
        throw GltfError("the scene has more than " + std::to_string(kMostInstances) + " instances of meshes");
    const Transform transform = toTransform(matrix, what);
    for (const auto &row : transform) {
        double sum = std::abs(static_cast<double>(row[3]));
        for (size_t i = 0; i < 3; ++i)
            sum += std::abs(static_cast<double>(row[i])) * reach_[mesh];
        if (!(sum < static_cast<double>(std::numeric_limits<float>::max())))
            throw GltfError(what + " puts its mesh where positions are not finite");
    }
    scene_.instances.push_back({mesh, transform});
}

// EXT_mesh_gpu_instancing: one instance for each element of its accessors, which all have the same number of them.
std::vector<Matrix> Reader::gpuInstances(const gltf_json::Node &node, const std::string &what) const
{
    const JsonValue attributes = node.extensions["EXT_mesh_gpu_instancing"]["attributes"];
    std::optional<size_t> count;
    const auto read = [&](const char *name, uint32_t components) {
        const std::string where = what + " EXT_mesh_gpu_instancing " + name;
        const auto accessor = gltf_json::indexIn(attributes, name, what + " EXT_mesh_gpu_instancing");
        if (!accessor)
            return std::vector<float>();
        const size_t elements = accessorCount(model_, *accessor, where);
        if (count && elements != *count)
            throw GltfError(where + " has " + std::to_string(elements) + " elements, another attribute has " +
                            std::to_string(*count));
        if (elements > kMostInstances)
            throw GltfError(where + " has " + std::to_string(elements) + " elements, more than " +
                            std::to_string(kMostInstances));
        count = elements;
        return readFloats(document_.bufferViews(), *accessor, components, where);
    };
    const std::vector<float> translations = read("TRANSLATION", 3);
    const std::vector<float> rotations = read("ROTATION", 4);
    const std::vector<float> scales = read("SCALE", 3);
    if (!count)
        return {kIdentity};
    std::vector<Matrix> matrices;
    for (size_t i = 0; i < *count; ++i) {
        std::array<double, 3> translation = {0, 0, 0};
        std::array<double, 4> rotation = {0, 0, 0, 1};
        std::array<double, 3> scale = {1, 1, 1};
        const auto take = [i](const std::vector<float> &from, auto &to) {
            if (!from.empty())
                std::copy_n(from.begin() + static_cast<ptrdiff_t>(i * to.size()), to.size(), to.begin());
        };
        take(translations, translation);
        take(rotations, rotation);
        take(scales, scale);
        matrices.push_back(compose(translation, rotation, scale));
    }
    return matrices;
}

void Reader::addNode(int index)
{
    const gltf_json::Node &node = model_.nodes[static_cast<size_t>(index)];
    const std::string what = "node " + std::to_string(index);
    const bool exists = static_cast<size_t>(node.mesh) < model_.meshes.size();
    const bool skinned = node.skin >= 0;
    const auto mesh =
        useMesh({node.mesh, skinned ? index : -1,
                 exists ? morphWeights(document_, static_cast<uint32_t>(node.mesh), node.weights) : node.weights});
    if (!mesh)
        return;
    // glTF 2.0, 3.7.3.3: "Only the joint transforms are applied to the skinned mesh; the transform of the skinned mesh
    // node MUST be ignored."
    const Matrix base = skinned ? kIdentity : world_[static_cast<size_t>(index)];
    for (const Matrix &matrix : gpuInstances(node, what))
        addInstance(*mesh, multiply(base, matrix), what);
}

void Reader::findNodes(int index, const Matrix &parent, int depth)
{
    if (index < 0 || static_cast<size_t>(index) >= model_.nodes.size())
        throw GltfError("node " + std::to_string(index) + " does not exist");
    const auto place = static_cast<size_t>(index);
    // A node with several parents, or a cycle. Without this check, a small file could take endless time.
    if (seen_[place])
        throw GltfError("node " + std::to_string(index) + " is used more than once");
    seen_[place] = true;
    if (depth > kDeepest)
        throw GltfError("the nodes are nested too deeply");
    const gltf_json::Node &node = model_.nodes[place];
    world_[place] = multiply(parent, localMatrix(node));
    if (node.mesh >= 0)
        nodes_.push_back(index);
    for (const int child : node.children)
        findNodes(child, world_[place], depth + 1);
}

std::vector<int> Reader::roots() const
{
    if (!model_.scenes.empty()) {
        const int wanted = std::max(model_.scene, 0);
        if (static_cast<size_t>(wanted) >= model_.scenes.size())
            throw GltfError("scene " + std::to_string(wanted) + " does not exist");
        return model_.scenes[static_cast<size_t>(wanted)];
    }
    std::vector<bool> isChild(model_.nodes.size());
    for (const gltf_json::Node &node : model_.nodes)
        for (const int child : node.children)
            if (static_cast<size_t>(child) < isChild.size())
                isChild[static_cast<size_t>(child)] = true;
    std::vector<int> found;
    for (size_t i = 0; i < isChild.size(); ++i)
        if (!isChild[i])
            found.push_back(static_cast<int>(i));
    return found;
}

Scene Reader::read()
{
    world_.resize(model_.nodes.size(), kIdentity);
    seen_.resize(model_.nodes.size());
    for (const int root : roots())
        findNodes(root, kIdentity, 0);
    // After all nodes are found: joints may come later than what they move.
    for (const int node : nodes_)
        addNode(node);
    if (model_.scenes.empty() && model_.nodes.empty())
        for (uint32_t i = 0; i < model_.meshes.size(); ++i)
            if (const auto mesh = useMesh({static_cast<int>(i), -1, morphWeights(document_, i, {})}))
                addInstance(*mesh, kIdentity, "mesh " + std::to_string(i));
    if (scene_.geometries.empty())
        throw GltfError("there are no triangles in it");
    return std::move(scene_);
}

} // namespace

double determinant(const Transform &m)
{
    const auto at = [&](size_t row, size_t column) { return static_cast<double>(m[row][column]); };
    return at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)) -
           at(0, 1) * (at(1, 0) * at(2, 2) - at(1, 2) * at(2, 0)) +
           at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
}

Vec3 transformed(const Transform &m, const Vec3 &point)
{
    Vec3 result{};
    for (size_t row = 0; row < 3; ++row) {
        double sum = static_cast<double>(m[row][3]);
        for (size_t k = 0; k < 3; ++k)
            sum += static_cast<double>(m[row][k]) * static_cast<double>(point[k]);
        result[row] = static_cast<float>(sum);
    }
    return result;
}

void Scene::makeOneMesh()
{
    meshes = {{0, static_cast<uint32_t>(geometries.size())}};
    instances = {{0, kInPlace}};
}

Scene readScene(const Document &document, SceneUse use)
{
    return document.named([&] { return Reader(document, use).read(); });
}

Scene readGltf(const std::filesystem::path &path)
{
    return readScene(Document(path));
}

} // namespace vellum
