// SPDX-License-Identifier: Apache-2.0
// A glTF file as a renderer needs it: meshes, and where they stand.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "gltf/primitive.h"

namespace vellum
{

// From a mesh's space to the world's: the upper three rows of a matrix, as in VkTransformMatrixKHR.
using Transform = std::array<std::array<float, 4>, 3>;
constexpr Transform kInPlace = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};

// Below zero where it mirrors; zero where it flattens.
double determinant(const Transform &transform);
Vec3 transformed(const Transform &transform, const Vec3 &point);

struct Geometry {
    uint32_t material = 0;         // into Scene::materials
    std::vector<Vec3> positions;   // in the mesh's space, finite; morph targets and skins are applied
    std::vector<TexCoord> uvs;     // one per position; KHR_texture_transform is applied
    std::vector<uint32_t> indices; // three per triangle, all below positions.size()
    float uvTerms = 0;             // Primitive::uvTerms
    std::vector<float> alphas{};   // COLOR_0's, one per position; none where they are 1 all over
    // The primitive that it is, triangle for triangle; nothing where it is from no file.
    std::optional<PrimitivePlace> place{};
};

// Geometries that stand together.
struct Mesh {
    uint32_t firstGeometry = 0;
    uint32_t geometryCount = 0;
};

struct MeshInstance {
    uint32_t mesh = 0;
    Transform transform = kInPlace; // finite
};

struct Scene {
    std::vector<Image> images;
    std::vector<Material> materials;  // their `image` counts in `images`; a masked material always has one
    std::vector<Geometry> geometries; // none is empty; those of a mesh are consecutive
    std::vector<Mesh> meshes;         // none is empty, each has an instance
    std::vector<MeshInstance> instances;

    // Makes one mesh of all geometries, which stands in place.
    void makeOneMesh();
};

// Reads the default scene (the first if none is named; without scenes, all nodes, and without nodes, all meshes). A
// mesh that several nodes show, or EXT_mesh_gpu_instancing shows several times, is one mesh with several instances.
// Morph targets have their default weights. Skinned meshes are in the rest pose of their joints: each is a mesh of its
// own. Points, lines, cameras and animations are skipped, and so is the image of a material that is not masked if its
// kind is not supported. Throws GltfError for a file that cannot be read, contradicts itself, has no triangles, has
// masked triangles without texture coordinates for their texture, or has more than 2^20 instances or 2^26 vertices. For
// measuring, no images are read, and masked triangles may lack texture coordinates.
enum class SceneUse : uint8_t { Drawing, Measuring };
Scene readScene(const Document &document, SceneUse use = SceneUse::Drawing);
Scene readGltf(const std::filesystem::path &path);

} // namespace vellum
