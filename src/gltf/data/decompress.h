// SPDX-License-Identifier: Apache-2.0
// Compressed geometry, by the libraries of those who made the compressions.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "gltf/file/model.h"

namespace vellum
{

// The compression of a buffer view, as its extension declares it.
struct CompressedView {
    int buffer = -1;
    size_t byteOffset = 0;
    size_t byteLength = 0;
    size_t byteStride = 0;
    size_t count = 0;
    std::string mode;
    std::string filter;

    // The bytes that it is decompressed to.
    [[nodiscard]] size_t bytes() const { return byteStride * count; }
};

// Returns whether EXT_meshopt_compression or KHR_meshopt_compression is in a buffer view.
bool isCompressed(const gltf_json::BufferView &view);

// Reads and checks what the extension says. Throws GltfError, and GltfUnsupported for a mode or filter that is unknown.
// Neither of them names the view. bytes() does not overflow.
CompressedView readCompressedView(const gltf_json::BufferView &view);

// Throws GltfError if `encoded` does not decode to `view`, and GltfUnsupported in builds without the library.
std::vector<uint8_t> decompressView(const CompressedView &view, std::span<const uint8_t> encoded);

// True if this build reads geometry compressed by meshoptimizer and by Draco.
extern const bool kDecompressesMeshes;

// What the meshoptimizer of such a build cannot decode, such as "version 1 of its codec"; empty if it decodes
// everything or there is none.
std::string undecodableByMeshoptimizer();

// A mesh compressed by KHR_draco_mesh_compression.
class DracoMesh
{
public:
    // Throws GltfError, which begins with `what`, for anything but a whole mesh of a size that its bytes can be worth,
    // and GltfUnsupported for another version of Draco's format than glTF's, and in builds without Draco.
    DracoMesh(std::span<const uint8_t> encoded, const std::string &what);
    ~DracoMesh();

    [[nodiscard]] size_t vertexCount() const;
    // Three for each triangle, all below vertexCount().
    [[nodiscard]] std::vector<uint32_t> indices() const;

    // How the values of an attribute become floats, by the component type of its accessor.
    enum class As : uint8_t { IntegersOrFloats, Signed8, Unsigned8, Signed16, Unsigned16 };
    // `components` for each vertex, of the attribute that has this unique id. `what` begins the GltfError for one that
    // does not exist or has fewer components.
    [[nodiscard]] std::vector<float> floats(int64_t id, uint32_t components, As as, const std::string &what) const;
    [[nodiscard]] uint32_t components(int64_t id, const std::string &what) const;

private:
    struct Decoded;
    std::unique_ptr<Decoded> decoded_;
};

} // namespace vellum
