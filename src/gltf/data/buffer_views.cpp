#include "gltf/data/buffer_views.h"

#include "gltf/file/gltf_error.h"
#include "gltf/file/tinygltf.h"

namespace vellum
{

std::span<const std::uint8_t> BufferViews::bytes(int view, const std::string &what) const
{
    if (view < 0 || static_cast<std::size_t>(view) >= m_model.bufferViews.size())
        throw GltfError(what + ": buffer view " + std::to_string(view) + " does not exist");
    const tinygltf::BufferView &range = m_model.bufferViews[static_cast<std::size_t>(view)];
    if (range.buffer < 0 || static_cast<std::size_t>(range.buffer) >= m_model.buffers.size())
        throw GltfError(what + ": buffer " + std::to_string(range.buffer) + " does not exist");
    const std::vector<unsigned char> &data = m_model.buffers[static_cast<std::size_t>(range.buffer)].data;
    if (range.byteOffset > data.size() || range.byteLength > data.size() - range.byteOffset)
        throw GltfError(what + ": buffer view " + std::to_string(view) + " reaches outside of its buffer");
    return {data.data() + range.byteOffset, range.byteLength};
}

} // namespace vellum
