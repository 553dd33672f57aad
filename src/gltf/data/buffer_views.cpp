// SPDX-License-Identifier: Apache-2.0
#include "gltf/data/buffer_views.h"

#include <algorithm>

#include "gltf/data/decompress.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

// A few bytes could decompress to gigabytes, so the decompressed size is limited by the size of the file. Meshopt's
// streams of version 0 take at least a 64th of their data.
constexpr uint64_t kMostExpansion = 64;
constexpr uint64_t kBytesAlwaysAllowed = uint64_t{64} << 20;

// Some seconds, and how often each byte of a file may be read.
constexpr uint64_t kAlwaysRead = uint64_t{1} << 29;
constexpr uint64_t kMostReads = 1024;

} // namespace

std::span<const uint8_t> BufferViews::stored(int buffer, size_t offset, size_t length, const std::string &name) const
{
    if (buffer < 0 || static_cast<size_t>(buffer) >= model_.buffers.size())
        throw GltfError(name + ": buffer " + std::to_string(buffer) + " does not exist");
    const std::span<const uint8_t> data = model_.buffers[static_cast<size_t>(buffer)].data;
    if (offset > data.size() || length > data.size() - offset)
        throw GltfError(name + " reaches outside of its buffer");
    return data.subspan(offset, length);
}

void BufferViews::account(size_t bytes) const
{
    if (!allowance_)
        allowance_ = kBytesAlwaysAllowed + kMostExpansion * bufferBytes_;
    if (bytes > *allowance_)
        throw GltfError("is decompressed to many times the bytes of the file");
    *allowance_ -= bytes;
}

void BufferViews::countRead(uint64_t numbers, const std::string &what) const
{
    const uint64_t read = read_ += numbers;
    if (read > kAlwaysRead && read - kAlwaysRead > kMostReads * bufferBytes_)
        throw GltfError(what + ": the accessors of the file are read too often");
}

std::span<const uint8_t> BufferViews::decompressed(int index, const std::string &name) const
{
    const std::lock_guard lock(mutex_);
    if (const auto known = decompressed_.find(index); known != decompressed_.end())
        return known->second;
    const gltf_json::BufferView &parent = model_.bufferViews[static_cast<size_t>(index)];
    try {
        const CompressedView view = readCompressedView(parent);
        const auto encoded = stored(view.buffer, view.byteOffset, view.byteLength, "has a compression that");
        account(view.bytes());
        return decompressed_.emplace(index, decompressView(view, encoded)).first->second;
    } catch (const GltfUnsupported &error) {
        // The file may have uncompressed data as a fallback.
        if (parent.buffer >= 0 && static_cast<size_t>(parent.buffer) < model_.buffers.size() &&
            !model_.buffers[static_cast<size_t>(parent.buffer)].data.empty())
            return stored(parent.buffer, parent.byteOffset, parent.byteLength, name);
        throw GltfUnsupported(name + " " + error.what());
    } catch (const GltfError &error) {
        throw GltfError(name + " " + error.what());
    }
}

bool BufferViews::differsFromFallback(int view, const std::string &what) const
{
    if (view < 0 || static_cast<size_t>(view) >= model_.bufferViews.size())
        return false;
    const gltf_json::BufferView &parent = model_.bufferViews[static_cast<size_t>(view)];
    if (!isCompressed(parent) || parent.buffer < 0 || static_cast<size_t>(parent.buffer) >= model_.buffers.size() ||
        model_.buffers[static_cast<size_t>(parent.buffer)].data.empty())
        return false;
    for (const char *name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
        if (parent.extensions[name].exists() && model_.isRequired(name))
            return false;
    const auto fallback = stored(parent.buffer, parent.byteOffset, parent.byteLength, what);
    const auto here = bytes(view, what);
    return !std::equal(here.begin(), here.end(), fallback.begin(), fallback.end());
}

std::span<const uint8_t> BufferViews::bytes(int view, const std::string &what) const
{
    const std::string name = what + ": buffer view " + std::to_string(view);
    if (view < 0 || static_cast<size_t>(view) >= model_.bufferViews.size())
        throw GltfError(name + " does not exist");
    const gltf_json::BufferView &range = model_.bufferViews[static_cast<size_t>(view)];
    if (isCompressed(range))
        return decompressed(view, name);
    return stored(range.buffer, range.byteOffset, range.byteLength, name);
}

} // namespace vellum
