// Typed, bounds-checked reading of glTF accessors: tinygltf does not check them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace tinygltf
{
class Model;
}

namespace vellum
{

// `count` elements of `components` floats each, from FLOAT or unsigned 8/16-bit data, normalised or not. `what` names
// the accessor in the GltfError that is thrown for one that does not exist, is of another type or reaches outside of
// its buffer.
std::vector<float> readFloats(const tinygltf::Model &model, int accessor, std::uint32_t components,
                              const std::string &what);

// How many elements it has.
std::size_t accessorCount(const tinygltf::Model &model, int accessor, const std::string &what);

// The fourth components of colours; none where they have three.
std::vector<float> readAlphas(const tinygltf::Model &model, int accessor, const std::string &what);

// Vertex indices, from unsigned 8/16/32-bit data. Throws GltfError as above.
std::vector<std::uint32_t> readIndices(const tinygltf::Model &model, int accessor, const std::string &what);

// The bytes of a buffer view. Throws GltfError where it does not exist or reaches outside of its buffer.
std::span<const std::uint8_t> readBufferView(const tinygltf::Model &model, int view, const std::string &what);

} // namespace vellum
