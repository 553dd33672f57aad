// SPDX-License-Identifier: Apache-2.0
// A mesh compressed by KHR_draco_mesh_compression.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace vellum
{

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
