#include "gltf/data/buffer_views.h"

#include <algorithm>

#include "gltf/data/decompress.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

// A few bytes could ask for gigabytes: what a file is decompressed to is bounded by its own size. Meshopt's streams of
// version 0 take at least a 64th of their data.
constexpr std::uint64_t kMostExpansion = 64;
constexpr std::uint64_t kAlwaysAllowed = std::uint64_t{64} << 20;

} // namespace

std::span<const std::uint8_t> BufferViews::stored(int buffer, std::size_t offset, std::size_t length,
                                                  const std::string &name) const
{
    if (buffer < 0 || static_cast<std::size_t>(buffer) >= m_model.buffers.size())
        throw GltfError(name + ": buffer " + std::to_string(buffer) + " does not exist");
    const std::span<const std::uint8_t> data = m_model.buffers[static_cast<std::size_t>(buffer)].data;
    if (offset > data.size() || length > data.size() - offset)
        throw GltfError(name + " reaches outside of its buffer");
    return data.subspan(offset, length);
}

void BufferViews::account(std::size_t bytes) const
{
    if (!m_allowance) {
        m_allowance = kAlwaysAllowed;
        for (const gltf_json::Buffer &buffer : m_model.buffers)
            *m_allowance += kMostExpansion * buffer.data.size();
    }
    if (bytes > *m_allowance)
        throw GltfError("is decompressed to many times the bytes of the file");
    *m_allowance -= bytes;
}

std::span<const std::uint8_t> BufferViews::decompressed(int index, const std::string &name) const
{
    const std::lock_guard lock(m_mutex);
    if (const auto known = m_decompressed.find(index); known != m_decompressed.end())
        return known->second;
    const gltf_json::BufferView &parent = m_model.bufferViews[static_cast<std::size_t>(index)];
    try {
        const CompressedView view = readCompressedView(parent);
        const auto encoded = stored(view.buffer, view.byteOffset, view.byteLength, "has a compression that");
        account(view.bytes());
        return m_decompressed.emplace(index, decompressView(view, encoded)).first->second;
    } catch (const GltfUnsupported &error) {
        // There may be uncompressed data for such a case.
        if (parent.buffer >= 0 && static_cast<std::size_t>(parent.buffer) < m_model.buffers.size() &&
            !m_model.buffers[static_cast<std::size_t>(parent.buffer)].data.empty())
            return stored(parent.buffer, parent.byteOffset, parent.byteLength, name);
        throw GltfUnsupported(name + " " + error.what());
    } catch (const GltfError &error) {
        throw GltfError(name + " " + error.what());
    }
}

bool BufferViews::differsFromFallback(int view, const std::string &what) const
{
    if (view < 0 || static_cast<std::size_t>(view) >= m_model.bufferViews.size())
        return false;
    const gltf_json::BufferView &parent = m_model.bufferViews[static_cast<std::size_t>(view)];
    if (!isCompressed(parent) || parent.buffer < 0 ||
        static_cast<std::size_t>(parent.buffer) >= m_model.buffers.size() ||
        m_model.buffers[static_cast<std::size_t>(parent.buffer)].data.empty())
        return false;
    for (const char *name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
        if (parent.extensions[name].exists() && m_model.isRequired(name))
            return false;
    const auto fallback = stored(parent.buffer, parent.byteOffset, parent.byteLength, what);
    const auto here = bytes(view, what);
    return !std::equal(here.begin(), here.end(), fallback.begin(), fallback.end());
}

std::span<const std::uint8_t> BufferViews::bytes(int view, const std::string &what) const
{
    const std::string name = what + ": buffer view " + std::to_string(view);
    if (view < 0 || static_cast<std::size_t>(view) >= m_model.bufferViews.size())
        throw GltfError(name + " does not exist");
    const gltf_json::BufferView &range = m_model.bufferViews[static_cast<std::size_t>(view)];
    if (isCompressed(range))
        return decompressed(view, name);
    return stored(range.buffer, range.byteOffset, range.byteLength, name);
}

} // namespace vellum
