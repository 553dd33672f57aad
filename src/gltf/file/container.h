// From a file to its bytes and to tinygltf's model, with the checks that tinygltf leaves out.
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

// A glTF file as it lies on the disk.
struct Container {
    std::vector<std::uint8_t> bytes;
    bool binary = false; // a GLB
    // The JSON text.
    std::size_t jsonOffset = 0;
    std::size_t jsonSize = 0;
};

// Reads a file and finds the JSON text in it. Throws GltfError, for chunks that contradict themselves and JSON that is
// nested too deeply for tinygltf, too.
Container readContainer(const std::filesystem::path &path);

// Fills `model`. Files that it names are looked for in `folder`. Images are left encoded: those with a URI in
// Image::image, the others in their buffer view. Throws GltfError.
void parseModel(const Container &container, const std::filesystem::path &folder, tinygltf::Model &model);

} // namespace vellum
