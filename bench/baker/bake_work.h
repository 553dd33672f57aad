// SPDX-License-Identifier: Apache-2.0
// The input that the baker is measured with: triangles over a texture of painted leaves, and the leaf cards of models.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "bake/bake.h"

namespace vellum::bench
{

struct BakeMesh {
    uint32_t width = 0;
    uint32_t height = 0;
    std::vector<uint8_t> alpha; // as read from a file
    Wrap wrapU = Wrap::Repeat;
    Wrap wrapV = Wrap::Repeat;
    double cutoff = 0.5;
    std::vector<TriangleUvs> triangles;

    [[nodiscard]] AlphaTexture texture() const;
};

struct BakeWork {
    std::string name;
    std::vector<BakeMesh> meshes;
};

// Triangles with edges of 60 to 100 texels at random places, turned at random, over a texture of toothed leaves with
// soft borders that repeats and is covered by 40 %.
BakeWork leaves(uint32_t size, size_t triangles);
// The masked materials of a glTF file. Throws GltfError.
BakeWork leafCards(const std::filesystem::path &file);

} // namespace vellum::bench
