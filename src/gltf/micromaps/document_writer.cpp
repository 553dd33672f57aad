#include "gltf/micromaps/document_writer.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <stdexcept>

#include "core/align.h"
#include "core/hash.h"
#include "gltf/file/glb.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/json_edit.h"
#include "gltf/file/json_writer.h"
#include "gltf/file/outside_file.h"
#include "gltf/file/relative_uri.h"

namespace vellum
{
namespace
{

constexpr const char *kExtension = "EXT_mesh_opacity_micromap";
constexpr const char *kEarlier = "KHR_mesh_opacity_micromap";
constexpr std::size_t kMostBytes = 0x7fffffff; // what readContainer takes
// What Vulkan wants of the addresses of both inputs of a micromap build
// (VUID-vkCmdBuildMicromapsEXT-pInfos-07515): a buffer that is loaded as it is serves.
constexpr std::size_t kBuildAlignment = 256;
constexpr std::size_t kIndexAlignment = 4;

template <typename T>
void append(std::vector<std::uint8_t> &bytes, const T &value)
{
    const std::size_t old = bytes.size();
    bytes.resize(old + sizeof value);
    std::memcpy(bytes.data() + old, &value, sizeof value);
}

void padTo(std::vector<std::uint8_t> &bytes, std::size_t alignment, std::uint8_t with = 0)
{
    bytes.resize(alignUp(bytes.size(), alignment), with);
}

// In hexadecimal digits: the same bytes have the same name.
std::string digest(std::span<const std::uint8_t> bytes)
{
    const std::uint64_t hash = hashBytes(bytes.data(), bytes.size());
    std::string text;
    for (int shift = 60; shift >= 0; shift -= 4)
        text += "0123456789abcdef"[hash >> shift & 15];
    return text;
}

class Writer
{
public:
    Writer(const Document &document, const DocumentBake &bake, const std::string &bufferStem)
        : m_document(document), m_bake(bake), m_bufferStem(bufferStem), m_root(document.root()), m_edit(document.tree())
    {
    }

    RewrittenFile write();

private:
    [[nodiscard]] bool dataInChunk() const;
    void setExtension(const JsonValue &object, const std::string &text);
    void editPrimitives();
    void writeMicromap(const StoredMicromap &micromap, JsonWriter &json);
    std::string primitiveJson(const BakedPrimitive &primitive, std::size_t records);
    std::size_t addView(std::span<const std::uint8_t> bytes, std::size_t alignment, int target = 0);
    template <typename T>
    std::size_t addAccessor(const std::vector<T> &values, int target = 0);
    void appendAll(const char *name, const std::vector<std::string> &elements);
    void setUsed(bool used);
    void placeData(RewrittenFile &result);
    void assemble(RewrittenFile &result);

    const Document &m_document;
    const DocumentBake &m_bake;
    const std::string &m_bufferStem;
    JsonValue m_root;
    JsonEdit m_edit;
    bool m_inChunk = false;
    std::size_t m_dataBegin = 0; // of m_data in its buffer
    std::vector<std::uint8_t> m_data;
    std::vector<std::string> m_views;
    std::vector<std::string> m_accessors;
};

// glTF 2.0, "GLB-stored Buffer": the first buffer, without a URI, is the chunk, whose end may be padding.
bool Writer::dataInChunk() const
{
    if (!m_document.binary())
        return false;
    const std::span<const std::uint8_t> chunks = m_document.otherChunks();
    const JsonValue first = m_root["buffers"].children().empty() ? JsonValue() : m_root["buffers"].children()[0];
    if (!first.exists())
        return chunks.empty();
    const auto chunk = firstGlbChunk(chunks);
    if (first["uri"].exists() || !chunk || chunk->type != kGlbBinary)
        return false;
    const auto length = first["byteLength"].integer();
    return length && *length >= 0 && static_cast<std::uint64_t>(*length) <= chunk->data.size();
}

// `target`: of a buffer view; 0 for none.
std::size_t Writer::addView(std::span<const std::uint8_t> bytes, std::size_t alignment, int target)
{
    padTo(m_data, alignment);
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("buffer", m_inChunk ? 0 : m_document.model().buffers.size());
    json.member("byteOffset", m_dataBegin + m_data.size()).member("byteLength", bytes.size());
    if (target != 0)
        json.member("target", target);
    m_views.push_back(json.end().text());
    m_data.insert(m_data.end(), bytes.begin(), bytes.end());
    return m_document.model().bufferViews.size() + m_views.size() - 1;
}

template <typename T>
std::size_t Writer::addAccessor(const std::vector<T> &values, int target)
{
    const std::span bytes(reinterpret_cast<const std::uint8_t *>(values.data()), values.size() * sizeof(T));
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("bufferView", addView(bytes, kIndexAlignment, target));
    json.member("componentType", sizeof(T) == 2 ? gltf_json::kUnsignedShort : gltf_json::kUnsignedInt);
    m_accessors.push_back(json.member("count", values.size()).member("type", "SCALAR").end().text());
    return m_document.model().accessors.size() + m_accessors.size() - 1;
}

void Writer::writeMicromap(const StoredMicromap &micromap, JsonWriter &json)
{
    const std::span records(reinterpret_cast<const std::uint8_t *>(micromap.triangles.data()),
                            micromap.triangles.size() * sizeof(MicromapTriangle));
    json.beginObject().member("data", addView(micromap.data, kBuildAlignment));
    json.member("triangles", addView(records, kBuildAlignment));
    const auto list = [&](const char *name, auto member) {
        json.list(name, micromap.usage, [&](const MicromapUsage &usage) { json.value(member(usage)); });
    };
    list("usageCounts", [](const MicromapUsage &usage) { return usage.count; });
    list("usageLevels", [](const MicromapUsage &usage) { return usage.subdivisionLevel; });
    list("usageFormats", [](const MicromapUsage &usage) { return static_cast<std::uint32_t>(usage.format); });
    json.end();
}

// 16-bit indices where they do: VK_EXT_opacity_micromap takes no smaller ones. The four highest are special.
std::string Writer::primitiveJson(const BakedPrimitive &primitive, std::size_t records)
{
    const std::vector<std::int32_t> &indices = primitive.micromap.indices;
    const std::size_t accessor = records <= 0xfffc
                                     ? addAccessor(std::vector<std::uint16_t>(indices.begin(), indices.end()))
                                     : addAccessor(std::vector<std::uint32_t>(indices.begin(), indices.end()));
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("micromap", primitive.micromap.micromap).member("micromapIndices", accessor);
    if (primitive.micromap.baseTriangle != 0)
        json.member("micromapBaseTriangle", primitive.micromap.baseTriangle);
    return json.end().text();
}

// Gives an object the extension, or none where `text` is empty.
void Writer::setExtension(const JsonValue &object, const std::string &text)
{
    const JsonValue extensions = object["extensions"];
    if (!extensions.exists()) {
        if (!text.empty())
            m_edit.set(object, "extensions",
                       JsonWriter(JsonStyle::Compact).beginObject().key(kExtension).json(text).end().text());
        return;
    }
    if (!extensions.isObject())
        throw GltfError("the JSON has \"extensions\" that are not an object");
    const std::size_t ours = extensions.count(kExtension) + extensions.count(kEarlier);
    if (text.empty() && ours == extensions.members().size()) {
        if (ours != 0) // an object without extensions has no "extensions"
            m_edit.remove(object, "extensions");
        return;
    }
    m_edit.remove(extensions, kEarlier);
    if (text.empty())
        m_edit.remove(extensions, kExtension);
    else
        m_edit.set(extensions, kExtension, text);
}

void Writer::editPrimitives()
{
    std::map<PrimitivePlace, const BakedPrimitive *> baked;
    for (const BakedPrimitive &primitive : m_bake.primitives)
        baked[primitive.place] = &primitive;
    const std::vector<JsonValue> meshes = m_root["meshes"].children();
    for (std::uint32_t m = 0; m < meshes.size(); ++m) {
        const std::vector<JsonValue> primitives = meshes[m]["primitives"].children();
        for (std::uint32_t p = 0; p < primitives.size(); ++p) {
            const auto found = baked.find({m, p});
            if (found == baked.end()) {
                setExtension(primitives[p], "");
                continue;
            }
            const BakedPrimitive &primitive = *found->second;
            if (!primitive.corners.empty()) {
                constexpr int kTarget = 34963; // ELEMENT_ARRAY_BUFFER
                const std::vector<std::uint32_t> &corners = primitive.corners;
                // 65535 would restart the primitive (glTF 2.0, "Overview" of meshes).
                const bool small = *std::max_element(corners.begin(), corners.end()) < 0xffff;
                const std::size_t accessor =
                    small ? addAccessor(std::vector<std::uint16_t>(corners.begin(), corners.end()), kTarget)
                          : addAccessor(corners, kTarget);
                m_edit.set(primitives[p], "indices", std::to_string(accessor));
                m_edit.set(primitives[p], "mode", "4");
            }
            setExtension(primitives[p],
                         primitiveJson(primitive, m_bake.micromaps[primitive.micromap.micromap].triangles.size()));
        }
    }
}

void Writer::appendAll(const char *name, const std::vector<std::string> &elements)
{
    if (elements.empty())
        return;
    const JsonValue array = m_root[name];
    JsonWriter all(JsonStyle::Compact);
    all.beginArray();
    for (const std::string &element : elements) {
        if (array.exists())
            m_edit.append(array, element);
        else
            all.json(element);
    }
    if (!array.exists())
        m_edit.set(m_root, name, all.end().text());
}

void Writer::setUsed(bool used)
{
    for (const char *name : {"extensionsUsed", "extensionsRequired"}) {
        const JsonValue list = m_root[name];
        if (list.exists() && !list.isArray())
            throw GltfError("\"" + std::string(name) + "\" is not an array");
        std::size_t theirs = 0;
        bool listed = false;
        for (const JsonValue &element : list.children()) {
            const std::string extension = element.string().value_or("");
            theirs += extension != kExtension && extension != kEarlier ? 1u : 0u;
            listed = listed || extension == kExtension;
        }
        const bool add = used && !listed && std::strcmp(name, "extensionsUsed") == 0;
        if (add) {
            appendAll(name, {quotedJson(kExtension)});
        } else if (list.exists() && theirs == 0 && !(used && listed) && !list.children().empty()) {
            m_edit.remove(m_root, name); // it must not be empty
            continue;
        }
        if (!list.exists())
            continue;
        m_edit.remove(list, kEarlier);
        if (!used)
            m_edit.remove(list, kExtension);
    }
}

void Writer::placeData(RewrittenFile &result)
{
    if (m_data.empty())
        return;
    const std::size_t length = m_dataBegin + m_data.size();
    if (length > kMostBytes)
        throw GltfError("with micromaps it would be larger than 2 GiB");
    if (m_inChunk && m_root["buffers"].exists() && !m_root["buffers"].children().empty()) {
        m_edit.set(m_root["buffers"].children()[0], "byteLength", std::to_string(length));
        return;
    }
    JsonWriter buffer(JsonStyle::Compact);
    buffer.beginObject();
    if (!m_inChunk && (m_document.binary() || m_bufferStem.empty())) {
        buffer.member("uri", "data:application/octet-stream;base64," + base64Encoded(m_data));
    } else if (!m_inChunk) {
        result.bufferName = m_bufferStem + "-" + digest(m_data) + ".bin";
        buffer.member("uri", encodedUri(result.bufferName));
        result.buffer.keep(std::move(m_data));
    }
    appendAll("buffers", {buffer.member("byteLength", length).end().text()});
}

void Writer::assemble(RewrittenFile &result)
{
    const std::string json = m_edit.apply();
    const std::string_view original = m_document.tree().text();
    std::vector<std::uint8_t> text(json.begin(), json.end());
    if (!m_document.binary()) {
        text.insert(text.end(), original.begin() + static_cast<std::ptrdiff_t>(m_root.end()), original.end());
        result.file.keep(std::move(text));
        return;
    }
    padTo(text, 4, ' ');
    std::span<const std::uint8_t> rest = m_document.otherChunks();
    std::span<const std::uint8_t> binary;
    const bool grows = m_inChunk && !m_data.empty();
    if (const auto first = firstGlbChunk(rest); grows && first) {
        binary = first->data;
        rest = first->rest;
    }
    std::vector<std::uint8_t> between(m_dataBegin - binary.size());
    padTo(m_data, 4);
    const std::uint64_t chunk = grows ? m_dataBegin + m_data.size() : 0;
    const std::uint64_t total =
        kGlbHeaderBytes + kGlbChunkHeaderBytes + text.size() + (grows ? kGlbChunkHeaderBytes + chunk : 0) + rest.size();
    if (total > kMostBytes)
        throw GltfError("with micromaps it would be larger than 2 GiB");
    std::vector<std::uint8_t> header(m_document.bytes().begin(), m_document.bytes().begin() + 8);
    append(header, static_cast<std::uint32_t>(total));
    append(header, static_cast<std::uint32_t>(text.size()));
    header.insert(header.end(), m_document.bytes().begin() + 16, m_document.bytes().begin() + 20); // "JSON"
    result.file.keep(std::move(header));
    result.file.keep(std::move(text));
    if (grows) {
        std::vector<std::uint8_t> chunkHeader;
        append(chunkHeader, static_cast<std::uint32_t>(chunk));
        append(chunkHeader, kGlbBinary);
        result.file.keep(std::move(chunkHeader));
        result.file.add(binary);
        result.file.keep(std::move(between));
        result.file.keep(std::move(m_data));
    }
    result.file.add(rest);
}

RewrittenFile Writer::write()
{
    RewrittenFile result;
    m_inChunk = dataInChunk();
    if (m_inChunk) {
        const auto first = firstGlbChunk(m_document.otherChunks());
        const std::size_t old = first ? first->data.size() : 0;
        m_dataBegin = alignUp(old, kBuildAlignment);
    }
    const bool any = !m_bake.micromaps.empty();
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().list("micromaps", m_bake.micromaps,
                            [&](const StoredMicromap &micromap) { writeMicromap(micromap, json); });
    setExtension(m_root, any ? json.end().text() : "");
    editPrimitives();
    setUsed(any);
    appendAll("bufferViews", m_views);
    appendAll("accessors", m_accessors);
    placeData(result);
    assemble(result);
    return result;
}

} // namespace

bool hasMicromaps(const Document &document)
{
    const JsonValue extensions = document.root()["extensions"];
    return extensions[kExtension].exists() || extensions[kEarlier].exists();
}

RewrittenFile withMicromaps(const Document &document, const DocumentBake &bake, const std::string &bufferStem)
{
    return document.named([&] {
        RewrittenFile result;
        const bool has = document.tree().text().find("_mesh_opacity_micromap") != std::string_view::npos;
        if (bake.micromaps.empty() && !has) {
            result.file.add(document.bytes());
            return result;
        }
        return Writer(document, bake, bufferStem).write();
    });
}

} // namespace vellum
