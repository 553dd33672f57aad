// A glTF file that was read: tinygltf's model of it, and the bytes as they were.
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gltf/data/buffer_views.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{

// A primitive in the meshes of a file: meshes[mesh].primitives[primitive].
struct PrimitivePlace {
    std::uint32_t mesh = 0;
    std::uint32_t primitive = 0;
    auto operator<=>(const PrimitivePlace &) const = default;
};

class Document
{
public:
    // Reads a .glb or .gltf file and the buffers and images beside it. Throws GltfError for a file that cannot be read
    // or is not glTF 2. What the file says of accessors, nodes and so on is checked where it is read.
    explicit Document(const std::filesystem::path &path);
    ~Document();
    Document(Document &&) noexcept;
    Document &operator=(Document &&) noexcept;

    [[nodiscard]] const std::filesystem::path &path() const { return m_path; }
    // Images are left where they are and encoded: in the file that Image::uri names, else in Image::image where they
    // were in a data URI, else in their buffer view. Extras, animations, cameras and most extensions are left out.
    [[nodiscard]] const tinygltf::Model &model() const { return *m_model; }
    // What is in the model's buffer views.
    [[nodiscard]] const BufferViews &bufferViews() const { return *m_bufferViews; }

    // Whether it is a GLB.
    [[nodiscard]] bool binary() const { return m_binary; }
    [[nodiscard]] std::span<const std::uint8_t> bytes() const { return m_bytes; }
    // The JSON text, of a GLB that of its first chunk, padding included.
    [[nodiscard]] std::string_view json() const;
    // What follows the JSON chunk in a GLB, from the header of the second chunk on; empty where nothing does.
    [[nodiscard]] std::span<const std::uint8_t> otherChunks() const;

    // `mesh 2 "leaves" primitive 0`; without the name where there is none.
    [[nodiscard]] std::string nameOf(PrimitivePlace place) const;

    // What an error says, without the path of the file.
    [[nodiscard]] std::string reasonOf(const GltfError &error) const;
    // The same without the name of the primitive that it is about: "it has no positions".
    [[nodiscard]] std::string reasonOf(PrimitivePlace place, const GltfError &error) const;

    // Returns what `read` returns, and puts the file's name in front of what it throws.
    template <typename Read>
    auto named(Read &&read) const
    {
        try {
            return read();
        } catch (const GltfUnsupported &error) {
            throw GltfUnsupported(withPath(error.what()));
        } catch (const GltfError &error) {
            throw GltfError(withPath(error.what()));
        } catch (const std::bad_alloc &) {
            throw GltfError(withPath("there is not enough memory to read it"));
        }
    }

private:
    [[nodiscard]] std::string withPath(std::string message) const;

    std::filesystem::path m_path;
    std::vector<std::uint8_t> m_bytes;
    std::size_t m_jsonOffset = 0;
    std::size_t m_jsonSize = 0;
    bool m_binary = false;
    std::unique_ptr<tinygltf::Model> m_model;
    std::unique_ptr<BufferViews> m_bufferViews;
};

} // namespace vellum
