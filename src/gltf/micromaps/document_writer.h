// SPDX-License-Identifier: Apache-2.0
// A glTF file with other micromaps, and otherwise as it was.
#pragma once

#include <string>

#include "gltf/document.h"
#include "gltf/file/output_files.h"
#include "gltf/micromaps/document_bake.h"

namespace vellum
{

struct RewrittenFile {
    FileContent file;
    // The additional file of a .gltf, and its name; empty if there is none.
    FileContent buffer;
    std::string bufferName;
    bool changed = true; // otherwise the micromaps are those of the document: none
};

// Returns whether the extension, in either spelling, is in the root of the document.
bool hasMicromaps(const Document &document);

// Returns whether withMicromaps() wrote the file with this JSON: its micromaps are marked, or the file itself.
bool isOwnFile(const JsonValue &root);

// The document with these micromaps by EXT_mesh_opacity_micromap, in place of those that it has, whichever their
// spelling; byte for byte the same if there are none before and after. With `mark`, a file without micromaps is marked
// in `asset.extras`, unless that is something else than an object.
//
// A GLB gets the data in its binary chunk, or, if its first buffer is not that chunk, in a data URI. A .gltf gets it in
// a file whose name is `bufferStem`, a dash, a digest of its bytes in 16 hexadecimal digits and `.bin`, or in a data
// URI if `bufferStem` is empty. The document must outlive the result. Throws GltfError.
RewrittenFile withMicromaps(const Document &document, const DocumentBake &bake, const std::string &bufferStem,
                            bool mark = false);

} // namespace vellum
