#include <CLI/CLI.hpp>
#include <algorithm>
#include <fmt/format.h>
#include <memory>
#include <optional>

#include "cli/bake_options.h"
#include "cli/base/error.h"
#include "cli/base/numbers.h"
#include "cli/base/output_file.h"
#include "cli/base/progress.h"
#include "cli/commands.h"
#include "cli/inspect/drawing/uv_picture.h"
#include "cli/inspect/page.h"
#include "cli/inspect/tally.h"
#include "cli/surface_report.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kInspectDetails = R"(
Draws what is known of each micro-triangle over the texture it was baked from, in the colours of render --mode states.
The page is one file that needs nothing else, and loads nothing. It has numbers and charts, the UV space of each material
to zoom and pan in, the triangles that are worth a look, and a picture of each mesh.

Examples:
  vellum inspect ash.omm.glb
      writes the page ash.omm.html
  vellum inspect ash.omm.glb -o ash.png
      the whole UV space of each material as a picture
  vellum inspect ash.omm.glb --picture leaf.png --mesh 0 --primitive 1 --triangle 40-47
      eight triangles, and what of the texture is around them
  vellum inspect ash.glb --bake --level 5
      what vellum bake would make of a file with these options)";

struct InspectOptions {
    std::filesystem::path input;
    std::optional<std::filesystem::path> output;
    std::optional<std::filesystem::path> html;
    std::optional<std::filesystem::path> picture;
    UvPictureOptions drawing;
    Selection selection;
    bool bake = false;
    DocumentBakeOptions baking;
    // As CLI11 stores them.
    std::string meshes, primitives, triangles;
    bool noOutlines = false;
};

std::function<void()> declareInspect(CLI::App &command, InspectOptions &options)
{
    command.footer(kInspectDetails);
    command.add_option("file", options.input, "A .glb or .gltf file")->required();
    command.add_option("-o,--output", options.output, "The page to write or, where it ends in .png, the picture");
    command.add_option("--html", options.html, "The page to write [the file's name with .html, in this folder]");
    command.add_option("--picture", options.picture, "A PNG to write; no page then, without --html");
    command.add_option("--mesh", options.meshes, "Only these meshes: 2, 0-4, or several with commas")
        ->type_name("NUMBERS");
    command.add_option("--primitive", options.primitives, "Only these primitives of each mesh")->type_name("NUMBERS");
    command.add_option("--triangle", options.triangles, "Only these triangles of each primitive")->type_name("NUMBERS");
    command.add_option("--material", options.selection.materials, "Only this material, by name or number; repeatable")
        ->type_name("NAME");
    command.add_option("--size", options.drawing.edge, "Longer side of each material in the picture [1024]")
        ->check(CLI::Range(64, 8192).description(""));
    command.add_flag("--no-outlines", options.noOutlines, "No outlines of triangles in the picture");
    CLI::Option &bake =
        *command.add_flag("--bake", options.bake, "Bake in memory, as vellum bake does with the options below");
    const std::vector<CLI::Option *> own = command.get_options();
    std::function<void()> finish = declareBaking(command, options.baking, "With --bake, as of vellum bake");
    for (CLI::Option *option : command.get_options())
        if (std::find(own.begin(), own.end(), option) == own.end())
            option->needs(&bake);
    return finish;
}

void printShares(const Tally &tally)
{
    const auto &s = tally.states;
    fmt::print("states      {} transparent, {} opaque, {} unknown, of triangles, each counted alike\n", percent(s[0]),
               percent(s[1]), percent(s[2] + s[3]));
}

void printFile(const InspectedFile &file)
{
    const Tally tally = tallyOf(file);
    fmt::print("file        {}: {}, {}\n", file.name, counted(file.bytes, "byte"),
               file.baked ? "baked in memory" : file.stored.extension);
    fmt::print("micromaps   {} of {}: {}, {} with a special index\n", file.primitives.size(),
               counted(file.primitiveCount, "primitive"), counted(tally.triangles, "triangle"),
               grouped(tally.special[0] + tally.special[1] + tally.special[2] + tally.special[3]));
    std::string levels;
    for (size_t level = 0; level < tally.levels.size(); ++level)
        if (const uint64_t count = tally.levels[level][0] + tally.levels[level][1]; count != 0)
            levels += fmt::format("{}{}: {}", levels.empty() ? "" : ", ", level, grouped(count));
    fmt::print("levels      {}\n", levels.empty() ? "none" : levels);
    printShares(tally);
    if (file.surface)
        fmt::print("surface     {}\n", describe(*file.surface));
    fmt::print("bytes       {} of states, {} of triangles, {} of indices\n", grouped(tally.dataBytes),
               grouped(tally.recordsUsed * sizeof(MicromapTriangle)), grouped(tally.indexBytes));
    for (const InspectedFile::Left &left : file.left)
        fmt::print("left out    {}{}: {}\n", left.name,
                   left.material.empty() ? "" : fmt::format(" ({})", left.material), left.reason);
    for (const InspectedMaterial &material : file.materials)
        if (!material.problem.empty())
            fmt::print("warning     shown without the texture: {}\n", material.problem);
}

void placeOutput(InspectOptions &options)
{
    if (options.output) {
        auto &place = options.output->extension() == ".png" ? options.picture : options.html;
        if (place)
            throw Error("--output and " + std::string(&place == &options.html ? "--html" : "--picture") +
                        " are one or the other");
        place = options.output;
    }
    if (!options.html && !options.picture) {
        options.html = options.input.filename();
        options.html->replace_extension(".html");
    }
}

int inspectCommand(InspectOptions &options)
{
    placeOutput(options);
    for (const auto &path : {options.html, options.picture})
        if (path)
            checkWritable(*path);
    options.selection.meshes =
        options.meshes.empty() ? std::vector<NumberRange>() : parseRanges(options.meshes, "--mesh");
    if (!options.primitives.empty())
        options.selection.primitives = parseRanges(options.primitives, "--primitive");
    if (!options.triangles.empty())
        options.selection.triangles = parseRanges(options.triangles, "--triangle");
    options.drawing.outlines = !options.noOutlines;
    options.drawing.whole =
        options.selection.meshes.empty() && options.selection.primitives.empty() && options.selection.triangles.empty();
    const Document document(options.input);
    const InspectedFile file = inspectFile(document, options.selection, options.bake ? &options.baking : nullptr);
    printFile(file);
    if (options.picture) {
        const Progress progress("drawing");
        writePng(*options.picture, drawUvSpace(file, options.drawing));
    }
    if (options.html) {
        const Progress progress("drawing");
        const std::string page = makePage(document, file);
        writeWhole(*options.html, {reinterpret_cast<const uint8_t *>(page.data()), page.size()});
    }
    for (const auto &path : {options.picture, options.html})
        if (path)
            fmt::print("wrote       {}\n", path->string());
    return 0;
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
