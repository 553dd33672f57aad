// From a glTF file to one with micromaps.
#pragma once

#include <filesystem>

#include "gltf/micromaps/document_bake.h"

namespace vellum
{

struct FileBakeOptions : DocumentBakeOptions {
    // Puts the micromaps of a .gltf into the file itself, in a data URI, instead of into a file beside it.
    bool embed = false;
};

struct FileBake {
    DocumentBake bake;
    std::vector<std::string> names;            // of bake.primitives: `mesh 2 "leaves" primitive 0`
    std::vector<std::string> leftNames;        // of bake.left
    bool replaced = false;                     // the input had micromaps
    std::uint64_t inputBytes = 0;              // of the file itself
    std::uint64_t outputBytes = 0;             // and with the file of micromaps beside it
    std::vector<std::filesystem::path> copied; // the files beside the input that were taken along
};

// The file of a .gltf's micromaps: `tree.omm.bin` beside `tree.gltf` and `tree.omm.gltf`.
std::filesystem::path bufferPath(const std::filesystem::path &output);

// Bakes `input` and writes `output`, which must be another file; .glb becomes .glb and .gltf becomes .gltf. What a
// .gltf names beside it is copied where the output is in another folder. Either all files are written or none. Throws
// GltfError, BakeError.
FileBake bakeFile(const std::filesystem::path &input, const std::filesystem::path &output,
                  const FileBakeOptions &options);

} // namespace vellum
