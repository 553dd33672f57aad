// SPDX-License-Identifier: Apache-2.0
// Uses meshoptimizer.
#include <meshoptimizer.h>

#include "gltf/data/decompress.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

// The stream begins with its kind and, in the lower half of the byte, its version.
bool isNewer(const CompressedView &view, std::span<const uint8_t> encoded)
{
    const int newest = view.mode == "ATTRIBUTES" ? 0xa0 : view.mode == "TRIANGLES" ? 0xe1 : 0xd1;
    return !encoded.empty() && (encoded[0] & 0xf0) == (newest & 0xf0) && encoded[0] > newest;
}

} // namespace

const bool kDecompressesMeshes = true;

std::vector<uint8_t> decompressView(const CompressedView &view, std::span<const uint8_t> encoded)
{
    std::vector<uint8_t> decoded(view.bytes());
    int error = 0;
    if (view.mode == "ATTRIBUTES")
        error = meshopt_decodeVertexBuffer(decoded.data(), view.count, view.byteStride, encoded.data(), encoded.size());
    else if (view.mode == "TRIANGLES")
        error = meshopt_decodeIndexBuffer(decoded.data(), view.count, view.byteStride, encoded.data(), encoded.size());
    else
        error =
            meshopt_decodeIndexSequence(decoded.data(), view.count, view.byteStride, encoded.data(), encoded.size());
    if (error != 0 && isNewer(view, encoded))
        throw GltfUnsupported("is compressed in a newer way than the library here can read");
    if (error != 0)
        throw GltfError("cannot be decompressed");
    if (view.filter == "OCTAHEDRAL")
        meshopt_decodeFilterOct(decoded.data(), view.count, view.byteStride);
    else if (view.filter == "QUATERNION")
        meshopt_decodeFilterQuat(decoded.data(), view.count, view.byteStride);
    else if (view.filter == "EXPONENTIAL")
        meshopt_decodeFilterExp(decoded.data(), view.count, view.byteStride);
    return decoded;
}

} // namespace vellum
