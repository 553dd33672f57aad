// SPDX-License-Identifier: Apache-2.0
// Builds without Draco and meshoptimizer reject compressed geometry.
#include "gltf/data/decompress.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{

const bool kDecompressesMeshes = false;

std::string undecodableByMeshoptimizer()
{
    return {};
}

std::vector<uint8_t> decompressView(const CompressedView &, std::span<const uint8_t>)
{
    throw GltfUnsupported("is compressed by meshoptimizer, which this build cannot read");
}

struct DracoMesh::Decoded {
};

DracoMesh::DracoMesh(std::span<const uint8_t>, const std::string &what)
{
    throw GltfUnsupported(what + " is compressed by Draco, which this build cannot read");
}

// Never called, as no mesh exists.
DracoMesh::~DracoMesh() = default;

size_t DracoMesh::vertexCount() const
{
    return 0;
}

std::vector<uint32_t> DracoMesh::indices() const
{
    return {};
}

std::vector<float> DracoMesh::floats(int64_t, uint32_t, As, const std::string &) const
{
    return {};
}

uint32_t DracoMesh::components(int64_t, const std::string &) const
{
    return 0;
}

} // namespace vellum
