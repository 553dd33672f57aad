// A glTF file as a renderer or the baker needs it: triangles in world space, one geometry per material.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "bake/bake.h"

namespace vellum
{

using Vec3 = std::array<float, 3>;

struct Image {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<std::uint8_t> rgba; // 4 * width * height bytes, as stored (colour is sRGB)
};

struct Material {
    std::string name;
    // alphaMode MASK, or BLEND, which is treated as a mask with a cutoff of 0.5. Opaque where false.
    bool masked = false;
    float alphaCutoff = 0.5f;
    std::array<float, 4> baseColor{1, 1, 1, 1}; // linear factor of the texture
    int image = -1;                             // into Scene::images; a masked material always has one
    Wrap wrapU = Wrap::Repeat;
    Wrap wrapV = Wrap::Repeat;
    Filter filter = Filter::Bilinear; // magFilter: what mip level 0 is read with
};

struct Geometry {
    std::uint32_t material = 0;         // into Scene::materials
    std::vector<Vec3> positions;        // in world space, finite
    std::vector<TexCoord> uvs;          // one per position; KHR_texture_transform is applied
    std::vector<std::uint32_t> indices; // three per triangle, all below positions.size()
};

struct Scene {
    std::vector<Image> images;
    std::vector<Material> materials;
    std::vector<Geometry> geometries; // none is empty
};

// What is wrong with a file, in one line that names it.
class GltfError : public std::runtime_error
{
public:
    using std::runtime_error::runtime_error;
};

// Reads a .glb or .gltf file, with buffers and PNG or JPEG images embedded or beside it. Takes triangles of the default
// scene; points and lines, animations, skins and morph targets are left out. Throws GltfError for a file that cannot
// be read, contradicts itself, has no triangles, or has masked triangles without texture coordinates or texture.
Scene readGltf(const std::filesystem::path &path);

} // namespace vellum
