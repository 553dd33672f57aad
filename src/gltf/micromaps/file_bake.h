// SPDX-License-Identifier: Apache-2.0
// Bakes a glTF file and writes one with micromaps.
#pragma once

#include <filesystem>
#include <functional>
#include <utility>
#include <vector>

#include "gltf/file/output_files.h"
#include "gltf/micromaps/document_bake.h"
#include "gltf/micromaps/known_surface.h"

namespace vellum
{

struct FileBakeOptions : DocumentBakeOptions {
    // Puts the micromaps of a .gltf into the file itself, in a data URI, instead of into a separate file.
    bool embed = false;
    // Measures the surface of the scene, for which its vertices are read once more.
    bool measure = false;
    // Writes nothing where no primitive gets a micromap.
    bool requireMicromaps = false;
    // Writes nothing where the output would equal the input, unless there is an earlier output.
    bool skipUnchanged = false;
    // Replaces files in the output's folder that have the names of copies and other bytes.
    bool replaceCopies = false;
    // Marks outputs without micromaps as well, so that a later bake knows them as outputs (isOwnFile()).
    bool mark = false;
    // Does everything but write.
    bool dryRun = false;
    // Takes the output instead of a file; files that a .gltf names are not copied then.
    std::function<void(const FileContent &)> sink{};
};

struct FileBake {
    DocumentBake bake;
    bool replaced = false;    // the input had micromaps
    std::string replacedLoss; // lossOfMicromaps() of these; empty if they had their data
    std::optional<SurfaceShares> surface;
    uint64_t inputBytes = 0;  // of the file itself
    bool written = false;     // or passed to the sink, or a dry run
    uint64_t outputBytes = 0; // including the separate file of micromaps; 0 if nothing was written
    // What belongs to the output and is there now, with its size: the output, its micromaps and the files that it
    // names.
    std::vector<std::pair<std::filesystem::path, uint64_t>> files;
};

// The files that a document names, as far as they exist.
struct FilesBeside {
    struct Copy {
        std::filesystem::path from;
        std::filesystem::path to;
    };
    std::vector<std::filesystem::path> read;
    std::vector<Copy> copies; // of all of them if the output is in another folder
};

// Throws GltfError, without the path of the input, if the output is one of them or a copy would be outside of the
// output's folder.
FilesBeside filesBeside(const JsonValue &root, const std::filesystem::path &input, const std::filesystem::path &output);

// Bakes a file and writes `output`, which must be another file; .glb becomes .glb and .gltf becomes .gltf, with its
// micromaps in `tree.omm-0123456789abcdef.bin` in the folder of `tree.gltf`, where the digits are a digest of them: no
// other file has that name unless it has the same bytes. Files that a .gltf refers to are copied if the output is in
// another folder. Either all files are written or none. Throws GltfError, BakeError.
FileBake bakeFile(const Document &document, const std::filesystem::path &output, const FileBakeOptions &options);
FileBake bakeFile(const std::filesystem::path &input, const std::filesystem::path &output,
                  const FileBakeOptions &options);

} // namespace vellum
