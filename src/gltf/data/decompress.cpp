// SPDX-License-Identifier: Apache-2.0
#include "gltf/data/decompress.h"

#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

constexpr const char *kSpellings[] = {"EXT_meshopt_compression", "KHR_meshopt_compression"};

JsonValue extensionOf(const gltf_json::BufferView &view)
{
    for (const char *spelling : kSpellings)
        if (const JsonValue extension = view.extensions[spelling]; extension.exists())
            return extension;
    return {};
}

size_t sizeOf(const JsonValue &extension, const char *name, int64_t otherwise)
{
    const int64_t number = extension[name].integer().value_or(otherwise);
    if (number < 0)
        throw GltfError(std::string("has a compression without \"") + name + "\"");
    return static_cast<size_t>(number);
}

// "For the extension object to be valid, the following must hold".
void check(const CompressedView &view, const gltf_json::BufferView &parent)
{
    const bool attributes = view.mode == "ATTRIBUTES";
    const std::string stride = "a stride of " + std::to_string(view.byteStride);
    if (!attributes && view.mode != "TRIANGLES" && view.mode != "INDICES")
        throw GltfUnsupported("has a compression with the unknown mode \"" + view.mode + "\"");
    if (attributes ? view.byteStride == 0 || view.byteStride % 4 != 0 || view.byteStride > 256
                   : view.byteStride != 2 && view.byteStride != 4)
        throw GltfError("has a compression with " + stride);
    if (view.mode == "TRIANGLES" && view.count % 3 != 0)
        throw GltfError("has a compression with " + std::to_string(view.count) + " indices, no multiple of 3");
    if (view.filter == "OCTAHEDRAL" || view.filter == "COLOR" ? view.byteStride != 4 && view.byteStride != 8
                                                              : view.filter == "QUATERNION" && view.byteStride != 8)
        throw GltfError("has a compression with the filter " + view.filter + " for " + stride);
    const bool filtered = view.filter != "NONE";
    if (filtered && view.filter != "OCTAHEDRAL" && view.filter != "QUATERNION" && view.filter != "EXPONENTIAL" &&
        view.filter != "COLOR")
        throw GltfUnsupported("has a compression with the unknown filter \"" + view.filter + "\"");
    if (filtered && !attributes)
        throw GltfError("has a compression with a filter for indices");
    if (view.count > parent.byteLength || view.bytes() != parent.byteLength) // in this order nothing overflows
        throw GltfError("is decompressed to " + std::to_string(view.bytes()) + " bytes and has " +
                        std::to_string(parent.byteLength));
}

} // namespace

bool isCompressed(const gltf_json::BufferView &view)
{
    return extensionOf(view).exists();
}

CompressedView readCompressedView(const gltf_json::BufferView &parent)
{
    const JsonValue extension = extensionOf(parent);
    CompressedView view;
    view.buffer = gltf_json::indexIn(extension, "buffer", "has a compression").value_or(-1);
    if (view.buffer < 0)
        throw GltfError("has a compression without \"buffer\"");
    view.byteOffset = sizeOf(extension, "byteOffset", 0);
    view.byteLength = sizeOf(extension, "byteLength", -1);
    view.byteStride = sizeOf(extension, "byteStride", -1);
    view.count = sizeOf(extension, "count", -1);
    view.mode = extension["mode"].string().value_or("");
    view.filter = extension["filter"].string().value_or("NONE");
    check(view, parent);
    return view;
}

} // namespace vellum
