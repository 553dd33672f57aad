#include "gltf/file/model.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <optional>
#include <set>
#include <span>

#include "gltf/file/glb.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/json_edit.h"
#include "gltf/file/json_tree.h"
#include "gltf/file/outside_file.h"
#include "gltf/file/tinygltf.h"

namespace vellum
{
namespace
{

constexpr const char *kStandIn = R"("data:application/octet-stream;base64,AA==")"; // one byte
constexpr std::uint64_t kMostBufferBytes = std::uint64_t{1} << 31;
constexpr std::int64_t kLargestIndex = std::numeric_limits<std::int32_t>::max();
// What tinygltf's model may take, by a rough count of its structures.
constexpr std::size_t kMostModelBytes = std::size_t{512} << 20;

// What somebody here reads in tinygltf's model. Of others there is no more than that they are there.
const std::set<std::string, std::less<>> kExtensionsRead = {
    "EXT_mesh_gpu_instancing", "EXT_mesh_opacity_micromap",  "EXT_meshopt_compression", "EXT_texture_avif",
    "EXT_texture_webp",        "KHR_draco_mesh_compression", "KHR_materials_variants",  "KHR_mesh_opacity_micromap",
    "KHR_meshopt_compression", "KHR_texture_basisu",         "KHR_texture_transform",   "MSFT_texture_dds"};

// Members that are integers wherever they are.
const std::set<std::string, std::less<>> kIndices = {"bufferView", "buffer",    "source",    "sampler", "index",
                                                     "texCoord",   "mesh",      "material",  "skin",    "camera",
                                                     "scene",      "magFilter", "minFilter", "wrapS",   "wrapT"};
const std::set<std::string, std::less<>> kSizes = {"byteOffset", "byteLength", "byteStride", "count", "componentType"};

// Called for every image, which are all stand-ins.
bool leaveImage(tinygltf::Image *, const int, std::string *, std::string *, int, int, const unsigned char *, int,
                void *)
{
    return true;
}

// The first line of tinygltf's messages, which have several and end in one or two line feeds.
std::string firstLine(const std::string &message)
{
    const std::size_t begin = message.find_first_not_of(" \t\r\n");
    if (begin == std::string::npos)
        return "not a valid glTF file";
    return message.substr(begin, message.find_first_of("\r\n", begin) - begin);
}

std::string numbered(const char *what, std::size_t index)
{
    return std::string(what).append(" ").append(std::to_string(index));
}

struct JsonMember {
    std::string name;
    JsonValue value;
};

std::vector<JsonMember> membersOf(const JsonValue &object)
{
    std::vector<JsonMember> members;
    for (const auto &[name, value] : object.members())
        members.push_back({name.string().value_or(""), value});
    return members;
}

class ModelReader
{
public:
    ModelReader(const Container &container, const std::filesystem::path &folder, tinygltf::Model &model)
        : m_container(container), m_folder(folder), m_model(model), m_tree(container.json()), m_edit(m_tree)
    {
    }

    void read();

private:
    struct BufferSource {
        std::optional<std::string> uri;
        std::uint64_t bytes = 0;
    };
    struct ImageSource {
        std::string name;
        std::string mimeType;
        std::optional<std::string> uri;
        int bufferView = -1;
    };

    [[nodiscard]] std::string place() const;

    void checkAsset(const JsonValue &root) const;
    void checkRoot(const JsonValue &root) const;
    void prepareBuffers(const JsonValue &buffers);
    void prepareImages(const JsonValue &images);
    void prepareMeshes(const JsonValue &meshes);
    void prepare(const JsonValue &value);
    void prepareMember(const JsonMember &member);
    void prepareInteger(const JsonMember &member, std::int64_t most);
    void countObjects(const JsonValue &root) const;
    void parse();
    void readBuffers();
    void readImages();
    [[nodiscard]] std::vector<std::uint8_t> readBuffer(std::size_t index, const BufferSource &source) const;
    [[nodiscard]] std::span<const std::uint8_t> binaryChunk() const;

    const Container &m_container;
    const std::filesystem::path &m_folder;
    tinygltf::Model &m_model;
    JsonTree m_tree;
    JsonEdit m_edit;                  // to the text that tinygltf gets
    std::vector<std::string> m_place; // of the value that is looked at
    std::vector<BufferSource> m_buffers;
    std::vector<ImageSource> m_images;
    std::vector<std::vector<int>> m_indices; // of each primitive of each mesh
};

std::string ModelReader::place() const
{
    std::string text;
    for (const std::string &part : m_place) {
        text += text.empty() || part.starts_with('[') ? "" : ".";
        text += part;
    }
    return text;
}

void ModelReader::checkAsset(const JsonValue &root) const
{
    const std::string version = root["asset"]["version"].string().value_or("");
    if (version.empty())
        throw GltfError("there is no \"asset\" with a \"version\" in it");
    if (!version.starts_with("2."))
        throw GltfError("glTF version " + version + " is not 2");
    if (const auto needed = root["asset"]["minVersion"].string(); needed && *needed != "2.0")
        throw GltfUnsupported("glTF version " + *needed + " is needed to read it");
}

// What tinygltf takes for missing where it is of another kind, and what it never sees.
void ModelReader::checkRoot(const JsonValue &root) const
{
    if (m_tree.text().find_first_not_of(std::string_view(" \t\r\n\0", 5), root.end()) != std::string_view::npos)
        throw GltfError("the JSON is followed by something else");
    for (const char *name :
         {"accessors", "animations", "buffers", "bufferViews", "cameras", "extensionsRequired", "extensionsUsed",
          "images", "materials", "meshes", "nodes", "samplers", "scenes", "skins", "textures"})
        if (root[name].exists() && !root[name].isArray())
            throw GltfError(std::string("\"").append(name).append("\" is not an array"));
    if (root["extensions"].exists() && !root["extensions"].isObject())
        throw GltfError("\"extensions\" is not an object");
}

void ModelReader::prepareInteger(const JsonMember &member, std::int64_t most)
{
    const auto value = member.value.integer();
    if (!value || *value < 0 || *value > most)
        throw GltfError(place() + ": \"" + member.name + "\" is not an integer " +
                        (most == kLargestIndex ? "from 0 to " + std::to_string(most) : std::string("of at least 0")));
    // 12.0 is an integer too, but not to tinygltf.
    if (member.value.text() != std::to_string(*value))
        m_edit.replace(member.value, std::to_string(*value));
}

void ModelReader::prepareMember(const JsonMember &member)
{
    if (member.name == "extras" || (m_place.empty() && (member.name == "animations" || member.name == "cameras"))) {
        m_edit.replace(member.value, member.value.isArray() ? "[]" : "{}");
    } else if (m_place.empty() && (member.name == "buffers" || member.name == "images")) {
        // Prepared already.
    } else if (kIndices.contains(member.name) && !member.value.isArray() && !member.value.isObject()) {
        prepareInteger(member, kLargestIndex);
    } else if (kSizes.contains(member.name)) {
        prepareInteger(member, std::numeric_limits<std::int64_t>::max());
    } else if (member.value.isArray() || member.value.isObject()) {
        const bool unread =
            !m_place.empty() && m_place.back() == "extensions" && !kExtensionsRead.contains(member.name);
        if (unread || (m_place.size() == 1 && m_place.back() == "extensions")) {
            m_edit.replace(member.value, "{}");
        } else {
            m_place.push_back(member.name);
            prepare(member.value);
            m_place.pop_back();
        }
    }
}

void ModelReader::prepare(const JsonValue &value)
{
    if (value.isObject()) {
        for (const JsonMember &member : membersOf(value))
            prepareMember(member);
        return;
    }
    const std::vector<JsonValue> elements = value.children();
    for (std::size_t i = 0; i < elements.size(); ++i) {
        if (!elements[i].isArray() && !elements[i].isObject())
            continue;
        m_place.push_back(std::string("[").append(std::to_string(i)).append("]"));
        prepare(elements[i]);
        m_place.pop_back();
    }
}

void ModelReader::prepareBuffers(const JsonValue &buffers)
{
    for (const JsonValue &buffer : buffers.children()) {
        m_place = {numbered("buffer", m_buffers.size())};
        if (!buffer.isObject())
            throw GltfError(place() + " is not an object");
        BufferSource source;
        const JsonValue bytes = buffer["byteLength"];
        if (!bytes.exists() || bytes.integer().value_or(-1) < 0)
            throw GltfError(place() + ": \"byteLength\" is not an integer of at least 0");
        source.bytes = static_cast<std::uint64_t>(*bytes.integer());
        if (const JsonValue uri = buffer["uri"]; uri.exists()) {
            source.uri = uri.string();
            if (!source.uri)
                throw GltfError(place() + ": \"uri\" is not a string");
        }
        m_edit.replace(buffer, std::string(R"({"byteLength": 1, "uri": )") + kStandIn + "}");
        m_buffers.push_back(std::move(source));
    }
    m_place.clear();
}

void ModelReader::prepareImages(const JsonValue &images)
{
    for (const JsonValue &image : images.children()) {
        m_place = {numbered("image", m_images.size())};
        if (!image.isObject())
            throw GltfError(place() + " is not an object");
        ImageSource source{.name = image["name"].string().value_or(""),
                           .mimeType = image["mimeType"].string().value_or(""),
                           .uri = image["uri"].string()};
        const JsonValue view = image["bufferView"];
        if (view.exists() == image["uri"].exists() || (image["uri"].exists() && !source.uri))
            throw GltfError(place() + " has neither a URI nor a buffer view, or both");
        if (view.exists()) {
            const auto index = view.integer();
            if (!index || *index < 0 || *index > kLargestIndex)
                throw GltfError(place() + ": \"bufferView\" is not an index");
            source.bufferView = static_cast<int>(*index);
        }
        m_edit.replace(image, std::string(R"({"uri": )") + kStandIn + "}");
        m_images.push_back(std::move(source));
    }
    m_place.clear();
}

void ModelReader::prepareMeshes(const JsonValue &meshes)
{
    for (const JsonValue &mesh : meshes.children()) {
        const std::vector<JsonValue> primitives = mesh["primitives"].children();
        std::vector<int> &indices = m_indices.emplace_back();
        if (!mesh.isObject() || !mesh["primitives"].isArray())
            throw GltfError(numbered("mesh", m_indices.size() - 1) + " has no \"primitives\"");
        for (const JsonValue &primitive : primitives) {
            m_place = {numbered("mesh", m_indices.size() - 1) + numbered(" primitive", indices.size())};
            const JsonValue attributes = primitive["attributes"];
            if (!attributes.isObject())
                throw GltfError(place() + " has no \"attributes\"");
            for (const JsonMember &attribute : membersOf(attributes))
                prepareInteger(attribute, kLargestIndex);
            for (const JsonValue &target : primitive["targets"].children())
                for (const JsonMember &attribute : membersOf(target))
                    prepareInteger(attribute, kLargestIndex);
            if (const JsonValue mode = primitive["mode"]; mode.exists())
                prepareInteger({"mode", mode}, kLargestIndex);
            indices.push_back(-1);
            if (const JsonValue accessor = primitive["indices"]; accessor.exists()) {
                prepareInteger({"indices", accessor}, kLargestIndex);
                indices.back() = static_cast<int>(*accessor.integer());
                m_edit.replace(accessor, "-1");
            }
        }
    }
    m_place.clear();
}

void ModelReader::countObjects(const JsonValue &root) const
{
    std::size_t bytes = root["materials"].children().size() * 4096;
    for (const char *name : {"accessors", "bufferViews", "buffers", "images", "meshes", "nodes", "samplers", "scenes",
                             "skins", "textures"})
        bytes += root[name].children().size() * 1024;
    for (const std::vector<int> &primitives : m_indices)
        bytes += primitives.size() * 512;
    if (bytes > kMostModelBytes)
        throw GltfError("there are too many objects in it");
}

void ModelReader::parse()
{
    const std::string edited = m_edit.apply();
    const std::string_view text = std::string_view(edited).substr(m_tree.root().begin());
    tinygltf::TinyGLTF loader;
    loader.SetImageLoader(leaveImage, nullptr);
    std::string error;
    std::string warning;
    if (!loader.LoadASCIIFromString(&m_model, &error, &warning, text.data(), static_cast<unsigned>(text.size()), "."))
        throw GltfError(firstLine(error));
    const auto sameCount = [](const tinygltf::Mesh &mesh, const std::vector<int> &primitives) {
        return mesh.primitives.size() == primitives.size();
    };
    if (!std::equal(m_model.meshes.begin(), m_model.meshes.end(), m_indices.begin(), m_indices.end(), sameCount) ||
        m_model.buffers.size() != m_buffers.size() || m_model.images.size() != m_images.size())
        throw GltfError(firstLine(error));
    for (std::size_t m = 0; m < m_indices.size(); ++m)
        for (std::size_t p = 0; p < m_indices[m].size(); ++p)
            m_model.meshes[m].primitives[p].indices = m_indices[m][p];
}

// What a GLB's first buffer is in, where it has no URI (glTF 2.0, 4.4.3.3, "Binary buffer").
std::span<const std::uint8_t> ModelReader::binaryChunk() const
{
    if (!m_container.binary)
        return {};
    const auto chunk =
        firstGlbChunk(std::span(m_container.bytes).subspan(m_container.jsonOffset + m_container.jsonSize));
    return chunk && chunk->type == kGlbBinary ? chunk->data : std::span<const std::uint8_t>();
}

std::vector<std::uint8_t> ModelReader::readBuffer(std::size_t index, const BufferSource &source) const
{
    std::vector<std::uint8_t> bytes;
    if (!source.uri) {
        // Others have no data of their own: what is in them comes from an extension (EXT_meshopt_compression).
        if (index != 0 || !m_container.binary)
            return {};
        const auto chunk = binaryChunk();
        if (source.bytes > chunk.size())
            throw GltfError("has " + std::to_string(source.bytes) + " bytes, the GLB's binary chunk " +
                            std::to_string(chunk.size()));
        return {chunk.begin(), chunk.begin() + static_cast<std::ptrdiff_t>(source.bytes)};
    }
    if (isDataUri(*source.uri))
        bytes = readDataUri(*source.uri).bytes;
    else
        bytes = readWholeFile(fileOfUri(m_folder, *source.uri));
    if (source.bytes > bytes.size())
        throw GltfError("has " + std::to_string(source.bytes) + " bytes, there are " + std::to_string(bytes.size()));
    bytes.resize(source.bytes);
    return bytes;
}

void ModelReader::readBuffers()
{
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < m_buffers.size(); ++i) {
        const BufferSource &source = m_buffers[i];
        const bool named = source.uri && !isDataUri(*source.uri);
        const std::string what = numbered("buffer", i) + (named ? " (" + *source.uri + "): " : ": ");
        try {
            m_model.buffers[i].data = readBuffer(i, source);
        } catch (const GltfUnsupported &error) {
            throw GltfUnsupported(what + error.what());
        } catch (const GltfError &error) {
            throw GltfError(what + error.what());
        }
        sum += m_model.buffers[i].data.size();
        if (sum > kMostBufferBytes)
            throw GltfError("the buffers have more than 2 GiB");
        m_model.buffers[i].uri = named ? *source.uri : "";
    }
}

void ModelReader::readImages()
{
    for (std::size_t i = 0; i < m_images.size(); ++i) {
        ImageSource &source = m_images[i];
        tinygltf::Image &image = m_model.images[i];
        image.name = source.name;
        image.mimeType = source.mimeType;
        image.bufferView = source.bufferView;
        image.uri.clear();
        image.image.clear();
        image.as_is = true;
        if (!source.uri)
            continue;
        if (!isDataUri(*source.uri)) {
            image.uri = *source.uri;
            continue;
        }
        try {
            DataUri data = readDataUri(*source.uri);
            image.image = std::move(data.bytes);
            if (image.mimeType.empty())
                image.mimeType = data.mimeType;
        } catch (const GltfError &error) {
            throw GltfError(numbered("image", i) + ": " + error.what());
        }
        source.uri->clear();
        source.uri->shrink_to_fit();
    }
}

void ModelReader::read()
{
    const JsonValue root = m_tree.root();
    if (!root.isObject())
        throw GltfError("the JSON is not an object");
    m_tree.checkNames();
    checkAsset(root);
    checkRoot(root);
    prepareBuffers(root["buffers"]);
    prepareImages(root["images"]);
    prepareMeshes(root["meshes"]);
    countObjects(root);
    prepare(root);
    parse();
    readBuffers();
    readImages();
}

} // namespace

void readModel(const Container &container, const std::filesystem::path &folder, tinygltf::Model &model)
{
    ModelReader(container, folder, model).read();
}

} // namespace vellum
