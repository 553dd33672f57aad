// SPDX-License-Identifier: Apache-2.0
#include "gltf/document.h"

#include "base/text.h"
#include "core/utf8_path.h"
#include "gltf/file/uri.h"

namespace vellum
{

template <typename ReadBytes>
void Document::read(ReadBytes &&readBytes)
{
    named([&] {
        container_ = std::make_unique<Container>(findContainer(readBytes()));
        tree_ = std::make_unique<JsonTree>(container_->json());
        model_ = std::make_unique<gltf_json::Model>(gltf_json::readModel(*container_, *tree_, path_));
        bufferViews_ = std::make_unique<BufferViews>(*model_);
    });
}

Document::Document(const std::filesystem::path &path) : path_(path)
{
    read([&] { return readWholeFile(path); });
}

Document::Document(const std::filesystem::path &path, std::vector<uint8_t> bytes) : path_(path)
{
    read([&] {
        checkSize(bytes.size());
        return std::move(bytes);
    });
}

std::span<const uint8_t> Document::otherChunks() const
{
    return bytes().subspan(container_->jsonOffset + container_->jsonSize);
}

std::string Document::nameOf(PrimitivePlace place) const
{
    std::string name = "mesh " + std::to_string(place.mesh);
    if (place.mesh < model_->meshes.size() && !model_->meshes[place.mesh].name.empty())
        name += " \"" + shownName(model_->meshes[place.mesh].name) + "\"";
    return name + " primitive " + std::to_string(place.primitive);
}

std::string Document::reasonOf(const GltfError &error) const
{
    const std::string text = error.what();
    const std::string prefix = utf8Text(path_) + ": ";
    return text.starts_with(prefix) ? text.substr(prefix.size()) : text;
}

std::string Document::reasonOf(PrimitivePlace place, const GltfError &error) const
{
    std::string text = reasonOf(error);
    const std::string name = nameOf(place);
    if (!text.starts_with(name))
        return text;
    text.erase(0, name.size());
    if (text.starts_with(": "))
        return text.substr(2);
    return text.starts_with(" is ") || text.starts_with(" has ") ? "it" + text
                                                                 : text.substr(text.find_first_not_of(' '));
}

// The path once: functions that read call each other. In one line of a length that a person reads, whatever the names
// are that the file has.
std::string Document::withPath(std::string message) const
{
    constexpr size_t kMostBytes = 400;
    const std::string prefix = utf8Text(path_) + ": ";
    if (message.starts_with(prefix))
        return message;
    if (message.size() > kMostBytes)
        message = message.substr(0, kMostBytes / 2) + " ... " + message.substr(message.size() - kMostBytes / 2);
    return prefix + printable(std::move(message));
}

} // namespace vellum
