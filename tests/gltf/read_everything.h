// SPDX-License-Identifier: Apache-2.0
// Reads what there is in a glTF file, for tests that only want to know whether that goes well.
#pragma once

#include <filesystem>
#include <string>

namespace vellum::test
{

struct Reading {
    size_t primitives = 0;   // read
    size_t images = 0;       // read
    std::string error;       // the first, in one line; empty where all was read
    std::string unsupported; // the first GltfUnsupported of a primitive, material or image
};

// Reads the document, then every primitive, material and image, whether a scene uses them or not, the micromaps, and
// the scene. Continues after an error in one of these. Throws only what is not a GltfError.
Reading readEverything(const std::filesystem::path &path);

} // namespace vellum::test
