// SPDX-License-Identifier: Apache-2.0
// The transforms of nodes.
#pragma once

#include <array>
#include <vector>

#include "gltf/file/model.h"
#include "gltf/primitive.h"

namespace vellum
{

using Matrix = std::array<double, 16>; // column-major, as glTF stores it

constexpr Matrix kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Matrix multiply(const Matrix &a, const Matrix &b);

// translation * rotation * scale; `rotation` is a quaternion x, y, z, w.
Matrix compose(const std::array<double, 3> &translation, const std::array<double, 4> &rotation,
               const std::array<double, 3> &scale);

// A node's own.
Matrix localMatrix(const gltf_json::Node &node);

std::array<double, 3> transformed(const Matrix &matrix, const std::array<double, 3> &point);

// The default weights of a mesh's morph targets: those of the node that shows it, or else its own; empty where all are
// zero.
std::vector<double> morphWeights(const Document &document, uint32_t mesh, const std::vector<double> &ofNode);

// Adds the primitive's morph targets to `positions`, each times its weight. Throws GltfError.
void morph(const Document &document, PrimitivePlace place, const std::vector<double> &weights,
           std::vector<Vec3> &positions);

// A skin's matrices, one for each joint, from the joints' own matrices in the world: `world` has one for each node.
// Throws GltfError.
std::vector<Matrix> jointMatrices(const Document &document, int skin, const std::vector<Matrix> &world);

// Moves `positions` to the world: JOINTS_n and WEIGHTS_n say by which joints. Throws GltfError.
void moveBySkin(const Document &document, PrimitivePlace place, const std::vector<Matrix> &joints,
                std::vector<Vec3> &positions);

} // namespace vellum
