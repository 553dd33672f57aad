// SPDX-License-Identifier: Apache-2.0
#include "cli/info/file_report.h"

#include <algorithm>
#include <fmt/format.h>
#include <set>

#include "base/text.h"
#include "core/utf8_path.h"
#include "gltf/alpha_textures.h"
#include "gltf/data/image.h"
#include "gltf/micromaps/document_bake.h"
#include "gltf/primitive.h"

namespace vellum::cli
{
namespace
{

// The purpose of an extension; null if it does not matter here.
const char *meaningOf(const std::string &extension)
{
    static const std::map<std::string, const char *> meanings = {
        {kMicromapExtensions[0], "micromaps"},
        {kMicromapExtensions[1], "micromaps, by an earlier name"},
        {"KHR_texture_transform", "moves texture coordinates"},
        {"EXT_mesh_gpu_instancing", "instances of meshes"},
        {"KHR_mesh_quantization", "small integers as coordinates"},
        {"EXT_meshopt_compression", "compressed triangles"},
        {"KHR_meshopt_compression", "compressed triangles"},
        {"KHR_draco_mesh_compression", "compressed triangles"},
        {"EXT_texture_webp", "WebP images"},
        {"EXT_texture_avif", "AVIF images"},
        {"KHR_texture_basisu", "KTX2 images"},
    };
    const auto found = meanings.find(extension);
    return found == meanings.end() ? nullptr : found->second;
}

std::string typeOf(std::span<const uint8_t> bytes)
{
    const std::string_view text(reinterpret_cast<const char *>(bytes.data()), std::min<size_t>(bytes.size(), 12));
    if (text.starts_with("\x89PNG"))
        return "PNG";
    if (text.starts_with("\xff\xd8\xff"))
        return "JPEG";
    if (text.starts_with("RIFF") && text.ends_with("WEBP"))
        return "WebP";
    if (text.starts_with("\xabKTX 20"))
        return "KTX2";
    if (isAvif(bytes))
        return "AVIF";
    return "unknown";
}

class FileReader
{
public:
    explicit FileReader(const Document &document) : document_(document), model_(document.model()) {}

    FileReport read()
    {
        report_.path = document_.path();
        report_.binary = document_.binary();
        report_.bytes = document_.bytes().size();
        for (const std::string &name : model_.extensionsUsed)
            report_.extensions.push_back({name, model_.extensionsRequired.contains(name)});
        report_.scenes = model_.scenes.size();
        report_.nodes = model_.nodes.size();
        report_.meshes = model_.meshes.size();
        readMaterials();
        readPrimitives();
        readImages();
        readStored();
        report_.micromapPrimitives = micromapPrimitives_.size();
        findSkipped();
        return std::move(report_);
    }

private:
    // Runs it; what it throws becomes a problem of `place`.
    template <typename Read>
    bool attempt(const std::string &place, Read &&read)
    {
        try {
            read();
            return true;
        } catch (const GltfError &error) {
            report_.problems.push_back({place, document_.reasonOf(error)});
        } catch (const BakeError &error) {
            report_.problems.push_back({place, error.what()});
        }
        return false;
    }

    void readMaterials();
    void readPrimitives();
    void readImages();
    void readStored();
    void findSkipped();

    const Document &document_;
    const gltf_json::Model &model_;
    std::vector<bool> masked_;                    // by material
    std::set<PrimitivePlace> micromapPrimitives_; // primitives with micromaps
    FileReport report_;
};

void FileReader::readMaterials()
{
    static const char *const kModes[] = {"OPAQUE", "MASK", "BLEND"};
    for (size_t i = 0; i < model_.materials.size(); ++i) {
        masked_.push_back(model_.materials[i].alphaMode == "MASK");
        attempt("material " + std::to_string(i), [&] {
            const Material material = readMaterial(document_, static_cast<int>(i));
            report_.materials[kModes[static_cast<size_t>(material.alphaMode)]].push_back(material.name);
        });
    }
}

void FileReader::readPrimitives()
{
    for (const PrimitivePlace place : trianglePrimitives(document_)) {
        ++report_.primitives;
        const std::string name = document_.nameOf(place);
        try {
            const Primitive primitive = readPrimitive(document_, place, Positions::Skip);
            const size_t triangles = primitive.triangleCount();
            report_.triangles += triangles;
            if (static_cast<size_t>(primitive.material) < masked_.size() &&
                masked_[static_cast<size_t>(primitive.material)])
                report_.maskedTriangles += triangles;
        } catch (const GltfError &error) {
            report_.problems.push_back({name, document_.reasonOf(place, error)});
        }
    }
}

void FileReader::readImages()
{
    ImageDecoder decoder(document_);
    for (size_t i = 0; i < model_.images.size(); ++i) {
        FileReport::Image &image = report_.images.emplace_back();
        try {
            const EncodedImage encoded = readEncodedImage(document_, static_cast<int>(i));
            image.bytes = encoded.bytes().size();
            image.type = typeOf(encoded.bytes());
            const vellum::Image decoded = decoder.decode(static_cast<int>(i), encoded);
            image.width = decoded.width;
            image.height = decoded.height;
        } catch (const GltfError &error) {
            image.problem = document_.reasonOf(error);
        }
    }
}

std::string levelsOf(const MicromapSummary &micromap)
{
    std::string text;
    for (const auto &[key, count] : micromap.levels)
        text += fmt::format("{}{} of level {} with {} states", text.empty() ? "" : ", ", count, key.first, key.second);
    return text;
}

void FileReader::readStored()
{
    auto [stored, findings] = checkMicromaps(document_);
    report_.findings = std::move(findings);
    if (!report_.findings.empty())
        return;
    report_.micromapExtension = stored.extension;
    for (const auto &[place, micromap] : stored.primitives)
        micromapPrimitives_.insert(place);
    report_.micromaps = summariesOf(stored.micromaps);
}

// Finds them by a bake at the fastest level.
void FileReader::findSkipped()
{
    attempt("bake", [&] {
        DocumentBakeOptions options;
        options.bake.level = 0;
        for (SkippedPrimitive &skipped : bakeDocument(document_, options).skipped)
            if (!micromapPrimitives_.contains(skipped.place))
                report_.skipped.push_back(std::move(skipped));
    });
}

void write(const char *kind, const std::vector<MicromapFinding> &findings, JsonWriter &json)
{
    for (const MicromapFinding &finding : findings)
        writeFinding(kind, finding.place, finding.message, json);
}

void print(const char *what, const std::vector<std::string> &lines, size_t most)
{
    for (size_t i = 0; i < std::min(lines.size(), most); ++i)
        fmt::print("{:<11} {}\n", what, lines[i]);
    if (lines.size() > most)
        fmt::print("            and {} more (--verbose lists all)\n", lines.size() - most);
}

template <typename Element, typename Describe>
std::vector<std::string> linesOf(const std::vector<Element> &elements, Describe &&text)
{
    std::vector<std::string> lines;
    for (const Element &element : elements)
        lines.push_back(text(element));
    return lines;
}

std::string joined(const std::vector<std::string> &names, size_t most)
{
    std::string text;
    for (size_t i = 0; i < std::min(names.size(), most); ++i)
        text += (i == 0 ? "" : ", ") + names[i];
    return names.size() > most ? fmt::format("{} and {} more", text, names.size() - most) : text;
}

} // namespace

FileReport reportFile(const Document &document)
{
    return document.named([&] { return FileReader(document).read(); });
}

void print(const FileReport &r, bool verbose)
{
    const auto most = [verbose](size_t count) { return verbose ? ~size_t{0} : count; };
    fmt::print("file        {}: {}, {}\n", utf8Text(r.path), r.binary ? "GLB" : "glTF text", counted(r.bytes, "byte"));
    for (size_t i = 0; i < r.extensions.size(); ++i) {
        const auto &[name, required] = r.extensions[i];
        const char *meaning = meaningOf(name);
        fmt::print("{:<11} {}{}{}{}\n", i == 0 ? "extensions" : "", name, required ? " (required)" : "",
                   meaning != nullptr ? ": " : "", meaning != nullptr ? meaning : "");
    }
    fmt::print("scene       {}, {} with {} of triangles\n", counted(r.nodes, "node"),
               counted(r.meshes, "mesh", "meshes"), counted(r.primitives, "primitive"));
    fmt::print("triangles   {}, of which {} {} alpha-masked\n", grouped(r.triangles), grouped(r.maskedTriangles),
               r.maskedTriangles == 1 ? "is" : "are");
    for (const auto &[mode, names] : r.materials)
        fmt::print("materials   {} {}: {}\n", names.size(), mode, joined(names, most(8)));
    for (size_t i = 0; i < r.images.size(); ++i) {
        const FileReport::Image &image = r.images[i];
        if (image.problem.empty())
            fmt::print("image {:<5} {} x {}, {}, {}\n", i, image.width, image.height, image.type,
                       counted(image.bytes, "byte"));
        else
            fmt::print("image {:<5} {}\n", i, image.problem);
    }
    if (r.micromapExtension.empty())
        fmt::print("micromaps   {}\n", r.findings.empty() ? "none" : "invalid:");
    else
        fmt::print("micromaps   {} by {}, on {}\n            ({})\n", r.micromaps.size(), r.micromapExtension,
                   counted(r.micromapPrimitives, "primitive"), kMicromapDraft);
    for (size_t i = 0; i < r.micromaps.size(); ++i)
        fmt::print("micromap {:<2} {}: {}; {}\n", i, counted(r.micromaps[i].triangles, "triangle"),
                   levelsOf(r.micromaps[i]), counted(r.micromaps[i].bytes, "byte"));
    const auto finding = [](const MicromapFinding &f) { return f.place + ": " + f.message; };
    print("invalid", linesOf(r.findings, finding), most(20));
    print("unreadable", linesOf(r.problems, finding), most(20));
    print("skipped", linesOf(r.skipped, [](const SkippedPrimitive &s) { return describe(s); }), most(20));
}

void write(const FileReport &r, JsonWriter &json)
{
    json.beginObject().member("file", utf8Text(r.path)).member("binary", r.binary).member("bytes", r.bytes);
    json.list("extensions", r.extensions, [&](const FileReport::Extension &extension) {
        json.beginObject().member("name", extension.name).member("required", extension.required).end();
    });
    json.member("scenes", r.scenes).member("nodes", r.nodes).member("meshes", r.meshes);
    json.member("primitives", r.primitives).member("triangles", r.triangles);
    json.member("maskedTriangles", r.maskedTriangles);
    json.key("materials").beginObject();
    for (const auto &[mode, names] : r.materials)
        json.values(mode, names);
    json.end().list("images", r.images, [&](const FileReport::Image &image) {
        json.beginObject().member("width", image.width).member("height", image.height);
        json.member("type", image.type).member("bytes", image.bytes);
        if (!image.problem.empty())
            json.member("error", image.problem);
        json.end();
    });
    json.member("extension", r.micromapExtension).member("micromapPrimitives", r.micromapPrimitives);
    writeMicromaps(r.micromaps, json);
    json.key("findings").beginArray();
    write("structure", r.findings, json);
    write("unreadable", r.problems, json);
    json.end();
    writeSkipped(r.skipped, json);
    json.end();
}

} // namespace vellum::cli
