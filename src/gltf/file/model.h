// SPDX-License-Identifier: Apache-2.0
// The JSON of a glTF file as structures: the parts of it that anything here reads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "gltf/file/container.h"
#include "gltf/file/json_tree.h"

namespace vellum::gltf_json
{

// Indices are those of the file, whether there is such an element or not; -1 where the file has none.

constexpr int kByte = 5120;
constexpr int kUnsignedByte = 5121;
constexpr int kShort = 5122;
constexpr int kUnsignedShort = 5123;
constexpr int kInt = 5124; // of EXT_mesh_opacity_micromap alone
constexpr int kUnsignedInt = 5125;
constexpr int kFloat = 5126;

// The size of one component; 0 for another type.
constexpr size_t bytesOf(int componentType)
{
    switch (componentType) {
    case kByte:
    case kUnsignedByte: return 1;
    case kShort:
    case kUnsignedShort: return 2;
    case kInt:
    case kUnsignedInt:
    case kFloat: return 4;
    default: return 0;
    }
}

constexpr int kTriangles = 4; // modes of primitives
constexpr int kTriangleStrip = 5;
constexpr int kTriangleFan = 6;

constexpr int kNearest = 9728; // of samplers
constexpr int kClampToEdge = 33071;
constexpr int kMirroredRepeat = 33648;
constexpr int kRepeat = 10497;

struct Buffer {
    std::vector<uint8_t> own; // where it is not in the file itself
    std::span<const uint8_t> data;
};

struct BufferView {
    int buffer = -1;
    size_t byteOffset = 0;
    size_t byteLength = 0;
    size_t byteStride = 0; // 0: none
    JsonValue extensions;
};

struct Accessor {
    // The elements of a sparse accessor that are replaced, and their replacements.
    struct Sparse {
        size_t count = 0;
        int indices = -1; // buffer view
        size_t indicesOffset = 0;
        int indicesType = 0;
        int values = -1; // buffer view
        size_t valuesOffset = 0;
    };
    int bufferView = -1;
    size_t byteOffset = 0;
    int componentType = 0;
    uint32_t components = 0; // of an element: 1 for SCALAR, 16 for MAT4
    size_t count = 0;
    bool normalized = false;
    std::optional<Sparse> sparse;
};

struct Image {
    std::string uri;           // of a file of its own
    std::vector<uint8_t> data; // of a data URI
    int bufferView = -1;
};

struct Sampler {
    int magFilter = -1;
    int wrapS = kRepeat;
    int wrapT = kRepeat;
};

struct Texture {
    int source = -1;
    int sampler = -1;
    JsonValue extensions;
};

struct Material {
    std::string name;
    std::string alphaMode = "OPAQUE";
    double alphaCutoff = 0.5;
    std::vector<double> baseColorFactor;
    int baseColorTexture = -1;
    int texCoord = 0;            // of the latter
    JsonValue textureExtensions; // and its
    JsonValue extensions;
};

using Attributes = std::map<std::string, int>; // accessors

struct Primitive {
    Attributes attributes;
    int indices = -1;
    int material = -1;
    int mode = kTriangles;
    std::vector<Attributes> targets;
    JsonValue extensions;

    // The accessor of an attribute, or -1.
    [[nodiscard]] int attribute(const std::string &name) const;
};

struct Mesh {
    std::string name;
    std::vector<Primitive> primitives;
    std::vector<double> weights;
};

struct Node {
    std::vector<int> children;
    int mesh = -1;
    int skin = -1;
    std::vector<double> matrix; // these have 16, 3, 4 and 3 elements where they have as many as they should
    std::vector<double> translation;
    std::vector<double> rotation;
    std::vector<double> scale;
    std::vector<double> weights;
    JsonValue extensions;
};

struct Skin {
    int inverseBindMatrices = -1;
    std::vector<int> joints;
};

struct Model {
    std::vector<Buffer> buffers;
    std::vector<BufferView> bufferViews;
    std::vector<Accessor> accessors;
    std::vector<Image> images;
    std::vector<Sampler> samplers;
    std::vector<Texture> textures;
    std::vector<Material> materials;
    std::vector<Mesh> meshes;
    std::vector<Node> nodes;
    std::vector<Skin> skins;
    std::vector<std::vector<int>> scenes; // nodes
    int scene = -1;
    std::vector<std::string> extensionsUsed;
    std::set<std::string, std::less<>> extensionsRequired;

    [[nodiscard]] bool isRequired(const char *extension) const;
};

// Reads the model of a file, and the data of its buffers and data URIs. Files that it names are looked for in the
// folder of `path`; those of images are not read. The container and the tree, which is of its JSON, must outlive the
// model. Throws GltfError.
Model readModel(const Container &container, const JsonTree &tree, const std::filesystem::path &path);

// An integer that can be an index, for values that readModel() leaves as JSON; nothing if the member is missing. Throws
// GltfError, which begins with `place`, for anything else.
std::optional<int> indexIn(const JsonValue &object, std::string_view name, const std::string &place);
// The same for a number, and for an array of numbers, which is empty if the member is missing.
std::optional<double> numberIn(const JsonValue &object, std::string_view name, const std::string &place);
std::vector<double> numbersIn(const JsonValue &object, std::string_view name, const std::string &place);

} // namespace vellum::gltf_json
