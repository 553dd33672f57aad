// From the bytes of a file to tinygltf's model, with the checks that tinygltf leaves out.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace tinygltf
{
class Model;
}

namespace vellum
{

// Fills `model`. Images are left encoded: those with a URI in Image::image, the others in their buffer view.
// Throws GltfError.
void loadModel(const std::filesystem::path &path, tinygltf::Model &model);

} // namespace vellum
