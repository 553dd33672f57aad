// SPDX-License-Identifier: Apache-2.0
// Uses meshoptimizer.
#include <meshoptimizer.h>

#include "gltf/data/decompress.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

constexpr bool kDecodesVersion1 = MESHOPTIMIZER_VERSION >= 230; // of the codec of attributes

std::string libraryVersion()
{
    constexpr int kVersion = MESHOPTIMIZER_VERSION;
    return std::to_string(kVersion / 1000) + '.' + std::to_string(kVersion % 1000 / 10);
}

[[noreturn]] void failByVersion(const std::string &what, const char *needed)
{
    throw GltfUnsupported(what + ", which the meshoptimizer of this build (" + libraryVersion() +
                          ") cannot decode: use gltfpack -c in place of -cz, or build with " + needed);
}

// Throws if a newer library may decode it. The stream begins with its kind and, in the lower half of the byte, its
// version.
void checkVersion(const CompressedView &view, std::span<const uint8_t> encoded)
{
    constexpr int kNewestAttributes = kDecodesVersion1 ? 0xa1 : 0xa0;
    const int newest = view.mode == "ATTRIBUTES" ? kNewestAttributes : view.mode == "TRIANGLES" ? 0xe1 : 0xd1;
    if (encoded.empty() || (encoded[0] & 0xf0) != (newest & 0xf0) || encoded[0] <= newest)
        return;
    failByVersion("is compressed by version " + std::to_string(encoded[0] & 15) + " of the codec",
                  encoded[0] == 0xa1 ? "meshoptimizer 0.23 or newer" : "a newer one");
}

#if MESHOPTIMIZER_VERSION >= 1000
constexpr bool kDecodesColors = true;
void decodeColors(std::vector<uint8_t> &colors, const CompressedView &view)
{
    meshopt_decodeFilterColor(colors.data(), view.count, view.byteStride);
}
#else
constexpr bool kDecodesColors = false;
void decodeColors(std::vector<uint8_t> &, const CompressedView &)
{
    failByVersion("has a compression with the filter COLOR", "meshoptimizer 1.0 or newer");
}
#endif

} // namespace

const bool kDecompressesMeshes = true;

std::string undecodableByMeshoptimizer()
{
    const char *what = !kDecodesVersion1 ? "version 1 of the codec and the filter COLOR"
                       : !kDecodesColors ? "the filter COLOR"
                                         : "";
    return *what == 0 ? "" : std::string(what) + " (meshoptimizer " + libraryVersion() + ")";
}

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
    if (error != 0) {
        checkVersion(view, encoded);
        throw GltfError("cannot be decompressed");
    }
    if (view.filter == "OCTAHEDRAL")
        meshopt_decodeFilterOct(decoded.data(), view.count, view.byteStride);
    else if (view.filter == "QUATERNION")
        meshopt_decodeFilterQuat(decoded.data(), view.count, view.byteStride);
    else if (view.filter == "EXPONENTIAL")
        meshopt_decodeFilterExp(decoded.data(), view.count, view.byteStride);
    else if (view.filter == "COLOR")
        decodeColors(decoded, view);
    return decoded;
}

} // namespace vellum
