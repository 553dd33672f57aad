#include "cli/info/file_report.h"

#include <algorithm>
#include <fmt/format.h>
#include <set>

#include "cli/base/numbers.h"
#include "gltf/data/image.h"
#include "gltf/micromaps/document_bake.h"
#include "gltf/primitive.h"

namespace vellum::cli
{
namespace
{

// What is of use here, and for what.
const char *meaningOf(const std::string &extension)
{
    static const std::map<std::string, const char *> meanings = {
        {"EXT_mesh_opacity_micromap", "micromaps"},
        {"KHR_mesh_opacity_micromap", "micromaps, by an earlier name"},
        {"KHR_texture_transform", "moves texture coordinates"},
        {"EXT_mesh_gpu_instancing", "instances of meshes"},
        {"KHR_mesh_quantization", "small integers as coordinates"},
        {"EXT_meshopt_compression", "compressed triangles"},
        {"KHR_meshopt_compression", "compressed triangles"},
        {"KHR_draco_mesh_compression", "compressed triangles"},
        {"EXT_texture_webp", "WebP images"},
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
        for (const std::string &name : model_.extensionsUsed) {
            const bool required = std::find(model_.extensionsRequired.begin(), model_.extensionsRequired.end(), name) !=
                                  model_.extensionsRequired.end();
            const char *meaning = meaningOf(name);
            report_.extensions.push_back(name + (required ? " (required)" : "") +
                                         (meaning != nullptr ? std::string(": ") + meaning : ""));
        }
        report_.scenes = model_.scenes.size();
        report_.nodes = model_.nodes.size();
        report_.meshes = model_.meshes.size();
        readMaterials();
        readPrimitives();
        readImages();
        readStored();
        report_.micromapPrimitives = micromapPrimitives_.size();
        findLeft();
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
    void findLeft();

    const Document &document_;
    const gltf_json::Model &model_;
    std::vector<bool> masked_;                    // by material
    std::set<PrimitivePlace> micromapPrimitives_; // those that have one
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
            const Primitive primitive = readPrimitive(document_, place, Positions::Leave);
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
    for (size_t i = 0; i < model_.images.size(); ++i) {
        FileReport::Image &image = report_.images.emplace_back();
        try {
            const EncodedImage encoded = readEncodedImage(document_, static_cast<int>(i));
            image.bytes = encoded.bytes().size();
            image.type = typeOf(encoded.bytes());
            const vellum::Image decoded = readImage(document_, static_cast<int>(i));
            image.width = decoded.width;
            image.height = decoded.height;
        } catch (const GltfError &error) {
            image.problem = document_.reasonOf(error);
        }
    }
}

std::string contentsOf(const StoredMicromap &micromap)
{
    std::map<std::pair<unsigned, unsigned>, size_t> counts; // by level and states
    for (const MicromapTriangle &t : micromap.triangles)
        ++counts[{t.subdivisionLevel, t.format == Format::TwoState ? 2 : 4}];
    std::string text;
    for (const auto &[key, count] : counts)
        text += fmt::format("{}{} of level {} with {} states", text.empty() ? "" : ", ", count, key.first, key.second);
    return text;
}

void FileReader::readStored()
{
    for (const MicromapOffence &offence : findMicromapOffences(document_))
        report_.offences.push_back({offence.place, offence.message});
    if (!report_.offences.empty())
        return;
    attempt("micromaps", [&] {
        const StoredMicromaps stored = readMicromaps(document_);
        report_.micromapExtension = stored.extension;
        for (const auto &[place, micromap] : stored.primitives)
            micromapPrimitives_.insert(place);
        for (const StoredMicromap &micromap : stored.micromaps)
            report_.micromaps.push_back({micromap.triangles.size(), micromap.data.size(), contentsOf(micromap)});
    });
}

// By the baker itself, at the level that takes next to no time.
void FileReader::findLeft()
{
    attempt("bake", [&] {
        DocumentBakeOptions options;
        options.bake.level = 0;
        for (const LeftPrimitive &left : bakeDocument(document_, options).left)
            if (!micromapPrimitives_.contains(left.place))
                report_.left.push_back({document_.nameOf(left.place), left.reason});
    });
}

void write(const std::vector<FileReport::Reason> &reasons, JsonWriter &json)
{
    json.beginArray();
    for (const FileReport::Reason &reason : reasons)
        json.beginObject().member("place", reason.place).member("reason", reason.text).end();
    json.end();
}

void print(const char *what, const std::vector<FileReport::Reason> &reasons)
{
    constexpr size_t kMost = 20;
    for (size_t i = 0; i < std::min(reasons.size(), kMost); ++i)
        fmt::print("{:<11} {}: {}\n", what, reasons[i].place, reasons[i].text);
    if (reasons.size() > kMost)
        fmt::print("            and {} more\n", reasons.size() - kMost);
}

std::string joined(const std::vector<std::string> &names)
{
    constexpr size_t kMost = 8;
    std::string text;
    for (size_t i = 0; i < std::min(names.size(), kMost); ++i)
        text += (i == 0 ? "" : ", ") + names[i];
    return names.size() > kMost ? fmt::format("{} and {} more", text, names.size() - kMost) : text;
}

} // namespace

FileReport reportFile(const std::filesystem::path &path)
{
    const Document document(path);
    return document.named([&] { return FileReader(document).read(); });
}

void print(const FileReport &r)
{
    fmt::print("file        {}: {}, {}\n", r.path.string(), r.binary ? "GLB" : "glTF text", counted(r.bytes, "byte"));
    for (size_t i = 0; i < r.extensions.size(); ++i)
        fmt::print("{:<11} {}\n", i == 0 ? "extensions" : "", r.extensions[i]);
    fmt::print("scene       {}, {} with {} of triangles\n", counted(r.nodes, "node"),
               counted(r.meshes, "mesh", "meshes"), counted(r.primitives, "primitive"));
    fmt::print("triangles   {}, of which {} {} alpha-masked\n", grouped(r.triangles), grouped(r.maskedTriangles),
               r.maskedTriangles == 1 ? "is" : "are");
    for (const auto &[mode, names] : r.materials)
        fmt::print("materials   {} {}: {}\n", names.size(), mode, joined(names));
    for (size_t i = 0; i < r.images.size(); ++i) {
        const FileReport::Image &image = r.images[i];
        if (image.problem.empty())
            fmt::print("image {:<5} {} x {}, {}, {}\n", i, image.width, image.height, image.type,
                       counted(image.bytes, "byte"));
        else
            fmt::print("image {:<5} {}\n", i, image.problem);
    }
    if (r.micromapExtension.empty())
        fmt::print("micromaps   {}\n", r.offences.empty() ? "none" : "wrong ones:");
    else
        fmt::print("micromaps   {} by {}, on {}\n", r.micromaps.size(), r.micromapExtension,
                   counted(r.micromapPrimitives, "primitive"));
    for (size_t i = 0; i < r.micromaps.size(); ++i)
        fmt::print("micromap {:<2} {}: {}; {} of data\n", i, counted(r.micromaps[i].triangles, "triangle"),
                   r.micromaps[i].contents, counted(r.micromaps[i].dataBytes, "byte"));
    print("wrong", r.offences);
    print("unreadable", r.problems);
    print("left out", r.left);
}

void write(const FileReport &r, JsonWriter &json)
{
    json.beginObject().member("file", r.path.string()).member("binary", r.binary).member("bytes", r.bytes);
    json.key("extensions").beginArray();
    for (const std::string &extension : r.extensions)
        json.value(extension);
    json.end();
    json.member("scenes", r.scenes).member("nodes", r.nodes).member("meshes", r.meshes);
    json.member("primitives", r.primitives).member("triangles", r.triangles);
    json.member("maskedTriangles", r.maskedTriangles);
    json.key("materials").beginObject();
    for (const auto &[mode, names] : r.materials) {
        json.key(mode).beginArray();
        for (const std::string &name : names)
            json.value(name);
        json.end();
    }
    json.end().key("images").beginArray();
    for (const FileReport::Image &image : r.images)
        json.beginObject()
            .member("width", uint64_t{image.width})
            .member("height", uint64_t{image.height})
            .member("type", image.type)
            .member("bytes", image.bytes)
            .member("problem", image.problem)
            .end();
    json.end().member("micromapExtension", r.micromapExtension);
    json.member("micromapPrimitives", r.micromapPrimitives).key("micromaps").beginArray();
    for (const FileReport::Micromap &micromap : r.micromaps)
        json.beginObject()
            .member("triangles", micromap.triangles)
            .member("dataBytes", micromap.dataBytes)
            .member("contents", micromap.contents)
            .end();
    json.end().key("wrong");
    write(r.offences, json);
    json.key("unreadable");
    write(r.problems, json);
    json.key("leftOutByBake");
    write(r.left, json);
    json.end();
}

} // namespace vellum::cli
