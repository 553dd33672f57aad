// SPDX-License-Identifier: Apache-2.0
#include "gltf/matrix.h"

#include <algorithm>

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

} // namespace vellum
