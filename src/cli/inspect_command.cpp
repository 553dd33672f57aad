// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <fmt/format.h>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/picture.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/bake/bake.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "core/utf8_path.h"
#include "inspect/comparison.h"
#include "inspect/inspected_file.h"
#include "inspect/page.h"
#include "inspect/report_parts.h"
#include "inspect/uv_picture.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kInspectDetails = R"(
Draws the state of each micro-triangle over the texture that it was baked from, in the colours of render --mode states. The
page is one file that needs and loads nothing else. It has numbers and charts, the UV space of each material to zoom and
pan in, the triangles that are worth a look, and a picture of each mesh.

Without OUT, NAME.html is written beside the input. An existing file is replaced only if vellum wrote it, or with --force.

Two files are compared: bytes, levels and the share of the alpha-tested surface that is known, in all, by material and by
mesh. Both are matched by name. No page is written then unless -o or --html names one.

Examples:
  vellum inspect ash.omm.glb
      writes the page ash.omm.html
  vellum inspect ash.omm.glb ash.svg
      the whole UV space of each material as a picture
  vellum inspect ash.omm.glb --picture leaf.svg --mesh 0 --primitive 1 --triangle 40-47
      eight triangles, and the texture around them
  vellum inspect ash.glb --bake --level 5
      what vellum bake would make of a file with these options
  vellum inspect level5.glb level7.glb -o difference.html
      compares two bakes, and writes a page
)";

struct InspectOptions {
    std::filesystem::path input;
    std::optional<std::filesystem::path> second;  // to compare with
    std::optional<std::filesystem::path> operand; // OUT
    std::optional<std::filesystem::path> output;  // -o
    std::optional<std::filesystem::path> html;
    std::optional<std::filesystem::path> picture;
    inspect::UvPictureOptions drawing;
    inspect::Selection selection;
    bool bake = false;
    bool force = false;
    bool json = false;
    bool quiet = false;
    DocumentBakeOptions baking;
    bool noOutlines = false;
};

void declareOutputs(CLI::App &command, InspectOptions &options)
{
    command.option_defaults()->group(kOutput);
    command
        .add_option(
            "-o,--output", options.output,
            "The page to write, or the picture if it ends in .svg or .png; a folder, or - for the page to stdout "
            "[NAME.html beside the input]")
        ->type_name("OUT");
    command.add_option("--html", options.html, "The page to write, or -")->type_name("FILE");
    command
        .add_option(
            "--picture", options.picture,
            "The SVG to write, or a PNG, which has no names and numbers, or - for the PNG; no page then, unless --html "
            "is given")
        ->type_name("FILE");
    command.add_flag("--force", options.force, "Replace existing files, whoever wrote them");
    command.add_option("--size", options.drawing.edge, "Longer side of each material in the picture, in pixels [1024]")
        ->check(wholeBetween(64, 8192))
        ->type_name("PIXELS");
    command.add_flag("--no-outlines", options.noOutlines, "No outlines of triangles in the picture");
    command.add_flag("--json", options.json, "Print the numbers as JSON");
    command.add_flag("-q,--quiet", options.quiet, "Print errors only")->group(kGeneral);
}

std::function<void()> declareInspect(CLI::App &command, InspectOptions &options)
{
    command.footer(kInspectDetails);
    command.option_defaults()->group(kInput);
    command.add_option("IN", options.input, "A .glb or .gltf file")->type_name("IN")->required();
    command.add_option("OUT", options.operand, "The same as -o OUT; or a second .glb or .gltf file to compare with")
        ->type_name("[OUT]");
    declareOutputs(command, options);
    command.option_defaults()->group(kSelection);
    inspect::Selection &selection = options.selection;
    const auto addRanges = [&](const char *name, std::vector<inspect::NumberRange> &ranges, const char *description) {
        command
            .add_option_function<std::string>(
                name, [name, &ranges](const std::string &text) { ranges = inspect::parseRanges(text, name); },
                description)
            ->type_name("NUMBERS");
    };
    addRanges("--mesh", selection.meshes, "Only these meshes: 2, 0-4, or several with commas");
    addRanges("--primitive", selection.primitives, "Only these primitives of each mesh");
    addRanges("--triangle", selection.triangles, "Only these triangles of each primitive");
    command.add_option("--material", selection.materials, "Only this material, by name or number; repeatable")
        ->allow_extra_args(false)
        ->type_name("NAME");
    CLI::Option &bake = *command
                             .add_flag("--bake", options.bake,
                                       "Bake in memory, with the options of vellum bake, which are listed here as well")
                             ->group(kInput);
    const std::vector<CLI::Option *> own = command.get_options();
    std::function<void()> finish = declareBaking(command, options.baking);
    for (CLI::Option *option : command.get_options())
        if (std::find(own.begin(), own.end(), option) == own.end())
            option->needs(&bake);
    return finish;
}

void printShares(const inspect::Tally &tally)
{
    const auto &s = tally.states;
    fmt::print("states      {} transparent, {} opaque, {} unknown, of triangles, each counted alike\n", percent(s[0]),
               percent(s[1]), percent(s[2] + s[3]));
}

void printFile(const inspect::InspectedFile &file)
{
    const inspect::Tally tally = inspect::tallyOf(file);
    fmt::print("file        {}: {}, {}\n", file.name, counted(file.bytes, "byte"),
               file.baked ? "baked in memory" : file.stored.extension);
    if (file.surface)
        fmt::print("surface     {}\n", describe(*file.surface));
    fmt::print("micromaps   {} of {}: {}, {} with a special index\n", file.primitives.size(),
               counted(file.primitiveCount, "primitive"), counted(tally.triangles, "triangle"),
               grouped(tally.special[0] + tally.special[1] + tally.special[2] + tally.special[3]));
    std::string levels;
    for (size_t level = 0; level < tally.levels.size(); ++level)
        if (const uint64_t count = tally.levels[level][0] + tally.levels[level][1]; count != 0)
            levels += fmt::format("{}{}: {}", levels.empty() ? "" : ", ", level, grouped(count));
    fmt::print("levels      {}\n", levels.empty() ? "none" : levels);
    printShares(tally);
    fmt::print("bytes       {} of states, {} of triangles, {} of indices\n", grouped(tally.dataBytes),
               grouped(tally.recordsUsed * sizeof(MicromapTriangle)), grouped(tally.indexBytes));
    for (const SkippedPrimitive &skipped : file.skipped)
        fmt::print("skipped     {}\n", describe(skipped));
    for (const inspect::InspectedMaterial &material : file.materials)
        if (!material.problem.empty())
            fmt::print("warning     shown without the texture: {}\n", material.problem);
}

void write(const InspectOptions &options, const std::filesystem::path &input, const inspect::InspectedFile &file,
           JsonWriter &json)
{
    const inspect::Tally tally = inspect::tallyOf(file);
    json.beginObject().member("file", utf8Text(input)).member("bytes", file.bytes);
    json.member("baked", file.baked).member("extension", file.stored.extension);
    json.key("outputs").beginArray();
    for (const auto &path : {options.picture, options.html})
        if (path)
            json.value(utf8Text(*path));
    json.end();
    writeSurface(file.surface, json);
    writeMicromaps(summariesOf(file.stored.micromaps), json);
    json.member("primitiveCount", file.primitiveCount).member("micromapPrimitives", file.primitives.size());
    json.member("triangles", tally.triangles);
    writeStates("special", tally.special, json);
    json.key("levels").beginObject();
    for (size_t level = 0; level < tally.levels.size(); ++level)
        if (const uint64_t count = tally.levels[level][0] + tally.levels[level][1]; count != 0)
            json.member(std::to_string(level), count);
    json.end();
    writeStates("states", tally.states, json);
    json.member("stateBytes", tally.dataBytes).member("recordBytes", tally.recordsUsed * sizeof(MicromapTriangle));
    json.member("indexBytes", tally.indexBytes);
    writeSkipped(file.skipped, json);
    json.end();
}

void printJson(const InspectOptions &options, const inspect::InspectedFile &file)
{
    JsonWriter json;
    beginReport(json, "inspect");
    json.key("files").beginArray();
    write(options, options.input, file, json);
    fmt::print("{}\n", json.end().end().text());
}

// The second operand may be a file to compare with.
void takeSecond(InspectOptions &options)
{
    if (!options.operand || !isGltfName(*options.operand))
        return;
    options.second = std::move(options.operand);
    options.operand.reset();
    if (options.picture || !options.selection.everything())
        throw UsageError("two files are compared whole, without --picture, --mesh, --primitive, --triangle and "
                         "--material");
}

void placeOutputs(InspectOptions &options)
{
    if (options.second) {
        if (options.output && options.html)
            throw UsageError("--output and --html exclude each other");
        if (options.output)
            options.html = outputFor(options.output, "comparison.html");
        return;
    }
    if (options.operand && options.output)
        throw UsageError("OUT and --output exclude each other");
    const std::optional<std::filesystem::path> said = options.operand ? options.operand : options.output;
    if (!said && (options.html || options.picture))
        return;
    if (!said && isStandardStream(options.input))
        throw UsageError("reading from stdin needs an output: -o FILE");
    std::filesystem::path standard = options.input;
    const std::filesystem::path output = outputFor(said, standard.replace_extension(".html"));
    checkSuffix(output, {".html", ".htm", ".svg", ".png"});
    const bool picture = suffixOf(output) == ".svg" || suffixOf(output) == ".png";
    auto &place = picture ? options.picture : options.html;
    if (place)
        throw UsageError(std::string("--output and ") + (&place == &options.html ? "--html" : "--picture") +
                         " exclude each other");
    place = output;
}

bool writesToStdout(const InspectOptions &options)
{
    return (options.html && isStandardStream(*options.html)) || (options.picture && isStandardStream(*options.picture));
}

void finishInspect(InspectOptions &options)
{
    takeSecond(options);
    placeOutputs(options);
    if (writesToStdout(options) && (options.json || options.html == options.picture))
        throw UsageError("stdout takes only one of the page, the picture and --json");
    if (options.html && options.picture && locationOf(*options.html) == locationOf(*options.picture))
        throw UsageError("--html and --picture name the same file");
    if (options.html)
        checkSuffix(*options.html, {".html", ".htm"});
    if (options.picture)
        checkSuffix(*options.picture, {".svg", ".png"});
    options.drawing.outlines = !options.noOutlines;
    const inspect::Selection &selection = options.selection;
    options.drawing.whole = selection.meshes.empty() && selection.primitives.empty() && selection.triangles.empty();
    for (const auto &path : {options.html, options.picture})
        if (path)
            checkWritable(*path, options.force);
}

inspect::InspectedFile inspectFile(const InspectOptions &options, const Document &document)
{
    return withinMemory(document.path(), [&] {
        if (!options.bake)
            return inspect::inspectFile(document, options.selection, nullptr);
        ProgressLine progress("baking");
        DocumentBakeOptions baking = options.baking;
        baking.bake.progress = [&](size_t done, size_t total) { progress.update(done, total); };
        return inspect::inspectFile(document, options.selection, &baking);
    });
}

int compareCommand(const InspectOptions &options, std::optional<DataOutput> &data)
{
    UnmatchedExclusions exclusions(options.baking);
    std::vector<inspect::InspectedFile> files;
    for (const std::filesystem::path &path : {options.input, *options.second}) {
        const Document document = openDocument(path);
        exclusions.note(document);
        files.push_back(inspectFile(options, document));
        files.back().name = utf8Text(path); // both may have the same name in different folders
    }
    exclusions.print();
    const inspect::Comparison comparison = inspect::compare(files[0], files[1]);
    if (options.html)
        writeData(*options.html, inspect::pageOf(comparison), data);
    if (options.json) {
        JsonWriter json;
        beginReport(json, "inspect");
        json.key("files").beginArray();
        write(options, options.input, files[0], json);
        write(options, *options.second, files[1], json);
        json.end().key("comparison");
        inspect::write(comparison, json);
        fmt::print("{}\n", json.end().text());
        return static_cast<int>(ExitCode::Success);
    }
    fmt::print("{}", inspect::textOf(comparison));
    if (options.html && !isStandardStream(*options.html))
        fmt::print("wrote       {}\n", utf8Text(*options.html));
    return static_cast<int>(ExitCode::Success);
}

int inspectCommand(InspectOptions &options)
{
    finishInspect(options);
    std::optional<DataOutput> data;
    if (writesToStdout(options))
        data.emplace(DataOutput::Reports::ToStderr);
    if (options.quiet && !options.json)
        discardReports();
    if (options.second)
        return compareCommand(options, data);
    const Document document = openDocument(options.input);
    UnmatchedExclusions exclusions(options.baking);
    exclusions.note(document);
    exclusions.print();
    const inspect::InspectedFile file = inspectFile(options, document);
    if (!options.json)
        printFile(file);
    if (options.picture) {
        const ProgressLine progress("drawing");
        const LabelledPicture drawing = inspect::drawUvSpace(file, options.drawing);
        if (suffixOf(*options.picture) == ".svg")
            writeData(*options.picture, encodeSvg(drawing), data);
        else
            writeData(*options.picture, encodePng(drawing.picture), data);
    }
    if (options.html) {
        const ProgressLine progress("drawing");
        writeData(*options.html, inspect::makePage(document, file), data);
    }
    if (options.json)
        printJson(options, file);
    for (const auto &path : {options.picture, options.html})
        if (path && !options.json && !isStandardStream(*path))
            fmt::print("wrote       {}\n", utf8Text(*path));
    return static_cast<int>(ExitCode::Success);
}

} // namespace

std::function<int()> declareInspectCommand(CLI::App &app)
{
    const auto options = std::make_shared<InspectOptions>();
    const std::function<void()> finish = declareInspect(
        *app.add_subcommand("inspect", "Shows the micromaps of a glTF file as a web page or a picture"), *options);
    return [options, finish] {
        finish();
        return inspectCommand(*options);
    };
}

} // namespace vellum::cli
