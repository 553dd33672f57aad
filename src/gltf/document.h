// SPDX-License-Identifier: Apache-2.0
// A glTF file that was read: its JSON, what that says, and the bytes as they were.
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "gltf/data/accessor.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/model.h"

namespace vellum
{

// A primitive in the meshes of a file: meshes[mesh].primitives[primitive].
struct PrimitivePlace {
    uint32_t mesh = 0;
    uint32_t primitive = 0;
    auto operator<=>(const PrimitivePlace &) const = default;
};

class Document
{
public:
    // Reads a .glb or .gltf file and the buffers and images that it refers to. Throws GltfError for a file that cannot
    // be read or is not glTF 2. Accessors, nodes and so on are checked where they are read.
    explicit Document(const std::filesystem::path &path);
    // Reads the bytes of such a file, which is called `path` and names other files relative to it.
    Document(const std::filesystem::path &path, std::vector<uint8_t> bytes);

    [[nodiscard]] const std::filesystem::path &path() const { return path_; }
    // Images are left encoded: in the file that Image::uri names, else in Image::data, else in their buffer view.
    [[nodiscard]] const gltf_json::Model &model() const { return *model_; }
    // No object in it has two members of one name.
    [[nodiscard]] JsonValue root() const { return tree_->root(); }
    [[nodiscard]] const JsonTree &tree() const { return *tree_; }
    // The contents of the model's buffer views.
    [[nodiscard]] const BufferViews &bufferViews() const { return *bufferViews_; }

    // Returns whether it is a GLB.
    [[nodiscard]] bool binary() const { return container_->binary; }
    [[nodiscard]] std::span<const uint8_t> bytes() const { return container_->bytes; }
    // The size of the file, which may have more bytes than these: after the length that a GLB announces.
    [[nodiscard]] uint64_t fileBytes() const { return container_->fileBytes; }
    // The bytes that follow the JSON chunk in a GLB, from the header of the second chunk on; empty if there are none.
    [[nodiscard]] std::span<const uint8_t> otherChunks() const;

    // `mesh 2 "leaves" primitive 0`; without the name if it has none.
    [[nodiscard]] std::string nameOf(PrimitivePlace place) const;

    // The text of an error, without the path of the file.
    [[nodiscard]] std::string reasonOf(const GltfError &error) const;
    // Also removes the name of the primitive that it is about: "it has no positions".
    [[nodiscard]] std::string reasonOf(PrimitivePlace place, const GltfError &error) const;

    // Returns what `read` returns, and puts the file's name in front of what it throws.
    template <typename Read>
    auto named(Read &&read) const
    {
        try {
            return read();
        } catch (const GltfUnsupported &error) {
            throw GltfUnsupported(withPath(error.what()));
        } catch (const GltfStorageError &error) {
            throw GltfStorageError(withPath(error.what()), error.cause());
        } catch (const GltfError &error) {
            throw GltfError(withPath(error.what()));
        }
    }

private:
    template <typename ReadBytes>
    void read(ReadBytes &&readBytes);
    [[nodiscard]] std::string withPath(std::string message) const;

    std::filesystem::path path_;
    // Each refers to those before it.
    std::unique_ptr<Container> container_;
    std::unique_ptr<JsonTree> tree_;
    std::unique_ptr<gltf_json::Model> model_;
    std::unique_ptr<BufferViews> bufferViews_;
};

} // namespace vellum
