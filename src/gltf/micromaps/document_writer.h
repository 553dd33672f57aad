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
    // Of a .gltf: what has to lie beside it under the name that was given; empty where nothing has to.
    FileContent buffer;
};

// Whether the extension, in either spelling, is in the root of the document.
bool hasMicromaps(const Document &document);

// The document with these micromaps by EXT_mesh_opacity_micromap, in place of those that it has, whichever their
// spelling; byte for byte the same where there are none before and after.
//
// A GLB gets the data in its binary chunk, or, where its first buffer is not that chunk, in a data URI. A .gltf gets it
// in a file of the name `bufferName`, or in a data URI if that is empty. The document must outlive the result. Throws
// GltfError.
RewrittenFile withMicromaps(const Document &document, const DocumentBake &bake, const std::string &bufferName);

} // namespace vellum
