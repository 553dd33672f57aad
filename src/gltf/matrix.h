// SPDX-License-Identifier: Apache-2.0
// The transforms of nodes.
#pragma once

#include <array>
#include <vector>

#include "gltf/file/model.h"

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

} // namespace vellum
