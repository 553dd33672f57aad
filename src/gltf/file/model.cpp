// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/model.h"

#include <limits>

#include "gltf/file/gltf_error.h"
#include "gltf/file/uri.h"

namespace vellum::gltf_json
{
namespace
{

constexpr uint64_t kMostBufferBytes = uint64_t{1} << 31;
// The memory that a model may take, by a generous count of its structures: an empty object is 2 bytes of the file.
constexpr size_t kMostModelBytes = size_t{512} << 20;

std::string numbered(const char *what, size_t index)
{
    return std::string(what).append(" ").append(std::to_string(index));
}

// `value` is the member `name`.
int indexOf(const JsonValue &value, std::string_view name, const std::string &place)
{
    const auto integer = value.integer();
    if (!integer || *integer < 0 || *integer > std::numeric_limits<int>::max())
        throw GltfError(place + ": \"" + std::string(name) + "\" is not an integer from 0 to " +
                        std::to_string(std::numeric_limits<int>::max()));
    return static_cast<int>(*integer);
}

// The members of one object.
class Members
{
public:
    Members(const JsonValue &object, std::string place) : object_(object), place_(std::move(place))
    {
        if (!object.isObject())
            throw GltfError(place_ + " is not an object");
    }

    [[nodiscard]] const std::string &place() const { return place_; }
    [[nodiscard]] JsonValue operator[](std::string_view name) const { return object_[name]; }
    // An index, or another integer of that range.
    [[nodiscard]] int index(std::string_view name, int otherwise = -1) const
    {
        return indexIn(object_, name, place_).value_or(otherwise);
    }
    [[nodiscard]] int requiredIndex(std::string_view name) const
    {
        require(name);
        return index(name);
    }
    [[nodiscard]] size_t size(std::string_view name, size_t otherwise = 0) const
    {
        const JsonValue value = object_[name];
        if (!value.exists())
            return otherwise;
        const auto integer = value.integer();
        if (!integer || *integer < 0)
            throw GltfError(place_ + ": \"" + std::string(name) + "\" is not an integer of at least 0");
        if (static_cast<uint64_t>(*integer) > std::numeric_limits<size_t>::max())
            throw GltfError(place_ + ": \"" + std::string(name) + "\" is too large");
        return static_cast<size_t>(*integer);
    }
    [[nodiscard]] size_t requiredSize(std::string_view name) const
    {
        require(name);
        return size(name);
    }
    [[nodiscard]] std::string text(std::string_view name, const char *otherwise = "") const
    {
        return object_[name].string().value_or(otherwise);
    }
    [[nodiscard]] double number(std::string_view name, double otherwise) const
    {
        return numberIn(object_, name, place_).value_or(otherwise);
    }
    [[nodiscard]] std::vector<double> numbers(std::string_view name) const { return numbersIn(object_, name, place_); }
    // Empty where an element is not an integer.
    [[nodiscard]] std::vector<int> integers(std::string_view name) const
    {
        std::vector<int> integers;
        for (const JsonValue &element : arrayOf(name)) {
            const auto integer = element.integer();
            if (!integer || *integer != static_cast<int>(*integer))
                return {};
            integers.push_back(static_cast<int>(*integer));
        }
        return integers;
    }

private:
    void require(std::string_view name) const
    {
        if (!object_[name].exists())
            throw GltfError(place_ + ": \"" + std::string(name) + "\" is missing");
    }
    [[nodiscard]] std::vector<JsonValue> arrayOf(std::string_view name) const
    {
        const JsonValue value = object_[name];
        return value.isArray() ? value.children() : std::vector<JsonValue>();
    }

    JsonValue object_;
    std::string place_;
};

uint32_t componentsOf(const std::string &type, const std::string &place)
{
    static const std::map<std::string, uint32_t, std::less<>> kTypes = {
        {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};
    const auto found = kTypes.find(type);
    if (found == kTypes.end())
        throw GltfError("Unsupported `type` \"" + type + "\" of " + place);
    return found->second;
}

BufferView bufferViewOf(const Members &view)
{
    BufferView result{.buffer = view.requiredIndex("buffer"),
                      .byteOffset = view.size("byteOffset"),
                      .byteLength = view.requiredSize("byteLength"),
                      .byteStride = view.size("byteStride"),
                      .extensions = view["extensions"]};
    if (result.byteStride % 4 != 0 || result.byteStride > 252)
        throw GltfError("Invalid `byteStride' value " + std::to_string(result.byteStride) + " of " + view.place() +
                        ": it is not a multiple of 4 that is at most 252");
    return result;
}

Accessor accessorOf(const Members &accessor)
{
    Accessor result;
    result.bufferView = accessor.index("bufferView");
    result.byteOffset = accessor.size("byteOffset");
    result.componentType = accessor.requiredIndex("componentType");
    result.components = componentsOf(accessor.text("type"), accessor.place());
    result.count = accessor.requiredSize("count");
    result.normalized = accessor["normalized"].isTrue();
    if (const JsonValue sparse = accessor["sparse"]; sparse.exists()) {
        const Members replaced(sparse, accessor.place() + ".sparse");
        const Members indices(replaced["indices"], replaced.place() + ".indices");
        const Members values(replaced["values"], replaced.place() + ".values");
        result.sparse = {.count = replaced.requiredSize("count"),
                         .indices = indices.requiredIndex("bufferView"),
                         .indicesOffset = indices.size("byteOffset"),
                         .indicesType = indices.requiredIndex("componentType"),
                         .values = values.requiredIndex("bufferView"),
                         .valuesOffset = values.size("byteOffset")};
    }
    return result;
}

Sampler samplerOf(const Members &sampler)
{
    return {.magFilter = sampler.index("magFilter"),
            .wrapS = sampler.index("wrapS", kRepeat),
            .wrapT = sampler.index("wrapT", kRepeat)};
}

Texture textureOf(const Members &texture)
{
    return {
        .source = texture.index("source"), .sampler = texture.index("sampler"), .extensions = texture["extensions"]};
}

Material materialOf(const Members &material)
{
    Material result;
    result.name = material.text("name");
    result.alphaMode = material.text("alphaMode", "OPAQUE");
    result.alphaCutoff = material.number("alphaCutoff", 0.5);
    result.extensions = material["extensions"];
    const JsonValue pbr = material["pbrMetallicRoughness"];
    if (!pbr.exists())
        return result;
    const Members metallic(pbr, material.place() + ".pbrMetallicRoughness");
    result.baseColorFactor = metallic.numbers("baseColorFactor");
    if (const JsonValue texture = metallic["baseColorTexture"]; texture.exists()) {
        const Members info(texture, metallic.place() + ".baseColorTexture");
        result.baseColorTexture = info.requiredIndex("index");
        result.texCoord = info.index("texCoord", 0);
        result.textureExtensions = info["extensions"];
    }
    return result;
}

Attributes attributesOf(const JsonValue &object, const std::string &place)
{
    Attributes attributes;
    for (const auto &[name, accessor] : object.members()) {
        std::string text = name.string().value_or("");
        const int index = indexOf(accessor, text, place);
        attributes.emplace(std::move(text), index);
    }
    return attributes;
}

Primitive primitiveOf(const JsonValue &value, const std::string &place)
{
    if (!value["attributes"].isObject())
        throw GltfError(place + " has no \"attributes\"");
    const Members primitive(value, place);
    Primitive result;
    result.attributes = attributesOf(primitive["attributes"], place);
    result.indices = primitive.index("indices");
    result.material = primitive.index("material");
    result.mode = primitive.index("mode", kTriangles);
    result.extensions = primitive["extensions"];
    for (const JsonValue &target : primitive["targets"].children())
        result.targets.push_back(attributesOf(target, place));
    return result;
}

Mesh meshOf(const JsonValue &value, size_t index)
{
    const std::string place = numbered("mesh", index);
    if (!value["primitives"].isArray())
        throw GltfError(place + " has no \"primitives\"");
    const Members mesh(value, place);
    Mesh result{.name = mesh.text("name"), .primitives = {}, .weights = mesh.numbers("weights")};
    for (const JsonValue &primitive : mesh["primitives"].children())
        result.primitives.push_back(primitiveOf(primitive, place + numbered(" primitive", result.primitives.size())));
    return result;
}

Node nodeOf(const Members &node)
{
    return {.children = node.integers("children"),
            .mesh = node.index("mesh"),
            .skin = node.index("skin"),
            .matrix = node.numbers("matrix"),
            .translation = node.numbers("translation"),
            .rotation = node.numbers("rotation"),
            .scale = node.numbers("scale"),
            .weights = node.numbers("weights"),
            .extensions = node["extensions"]};
}

class ModelReader
{
public:
    ModelReader(const Container &container, const JsonTree &tree, const std::filesystem::path &path)
        : container_(container), tree_(tree), root_(tree.root()), path_(path)
    {
    }

    Model read();

private:
    void checkRoot() const;
    void countObjects() const;
    // The elements of an array of the root, each by `make`, which takes their members.
    template <typename Element>
    void readAll(const char *name, std::vector<Element> &elements, Element (*make)(const Members &)) const
    {
        for (const JsonValue &value : root_[name].children())
            elements.push_back(make(Members(value, std::string(name) + "[" + std::to_string(elements.size()) + "]")));
    }
    [[nodiscard]] std::vector<std::string> names(const char *list) const;
    void readBuffers();
    [[nodiscard]] Buffer bufferOf(const Members &buffer, size_t index) const;
    [[nodiscard]] std::span<const uint8_t> binaryChunk() const;
    [[nodiscard]] Image imageOf(const Members &image) const;

    const Container &container_;
    const JsonTree &tree_;
    JsonValue root_;
    const std::filesystem::path &path_;
    Model model_;
};

void ModelReader::checkRoot() const
{
    if (!root_.isObject())
        throw GltfError("the JSON is not an object");
    tree_.checkNames();
    const std::string version = root_["asset"]["version"].string().value_or("");
    if (version.empty())
        throw GltfError("there is no \"asset\" with a \"version\" in it");
    if (!version.starts_with("2."))
        throw GltfError("glTF version " + version + " is not 2");
    if (const auto needed = root_["asset"]["minVersion"].string(); needed && *needed != "2.0")
        throw GltfUnsupported("glTF version " + *needed + " is needed to read it");
    if (tree_.text().find_first_not_of(std::string_view(" \t\r\n\0", 5), root_.end()) != std::string_view::npos)
        throw GltfError("the JSON is followed by something else");
    for (const char *name :
         {"accessors", "animations", "buffers", "bufferViews", "cameras", "extensionsRequired", "extensionsUsed",
          "images", "materials", "meshes", "nodes", "samplers", "scenes", "skins", "textures"})
        if (root_[name].exists() && !root_[name].isArray())
            throw GltfError(std::string("\"").append(name).append("\" is not an array"));
    if (root_["extensions"].exists() && !root_["extensions"].isObject())
        throw GltfError("\"extensions\" is not an object");
}

void ModelReader::countObjects() const
{
    size_t bytes = root_["materials"].children().size() * 4096;
    for (const char *name : {"accessors", "bufferViews", "buffers", "images", "meshes", "nodes", "samplers", "scenes",
                             "skins", "textures"})
        bytes += root_[name].children().size() * 1024;
    for (const JsonValue &mesh : root_["meshes"].children())
        bytes += mesh["primitives"].children().size() * 512;
    if (bytes > kMostModelBytes)
        throw GltfError("there are too many objects in it");
}

std::vector<std::string> ModelReader::names(const char *list) const
{
    std::vector<std::string> names;
    for (const JsonValue &element : root_[list].children())
        if (auto name = element.string())
            names.push_back(std::move(*name));
    return names;
}

// The chunk that a GLB's first buffer is in, where it has no URI (glTF 2.0, 4.4.3.3, "Binary buffer").
std::span<const uint8_t> ModelReader::binaryChunk() const
{
    if (!container_.binary)
        return {};
    const auto chunk = firstGlbChunk(std::span(container_.bytes).subspan(container_.jsonOffset + container_.jsonSize));
    return chunk && chunk->type == kGlbBinary ? chunk->data : std::span<const uint8_t>();
}

Buffer ModelReader::bufferOf(const Members &buffer, size_t index) const
{
    const JsonValue uri = buffer["uri"];
    const auto bytes = buffer["byteLength"].integer();
    if (!bytes || *bytes < 0)
        throw GltfError(buffer.place() + ": \"byteLength\" is not an integer of at least 0");
    if (uri.exists() && !uri.string())
        throw GltfError(buffer.place() + ": \"uri\" is not a string");
    const auto length = static_cast<uint64_t>(*bytes);
    Buffer result;
    if (!uri.exists()) {
        // Other buffers have no data of their own: an extension provides it (EXT_meshopt_compression).
        if (index != 0 || !container_.binary)
            return result;
        result.data = binaryChunk();
        if (length > result.data.size())
            throw GltfError(buffer.place() + ": has " + std::to_string(length) + " bytes, the GLB's binary chunk " +
                            std::to_string(result.data.size()));
    } else {
        const std::string text = *uri.string();
        const bool embedded = isDataUri(text);
        const std::string what = buffer.place() + (embedded ? ": " : " (" + text + "): ");
        try {
            result.own = embedded ? readDataUri(text).bytes : readFileOfUri(path_, text);
        } catch (const GltfUnsupported &error) {
            throw GltfUnsupported(what + error.what());
        } catch (const GltfError &error) {
            throw GltfError(what + error.what());
        }
        result.data = result.own;
        if (length > result.data.size())
            throw GltfError(what + "has " + std::to_string(length) + " bytes, there are " +
                            std::to_string(result.data.size()));
    }
    result.data = result.data.first(static_cast<size_t>(length));
    return result;
}

void ModelReader::readBuffers()
{
    uint64_t sum = 0;
    for (const JsonValue &value : root_["buffers"].children()) {
        const size_t index = model_.buffers.size();
        model_.buffers.push_back(bufferOf(Members(value, numbered("buffer", index)), index));
        sum += model_.buffers.back().data.size();
        if (sum > kMostBufferBytes)
            throw GltfError("the buffers have more than 2 GiB");
    }
}

Image ModelReader::imageOf(const Members &image) const
{
    const JsonValue view = image["bufferView"];
    const auto uri = image["uri"].string();
    if (view.exists() == image["uri"].exists() || (image["uri"].exists() && !uri))
        throw GltfError(image.place() + " has neither a URI nor a buffer view, or both");
    Image result{.uri = {}, .data = {}, .bufferView = image.index("bufferView")};
    if (uri && isDataUri(*uri)) {
        try {
            result.data = readDataUri(*uri).bytes;
        } catch (const GltfError &error) {
            throw GltfError(image.place() + ": " + error.what());
        }
    } else if (uri) {
        result.uri = *uri;
    }
    return result;
}

Model ModelReader::read()
{
    checkRoot();
    countObjects();
    for (const JsonValue &mesh : root_["meshes"].children())
        model_.meshes.push_back(meshOf(mesh, model_.meshes.size()));
    readAll("accessors", model_.accessors, accessorOf);
    readAll("bufferViews", model_.bufferViews, bufferViewOf);
    readAll("samplers", model_.samplers, samplerOf);
    readAll("textures", model_.textures, textureOf);
    readAll("materials", model_.materials, materialOf);
    readAll("nodes", model_.nodes, nodeOf);
    readAll<Skin>("skins", model_.skins, [](const Members &skin) {
        return Skin{.inverseBindMatrices = skin.index("inverseBindMatrices"), .joints = skin.integers("joints")};
    });
    readAll<std::vector<int>>("scenes", model_.scenes, [](const Members &scene) { return scene.integers("nodes"); });
    model_.scene = Members(root_, "the root").index("scene");
    model_.extensionsUsed = names("extensionsUsed");
    for (std::string &name : names("extensionsRequired"))
        model_.extensionsRequired.insert(std::move(name));
    for (const JsonValue &image : root_["images"].children())
        model_.images.push_back(imageOf(Members(image, numbered("image", model_.images.size()))));
    readBuffers();
    return std::move(model_);
}

} // namespace

int Primitive::attribute(const std::string &name) const
{
    const auto found = attributes.find(name);
    return found == attributes.end() ? -1 : found->second;
}

bool Model::isRequired(const char *extension) const
{
    return extensionsRequired.contains(extension);
}

std::optional<int> indexIn(const JsonValue &object, std::string_view name, const std::string &place)
{
    const JsonValue value = object[name];
    if (!value.exists())
        return std::nullopt;
    return indexOf(value, name, place);
}

std::optional<double> numberIn(const JsonValue &object, std::string_view name, const std::string &place)
{
    const JsonValue value = object[name];
    const auto number = value.number();
    if (value.exists() && !number)
        throw GltfError(place + ": \"" + std::string(name) + "\" is not a number");
    return number;
}

std::vector<double> numbersIn(const JsonValue &object, std::string_view name, const std::string &place)
{
    std::vector<double> numbers;
    const JsonValue value = object[name];
    for (const JsonValue &element : value.children())
        if (const auto number = element.number())
            numbers.push_back(*number);
    if (value.exists() && (!value.isArray() || numbers.size() != value.children().size()))
        throw GltfError(place + ": \"" + std::string(name) + "\" is not an array of numbers");
    return numbers;
}

Model readModel(const Container &container, const JsonTree &tree, const std::filesystem::path &path)
{
    return ModelReader(container, tree, path).read();
}

} // namespace vellum::gltf_json
