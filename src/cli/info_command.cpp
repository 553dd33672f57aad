// SPDX-License-Identifier: Apache-2.0
// `vellum info`
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/json_writer.h"
#include "base/text.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/info/loader_report.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "core/utf8_path.h"
#include "gltf/alpha_textures.h"
#include "gltf/data/image.h"
#include "gltf/file/gltf_error.h"
#include "gltf/micromaps/document_bake.h"
#include "gltf/primitive.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kInfoDetails = R"(
Without a file: the Vulkan loader, where the layer is and how to enable it, and for each device its driver, its ray tracing
features and what provides micromaps. Run this first if something does not work: each reason why there are no micromaps
is a line on stderr.

With files: their contents, their micromaps, and the alpha-tested primitives that vellum bake would skip, with the reasons.
Folders are searched recursively.

Examples:
  vellum info
      is there a device with micromaps, and how is the layer enabled?
  vellum info tree.glb
      what vellum bake will find in it
  vellum info --json tree.omm.glb | jq '.files[0].micromaps'
      for a script

Environment:
  VK_DRIVER_FILES, VK_ADD_DRIVER_FILES, VK_LAYER_PATH, VK_ADD_LAYER_PATH, VK_INSTANCE_LAYERS
      the Vulkan loader's: which drivers and layers it uses
)";

struct FileReport {
    struct Image {
        uint64_t bytes = 0; // encoded
        uint32_t width = 0; // 0 if it cannot be read; see `problem`
        uint32_t height = 0;
        std::string type;
        std::string problem;
    };
    struct Extension {
        std::string name;
        bool required = false;
    };

    std::filesystem::path path;
    bool binary = false;
    uint64_t bytes = 0;
    std::vector<Extension> extensions; // used by the file
    uint64_t scenes = 0, nodes = 0, meshes = 0, primitives = 0, triangles = 0, maskedTriangles = 0;
    std::map<std::string, std::vector<std::string>> materials; // names by alphaMode
    std::vector<Image> images;
    std::string micromapExtension; // empty if it has none
    std::vector<MicromapSummary> micromaps;
    uint64_t micromapPrimitives = 0;
    std::vector<SkippedPrimitive> skipped; // alpha-tested primitives that vellum bake would skip
    std::vector<MicromapFinding> findings; // against the rules of the micromaps' extension
    std::vector<MicromapFinding> problems; // parts that cannot be read
};

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
        report_.bytes = document_.fileBytes();
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

FileReport reportFile(const Document &document)
{
    return document.named([&] { return FileReader(document).read(); });
}

// Without `verbose`, long lists are truncated.
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

struct InfoOptions {
    std::vector<std::filesystem::path> files;
    bool json = false;
    bool verbose = false;
    bool quiet = false;
    std::optional<std::filesystem::path> layerFolder;
};

ExitCode infoOnLoader(const InfoOptions &options)
{
    const LoaderReport report = reportLoader(options.layerFolder);
    if (options.json) {
        JsonWriter json;
        beginReport(json, "info");
        write(report, json.key("machine"));
        std::printf("%s\n", json.end().text().c_str());
    } else {
        print(report);
    }
    std::fflush(stdout);
    for (const std::string &problem : report.problems)
        std::fprintf(stderr, "vellum: %s\n", problem.c_str());
    return report.problems.empty() ? ExitCode::Success : ExitCode::Failed;
}

// Throws GltfError.
ExitCode infoOnFile(const InfoOptions &options, const std::filesystem::path &file, JsonWriter &json)
{
    const FileReport report = withinMemory(file, [&] { return reportFile(openDocument(file)); });
    if (options.json)
        write(report, json);
    else
        print(report, options.verbose);
    const ExitCode invalid = report.findings.empty() ? ExitCode::Success : ExitCode::InvalidMicromaps;
    return worse(invalid, report.problems.empty() ? ExitCode::Success : ExitCode::Failed);
}

ExitCode infoOnFiles(const InfoOptions &options)
{
    const std::vector<std::filesystem::path> files = gltfFiles(options.files);
    auto code = ExitCode::Success;
    JsonWriter json;
    beginReport(json, "info");
    json.key("files").beginArray();
    for (size_t i = 0; i < files.size(); ++i) {
        try {
            code = worse(code, infoOnFile(options, files[i], json));
        } catch (const GltfError &error) {
            code = worse(code, ExitCode::Failed);
            if (options.json)
                json.beginObject().member("file", utf8Text(files[i])).member("error", error.what()).end();
            std::fflush(stdout);
            std::fprintf(stderr, "vellum: %s\n", error.what());
        }
        if (!options.json && i + 1 < files.size())
            std::printf("\n");
    }
    if (options.json)
        std::printf("%s\n", json.end().end().text().c_str());
    return code;
}

} // namespace

std::function<int()> declareInfoCommand(CLI::App &app)
{
    const auto options = std::make_shared<InfoOptions>();
    CLI::App &command = *app.add_subcommand("info", "Reports what devices and glTF files have, and what is missing");
    command.footer(kInfoDetails);
    command
        .add_option("FILE", options->files, "glTF files (.glb, .gltf) or folders of them; without one, this machine")
        ->type_name("[FILE]...")
        ->group(kInput);
    command.option_defaults()->group(kOutput);
    command.add_flag("-v,--verbose", options->verbose, "Do not cut off long lists");
    command.add_flag("--json", options->json, "Print JSON");
    command.option_defaults()->group(kDevice);
    addLayerPathOption(command, options->layerFolder);
    command.add_flag("-q,--quiet", options->quiet, "Print errors only")->group(kGeneral);
    return [options] {
        if (options->quiet && !options->json)
            discardReports();
        return static_cast<int>(options->files.empty() ? infoOnLoader(*options) : infoOnFiles(*options));
    };
}

} // namespace vellum::cli
