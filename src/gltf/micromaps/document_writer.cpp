// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/document_writer.h"

#include <algorithm>
#include <cstring>
#include <map>

#include "base/json_writer.h"
#include "base/text.h"
#include "core/align.h"
#include "core/hash.h"
#include "gltf/file/container.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/json_tree.h"
#include "gltf/file/uri.h"

namespace vellum
{
namespace
{

constexpr const char *kExtension = kMicromapExtension;
// Marks the extension of files that were written here, in its "extras".
constexpr const char *kGenerator = "vellum";
// Marks files without the extension, in the "extras" of the asset: a member and its value.
constexpr const char *kFileMark = "vellum";
constexpr const char *kFileMarkValue = "bake";
constexpr const char *kEarlier = kMicromapExtensions[1];
constexpr size_t kMostBytes = 0x7fffffff; // the limit of readWholeFile
// The alignment that Vulkan requires of the addresses of both inputs of a micromap build
// (VUID-vkCmdBuildMicromapsEXT-pInfos-07515): a buffer can be used as it was loaded.
constexpr size_t kBuildAlignment = 256;
constexpr size_t kIndexAlignment = 4;

template <typename T>
void append(std::vector<uint8_t> &bytes, const T &value)
{
    const size_t old = bytes.size();
    bytes.resize(old + sizeof value);
    std::memcpy(bytes.data() + old, &value, sizeof value);
}

void padTo(std::vector<uint8_t> &bytes, size_t alignment, uint8_t with = 0)
{
    bytes.resize(alignUp(bytes.size(), alignment), with);
}

// In hexadecimal digits: equal bytes have equal names.
std::string digest(std::span<const uint8_t> bytes)
{
    return hexadecimal(hashBytes(bytes.data(), bytes.size())).substr(2);
}

class Writer
{
public:
    Writer(const Document &document, const DocumentBake &bake, const std::string &bufferStem)
        : document_(document), bake_(bake), bufferStem_(bufferStem), root_(document.root()), edit_(document.tree())
    {
    }

    RewrittenFile write();
    // The file as it is, except for the mark.
    RewrittenFile writeMarked();
    // Returns false if the file cannot be marked, or is already.
    bool markFile();

private:
    [[nodiscard]] bool dataInChunk() const;
    void setExtension(const JsonValue &object, const std::string &text);
    void editPrimitives();
    void writeMicromap(const StoredMicromap &micromap, JsonWriter &json);
    size_t addMicromapIndices(const std::vector<int32_t> &indices, size_t records);
    std::string primitiveJson(const BakedPrimitive &primitive, size_t records);
    size_t addView(std::span<const uint8_t> bytes, size_t alignment, int target = 0);
    template <typename T>
    size_t addAccessor(const std::vector<T> &values, int target = 0);
    void appendAll(const char *name, const std::vector<std::string> &elements);
    void setUsed(bool used);
    void placeData(RewrittenFile &result);
    void assemble(RewrittenFile &result);

    const Document &document_;
    const DocumentBake &bake_;
    const std::string &bufferStem_;
    JsonValue root_;
    JsonEdit edit_;
    bool inChunk_ = false;
    size_t dataBegin_ = 0; // of data_ in its buffer
    std::vector<uint8_t> data_;
    std::vector<std::string> views_;
    std::vector<std::string> accessors_;
};

// glTF 2.0, "GLB-stored Buffer": the first buffer, without a URI, is the chunk, whose end may be padding.
bool Writer::dataInChunk() const
{
    if (!document_.binary())
        return false;
    const std::span<const uint8_t> chunks = document_.otherChunks();
    const JsonValue first = root_["buffers"].children().empty() ? JsonValue() : root_["buffers"].children()[0];
    if (!first.exists())
        return chunks.empty();
    const auto chunk = firstGlbChunk(chunks);
    if (first["uri"].exists() || !chunk || chunk->type != kGlbBinary)
        return false;
    const auto length = first["byteLength"].integer();
    return length && *length >= 0 && static_cast<uint64_t>(*length) <= chunk->data.size();
}

// `target`: of a buffer view; 0 for none.
size_t Writer::addView(std::span<const uint8_t> bytes, size_t alignment, int target)
{
    padTo(data_, alignment);
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("buffer", inChunk_ ? 0 : document_.model().buffers.size());
    json.member("byteOffset", dataBegin_ + data_.size()).member("byteLength", bytes.size());
    if (target != 0)
        json.member("target", target);
    views_.push_back(json.end().text());
    data_.insert(data_.end(), bytes.begin(), bytes.end());
    return document_.model().bufferViews.size() + views_.size() - 1;
}

template <typename T>
size_t Writer::addAccessor(const std::vector<T> &values, int target)
{
    const std::span bytes(reinterpret_cast<const uint8_t *>(values.data()), values.size() * sizeof(T));
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("bufferView", addView(bytes, kIndexAlignment, target));
    json.member("componentType", sizeof(T) == 1   ? gltf_json::kUnsignedByte
                                 : sizeof(T) == 2 ? gltf_json::kUnsignedShort
                                                  : gltf_json::kUnsignedInt);
    accessors_.push_back(json.member("count", values.size()).member("type", "SCALAR").end().text());
    return document_.model().accessors.size() + accessors_.size() - 1;
}

void Writer::writeMicromap(const StoredMicromap &micromap, JsonWriter &json)
{
    const std::span records(reinterpret_cast<const uint8_t *>(micromap.triangles.data()),
                            micromap.triangles.size() * sizeof(MicromapTriangle));
    json.beginObject().member("data", addView(micromap.data, kBuildAlignment));
    json.member("triangles", addView(records, kBuildAlignment));
    const auto list = [&](const char *name, auto member) {
        json.list(name, micromap.usage, [&](const MicromapUsage &usage) { json.value(member(usage)); });
    };
    list("usageCounts", [](const MicromapUsage &usage) { return usage.count; });
    list("usageLevels", [](const MicromapUsage &usage) { return usage.subdivisionLevel; });
    list("usageFormats", [](const MicromapUsage &usage) { return static_cast<uint32_t>(usage.format); });
    json.end();
}

// Special indices are stored in two's complement.
size_t Writer::addMicromapIndices(const std::vector<int32_t> &indices, size_t records)
{
    switch (micromapIndexBytes(records)) {
    case 1: return addAccessor(std::vector<uint8_t>(indices.begin(), indices.end()));
    case 2: return addAccessor(std::vector<uint16_t>(indices.begin(), indices.end()));
    default: return addAccessor(std::vector<uint32_t>(indices.begin(), indices.end()));
    }
}

std::string Writer::primitiveJson(const BakedPrimitive &primitive, size_t records)
{
    const size_t accessor = addMicromapIndices(primitive.micromap.indices, records);
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
            edit_.set(object, "extensions",
                      JsonWriter(JsonStyle::Compact).beginObject().key(kExtension).json(text).end().text());
        return;
    }
    if (!extensions.isObject())
        throw GltfError("the JSON has \"extensions\" that are not an object");
    const size_t micromapExtensions = extensions.count(kExtension) + extensions.count(kEarlier);
    if (text.empty() && micromapExtensions == extensions.members().size()) {
        if (micromapExtensions != 0) // an object without extensions has no "extensions"
            edit_.remove(object, "extensions");
        return;
    }
    edit_.remove(extensions, kEarlier);
    if (text.empty())
        edit_.remove(extensions, kExtension);
    else
        edit_.set(extensions, kExtension, text);
}

void Writer::editPrimitives()
{
    std::map<PrimitivePlace, const BakedPrimitive *> baked;
    for (const BakedPrimitive &primitive : bake_.primitives)
        baked[primitive.place] = &primitive;
    const std::vector<JsonValue> meshes = root_["meshes"].children();
    for (uint32_t m = 0; m < meshes.size(); ++m) {
        const std::vector<JsonValue> primitives = meshes[m]["primitives"].children();
        for (uint32_t p = 0; p < primitives.size(); ++p) {
            const auto found = baked.find({m, p});
            if (found == baked.end()) {
                setExtension(primitives[p], "");
                continue;
            }
            const BakedPrimitive &primitive = *found->second;
            if (!primitive.corners.empty()) {
                constexpr int kTarget = 34963; // ELEMENT_ARRAY_BUFFER
                const std::vector<uint32_t> &corners = primitive.corners;
                // 65535 would restart the primitive (glTF 2.0, "Overview" of meshes).
                const bool small = *std::max_element(corners.begin(), corners.end()) < 0xffff;
                const size_t accessor =
                    small ? addAccessor(std::vector<uint16_t>(corners.begin(), corners.end()), kTarget)
                          : addAccessor(corners, kTarget);
                edit_.set(primitives[p], "indices", std::to_string(accessor));
                edit_.set(primitives[p], "mode", "4");
            }
            setExtension(primitives[p],
                         primitiveJson(primitive, bake_.micromaps[primitive.micromap.micromap].triangles.size()));
        }
    }
}

void Writer::appendAll(const char *name, const std::vector<std::string> &elements)
{
    if (elements.empty())
        return;
    const JsonValue array = root_[name];
    JsonWriter all(JsonStyle::Compact);
    all.beginArray();
    for (const std::string &element : elements) {
        if (array.exists())
            edit_.append(array, element);
        else
            all.json(element);
    }
    if (!array.exists())
        edit_.set(root_, name, all.end().text());
}

void Writer::setUsed(bool used)
{
    for (const char *name : {"extensionsUsed", "extensionsRequired"}) {
        const JsonValue list = root_[name];
        if (list.exists() && !list.isArray())
            throw GltfError("\"" + std::string(name) + "\" is not an array");
        size_t theirs = 0;
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
            edit_.remove(root_, name); // it must not be empty
            continue;
        }
        if (!list.exists())
            continue;
        edit_.remove(list, kEarlier);
        if (!used)
            edit_.remove(list, kExtension);
    }
}

void Writer::placeData(RewrittenFile &result)
{
    if (data_.empty())
        return;
    const size_t length = dataBegin_ + data_.size();
    if (length > kMostBytes)
        throw GltfError("with micromaps it would be larger than 2 GiB");
    if (inChunk_ && root_["buffers"].exists() && !root_["buffers"].children().empty()) {
        edit_.set(root_["buffers"].children()[0], "byteLength", std::to_string(length));
        return;
    }
    JsonWriter buffer(JsonStyle::Compact);
    buffer.beginObject();
    if (!inChunk_ && (document_.binary() || bufferStem_.empty())) {
        buffer.member("uri", "data:application/octet-stream;base64," + base64Encoded(data_));
    } else if (!inChunk_) {
        result.bufferName = bufferStem_ + "-" + digest(data_) + ".bin";
        buffer.member("uri", encodedUri(result.bufferName));
        result.buffer.keep(std::move(data_));
    }
    appendAll("buffers", {buffer.member("byteLength", length).end().text()});
}

void Writer::assemble(RewrittenFile &result)
{
    const std::string json = edit_.apply();
    const std::string_view original = document_.tree().text();
    std::vector<uint8_t> text(json.begin(), json.end());
    if (!document_.binary()) {
        text.insert(text.end(), original.begin() + static_cast<ptrdiff_t>(root_.end()), original.end());
        result.file.keep(std::move(text));
        return;
    }
    padTo(text, 4, ' ');
    std::span<const uint8_t> rest = document_.otherChunks();
    std::span<const uint8_t> binary;
    const bool grows = inChunk_ && !data_.empty();
    if (const auto first = firstGlbChunk(rest); grows && first) {
        binary = first->data;
        rest = first->rest;
    }
    std::vector<uint8_t> between(grows ? dataBegin_ - binary.size() : 0);
    padTo(data_, 4);
    const uint64_t chunk = grows ? dataBegin_ + data_.size() : 0;
    const uint64_t total =
        kGlbHeaderBytes + kGlbChunkHeaderBytes + text.size() + (grows ? kGlbChunkHeaderBytes + chunk : 0) + rest.size();
    if (total > kMostBytes)
        throw GltfError("with micromaps it would be larger than 2 GiB");
    std::vector<uint8_t> header(document_.bytes().begin(), document_.bytes().begin() + 8);
    append(header, static_cast<uint32_t>(total));
    append(header, static_cast<uint32_t>(text.size()));
    header.insert(header.end(), document_.bytes().begin() + 16, document_.bytes().begin() + 20); // "JSON"
    result.file.keep(std::move(header));
    result.file.keep(std::move(text));
    if (grows) {
        std::vector<uint8_t> chunkHeader;
        append(chunkHeader, static_cast<uint32_t>(chunk));
        append(chunkHeader, kGlbBinary);
        result.file.keep(std::move(chunkHeader));
        result.file.add(binary);
        result.file.keep(std::move(between));
        result.file.keep(std::move(data_));
    }
    result.file.add(rest);
}

RewrittenFile Writer::write()
{
    RewrittenFile result;
    inChunk_ = dataInChunk();
    if (inChunk_) {
        const auto first = firstGlbChunk(document_.otherChunks());
        const size_t old = first ? first->data.size() : 0;
        dataBegin_ = alignUp(old, kBuildAlignment);
    }
    const bool any = !bake_.micromaps.empty();
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().list("micromaps", bake_.micromaps,
                            [&](const StoredMicromap &micromap) { writeMicromap(micromap, json); });
    json.key("extras").beginObject().member("generator", kGenerator);
    if (bake_.blendCutoff)
        json.member("blendCutoff", *bake_.blendCutoff);
    json.end();
    setExtension(root_, any ? json.end().text() : "");
    editPrimitives();
    setUsed(any);
    appendAll("bufferViews", views_);
    appendAll("accessors", accessors_);
    placeData(result);
    assemble(result);
    return result;
}

RewrittenFile Writer::writeMarked()
{
    RewrittenFile result;
    result.changed = false;
    assemble(result);
    return result;
}

bool Writer::markFile()
{
    const JsonValue asset = root_["asset"];
    const JsonValue extras = asset["extras"];
    if (extras.isObject() && asset.count("extras") == 1 && extras.count(kFileMark) == 0)
        edit_.set(extras, kFileMark, quotedJson(kFileMarkValue));
    else if (asset.isObject() && !extras.exists())
        edit_.set(asset, "extras",
                  JsonWriter(JsonStyle::Compact).beginObject().member(kFileMark, kFileMarkValue).end().text());
    else
        return false;
    return true;
}

} // namespace

bool hasMicromaps(const Document &document)
{
    return hasMicromapExtension(document.root()["extensions"]);
}

bool isOwnFile(const JsonValue &root)
{
    return root["extensions"][kExtension]["extras"]["generator"].string() == kGenerator ||
           root["asset"]["extras"][kFileMark].string() == kFileMarkValue;
}

RewrittenFile withMicromaps(const Document &document, const DocumentBake &bake, const std::string &bufferStem,
                            bool mark)
{
    return document.named([&] {
        Writer writer(document, bake, bufferStem);
        const bool marked = mark && bake.micromaps.empty() && writer.markFile();
        const bool has = document.tree().text().find("_mesh_opacity_micromap") != std::string_view::npos;
        if (!bake.micromaps.empty() || has)
            return writer.write();
        if (marked)
            return writer.writeMarked();
        RewrittenFile copy;
        copy.file.add(document.bytes());
        copy.changed = false;
        return copy;
    });
}

} // namespace vellum
