// A glTF file as a renderer or the baker needs it: triangles in world space, one geometry per material.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "gltf/primitive.h"

namespace vellum
{

struct Geometry {
    std::uint32_t material = 0;         // into Scene::materials
    std::vector<Vec3> positions;        // in world space, finite
    std::vector<TexCoord> uvs;          // one per position; KHR_texture_transform is applied
    std::vector<std::uint32_t> indices; // three per triangle, all below positions.size()
};

struct Scene {
    std::vector<Image> images;
    std::vector<Material> materials;  // their `image` counts in `images`; a masked material always has one
    std::vector<Geometry> geometries; // none is empty
};

// Reads a .glb or .gltf file, with buffers and PNG or JPEG images embedded or beside it. Takes triangles of the default
// scene; points and lines, animations, skins and morph targets are left out. Throws GltfError for a file that cannot
// be read, contradicts itself, has no triangles, or has masked triangles without texture coordinates or texture.
Scene readGltf(const std::filesystem::path &path);

} // namespace vellum
