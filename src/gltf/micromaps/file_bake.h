// From a glTF file to one with micromaps.
#pragma once

#include <filesystem>

#include "gltf/micromaps/document_bake.h"
#include "gltf/micromaps/known_surface.h"

namespace vellum
{

struct FileBakeOptions : DocumentBakeOptions {
    // Puts the micromaps of a .gltf into the file itself, in a data URI, instead of into a file beside it.
    bool embed = false;
    // Measures the surface of the scene, for which its vertices are read once more.
    bool measure = false;
};

struct FileBake {
    DocumentBake bake;
    std::vector<std::string> names;     // of bake.primitives: `mesh 2 "leaves" primitive 0`
    std::vector<std::string> leftNames; // of bake.left
    bool replaced = false;              // the input had micromaps
    std::string replacedLoss;           // that had lost their data: as lossOfMicromaps() says
    std::optional<SurfaceShares> surface;
    uint64_t inputBytes = 0;  // of the file itself
    uint64_t outputBytes = 0; // and with the file of micromaps beside it
};

// The files that a document names, as far as they exist.
struct FilesBeside {
    struct Copy {
        std::filesystem::path from;
        std::filesystem::path to;
    };
    std::vector<std::filesystem::path> read;
    std::vector<Copy> copies; // of all of them where the output is in another folder
};

// Throws GltfError, without the path of the input, where the output is one of them or a copy would be outside of the
// output's folder.
FilesBeside filesBeside(const JsonValue &root, const std::filesystem::path &input, const std::filesystem::path &output);

// Bakes `input` and writes `output`, which must be another file; .glb becomes .glb and .gltf becomes .gltf, with its
// micromaps in `tree.omm-0123456789abcdef.bin` beside `tree.gltf`, where the digits are a digest of them: no other
// file has that name unless it has the same bytes. What a .gltf names beside it is copied where the output is in
// another folder. Either all files are written or none. Throws GltfError, BakeError.
FileBake bakeFile(const std::filesystem::path &input, const std::filesystem::path &output,
                  const FileBakeOptions &options);

} // namespace vellum
