// SPDX-License-Identifier: Apache-2.0
#include "gltf/pose.h"

#include <algorithm>

#include "gltf/data/accessor.h"

namespace vellum
{
Matrix multiply(const Matrix &a, const Matrix &b)
{
    Matrix m{};
    for (size_t column = 0; column < 4; ++column)
        for (size_t row = 0; row < 4; ++row)
            for (size_t k = 0; k < 4; ++k)
                m[column * 4 + row] += a[k * 4 + row] * b[column * 4 + k];
    return m;
}

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

namespace
{

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

} // namespace

std::vector<double> morphWeights(const Document &document, uint32_t mesh, const std::vector<double> &ofNode)
{
    const std::vector<double> &weights = ofNode.empty() ? document.model().meshes.at(mesh).weights : ofNode;
    if (std::all_of(weights.begin(), weights.end(), [](double weight) { return weight == 0; }))
        return {};
    return weights;
}

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

} // namespace vellum
