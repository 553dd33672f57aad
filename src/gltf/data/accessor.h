// SPDX-License-Identifier: Apache-2.0
// Typed, bounds-checked reading of glTF accessors, sparse ones included.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "gltf/data/buffer_views.h"

namespace vellum
{

// In all of these, `what` names the accessor in the GltfError that is thrown if it does not exist, is of another type,
// contradicts itself or reaches outside its buffer.

// `count` elements of `components` floats each: from FLOAT, or from 8/16-bit integers, normalized or not
// (KHR_mesh_quantization).
std::vector<float> readFloats(const BufferViews &views, int accessor, uint32_t components, const std::string &what);

// The fourth components of colours; none where they have three.
std::vector<float> readAlphas(const BufferViews &views, int accessor, const std::string &what);

// Vertex indices, from unsigned 8/16/32-bit data.
std::vector<uint32_t> readIndices(const BufferViews &views, int accessor, const std::string &what);

// The number of elements, after a check that all of them are there.
size_t countElements(const BufferViews &views, int accessor, const std::string &what);

// The number of elements that the accessor states.
size_t accessorCount(const gltf_json::Model &model, int accessor, const std::string &what);

} // namespace vellum
