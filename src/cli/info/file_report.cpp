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

std::string typeOf(std::span<const std::uint8_t> bytes)
{
    const std::string_view text(reinterpret_cast<const char *>(bytes.data()), std::min<std::size_t>(bytes.size(), 12));
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
    explicit FileReader(const Document &document) : m_document(document), m_model(document.model()) {}

    FileReport read()
    {
        m_report.path = m_document.path();
        m_report.binary = m_document.binary();
        m_report.bytes = m_document.bytes().size();
        for (const std::string &name : m_model.extensionsUsed) {
            const bool required = std::find(m_model.extensionsRequired.begin(), m_model.extensionsRequired.end(),
                                            name) != m_model.extensionsRequired.end();
            const char *meaning = meaningOf(name);
            m_report.extensions.push_back(name + (required ? " (required)" : "") +
                                          (meaning != nullptr ? std::string(": ") + meaning : ""));
        }
        m_report.scenes = m_model.scenes.size();
        m_report.nodes = m_model.nodes.size();
        m_report.meshes = m_model.meshes.size();
        readMaterials();
        readPrimitives();
        readImages();
        readStored();
        m_report.micromapPrimitives = m_micromapPrimitives.size();
        findLeft();
        return std::move(m_report);
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
            m_report.problems.push_back({place, m_document.reasonOf(error)});
        } catch (const BakeError &error) {
            m_report.problems.push_back({place, error.what()});
        }
        return false;
    }

    void readMaterials();
    void readPrimitives();
    void readImages();
    void readStored();
    void findLeft();

    const Document &m_document;
    const gltf_json::Model &m_model;
    std::vector<bool> m_masked;                    // by material
    std::set<PrimitivePlace> m_micromapPrimitives; // those that have one
    FileReport m_report;
};

void FileReader::readMaterials()
{
    static const char *const kModes[] = {"OPAQUE", "MASK", "BLEND"};
    for (std::size_t i = 0; i < m_model.materials.size(); ++i) {
        m_masked.push_back(m_model.materials[i].alphaMode == "MASK");
        attempt("material " + std::to_string(i), [&] {
            const Material material = readMaterial(m_document, static_cast<int>(i));
            m_report.materials[kModes[static_cast<std::size_t>(material.alphaMode)]].push_back(material.name);
        });
    }
}

void FileReader::readPrimitives()
{
    for (const PrimitivePlace place : trianglePrimitives(m_document)) {
        ++m_report.primitives;
        const std::string name = m_document.nameOf(place);
        try {
            const Primitive primitive = readPrimitive(m_document, place, Positions::Leave);
            const std::size_t triangles = primitive.triangleCount();
            m_report.triangles += triangles;
            if (static_cast<std::size_t>(primitive.material) < m_masked.size() &&
                m_masked[static_cast<std::size_t>(primitive.material)])
                m_report.maskedTriangles += triangles;
        } catch (const GltfError &error) {
            m_report.problems.push_back({name, m_document.reasonOf(place, error)});
        }
    }
}

void FileReader::readImages()
{
    for (std::size_t i = 0; i < m_model.images.size(); ++i) {
        FileReport::Image &image = m_report.images.emplace_back();
        try {
            const EncodedImage encoded = readEncodedImage(m_document, static_cast<int>(i));
            image.bytes = encoded.bytes().size();
            image.type = typeOf(encoded.bytes());
            const vellum::Image decoded = readImage(m_document, static_cast<int>(i));
            image.width = decoded.width;
            image.height = decoded.height;
        } catch (const GltfError &error) {
            image.problem = m_document.reasonOf(error);
        }
    }
}

std::string contentsOf(const StoredMicromap &micromap)
{
    std::map<std::pair<unsigned, unsigned>, std::size_t> counts; // by level and states
    for (const MicromapTriangle &t : micromap.triangles)
        ++counts[{t.subdivisionLevel, t.format == Format::TwoState ? 2 : 4}];
    std::string text;
    for (const auto &[key, count] : counts)
        text += fmt::format("{}{} of level {} with {} states", text.empty() ? "" : ", ", count, key.first, key.second);
    return text;
}

void FileReader::readStored()
{
    for (const MicromapOffence &offence : findMicromapOffences(m_document))
        m_report.offences.push_back({offence.place, offence.message});
    if (!m_report.offences.empty())
        return;
    attempt("micromaps", [&] {
        const StoredMicromaps stored = readMicromaps(m_document);
        m_report.micromapExtension = stored.extension;
        for (const auto &[place, micromap] : stored.primitives)
            m_micromapPrimitives.insert(place);
        for (const StoredMicromap &micromap : stored.micromaps)
            m_report.micromaps.push_back({micromap.triangles.size(), micromap.data.size(), contentsOf(micromap)});
    });
}

// By the baker itself, at the level that takes next to no time.
void FileReader::findLeft()
{
    attempt("bake", [&] {
        DocumentBakeOptions options;
        options.bake.level = 0;
        for (const LeftPrimitive &left : bakeDocument(m_document, options).left)
            if (!m_micromapPrimitives.contains(left.place))
                m_report.left.push_back({m_document.nameOf(left.place), left.reason});
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
    constexpr std::size_t kMost = 20;
    for (std::size_t i = 0; i < std::min(reasons.size(), kMost); ++i)
        fmt::print("{:<11} {}: {}\n", what, reasons[i].place, reasons[i].text);
    if (reasons.size() > kMost)
        fmt::print("            and {} more\n", reasons.size() - kMost);
}

std::string joined(const std::vector<std::string> &names)
{
    constexpr std::size_t kMost = 8;
    std::string text;
    for (std::size_t i = 0; i < std::min(names.size(), kMost); ++i)
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
    for (std::size_t i = 0; i < r.extensions.size(); ++i)
        fmt::print("{:<11} {}\n", i == 0 ? "extensions" : "", r.extensions[i]);
    fmt::print("scene       {}, {} with {} of triangles\n", counted(r.nodes, "node"),
               counted(r.meshes, "mesh", "meshes"), counted(r.primitives, "primitive"));
    fmt::print("triangles   {}, of which {} {} alpha-masked\n", grouped(r.triangles), grouped(r.maskedTriangles),
               r.maskedTriangles == 1 ? "is" : "are");
    for (const auto &[mode, names] : r.materials)
        fmt::print("materials   {} {}: {}\n", names.size(), mode, joined(names));
    for (std::size_t i = 0; i < r.images.size(); ++i) {
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
    for (std::size_t i = 0; i < r.micromaps.size(); ++i)
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
            .member("width", std::uint64_t{image.width})
            .member("height", std::uint64_t{image.height})
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
