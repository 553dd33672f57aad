// The bytes of a file's buffer views.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace tinygltf
{
class Model;
}

namespace vellum
{

// Of one model, which must outlive this. Any thread may read.
class BufferViews
{
public:
    explicit BufferViews(const tinygltf::Model &model) : m_model(model) {}

    [[nodiscard]] const tinygltf::Model &model() const { return m_model; }

    // Throws GltfError, which begins with `what`, where the view does not exist or reaches outside of its buffer.
    [[nodiscard]] std::span<const std::uint8_t> bytes(int view, const std::string &what) const;

private:
    const tinygltf::Model &m_model;
};

} // namespace vellum
