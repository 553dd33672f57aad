#include "cli/bake_options.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <map>
#include <memory>

#include "cli/bake_command.h"
#include "cli/base/error.h"
#include "cli/commands.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kBakeDetails = R"(
Every primitive with an alpha-tested material (alphaMode MASK) gets a micromap by the glTF extension
EXT_mesh_opacity_micromap. Micro-triangles are called opaque or transparent only where every point of them is, so a
renderer that samples the texture for the others draws exactly what it draws without micromaps. Everything else in the
file stays as it is, byte for byte; all micromaps that it has are replaced, and a primitive that is left out loses its
own. What is read is never written, and the output appears whole or not at all.

.glb becomes .glb, and .gltf becomes .gltf with a file of micromaps (NAME.omm-DIGEST.bin) beside it; the files that a
.gltf names are copied where the output is in another folder. Folders are searched with all folders in them, and what is
found keeps its place below the output folder.

Exit code: 0 if every file was baked, 1 if any was not (the others are) or none of its alpha-tested primitives could be;
one line on stderr for each of these.

Examples:
  vellum bake tree.glb
      writes tree.omm.glb
  vellum bake tree.glb -o baked/tree.glb --report
      writes that file, and prints a table of what each primitive got
  vellum bake models/ -o baked/ --json > baked.json
      all .glb and .gltf files in models/ at once
  vellum bake tree.glb --level 5 --budget 2M
      no finer than level 5, and no more than 2 MiB of micromaps
  vellum bake house.gltf --blend --leave-material 'glass*' -o out/
      alphaMode BLEND, too, but not glass)";

struct RawBakeOptions {
    std::string level = "auto";
    std::string rule = "nearest";
    std::string budget;
    unsigned format = 4;
    bool exact = false;
};

const std::map<std::string, TwoStateRule> kRules = {{"nearest", TwoStateRule::Nearest},
                                                    {"opaque", TwoStateRule::UnknownIsOpaque},
                                                    {"transparent", TwoStateRule::UnknownIsTransparent}};

void declareWhat(CLI::App &command, BakeCommandOptions &options)
{
    command.add_option("inputs", options.inputs, "glTF files (.glb or .gltf), or folders with some")->required();
    command.add_option("-o,--output", options.output,
                       "The file to write, or a folder, which is made; a folder for several inputs\n"
                       "[NAME.omm.glb or NAME.omm.gltf beside the input]");
    command.add_flag("--embed", options.bake.embed, "Put the micromaps of a .gltf into the file itself (data URI)");
    command.add_option("-j,--threads", options.threads, "Threads to work with [one for each processor]")
        ->check(CLI::Range(0, 1024).description(""));
    command.add_flag("--report", options.report, "Print a table of what each primitive got");
    command.add_flag("--json", options.json, "Print the same as JSON, and nothing else, to stdout");
}

void declareWhich(CLI::App &command, DocumentBakeOptions &options)
{
    CLI::Option &blend = *command.add_flag("--blend", options.blend,
                                           "Bake alphaMode BLEND, too: opaque only where alpha is 1, and transparent\n"
                                           "only where it is 0");
    command
        .add_option("--blend-cutoff", options.blendCutoff,
                    "With --blend: as a mask with this cutoff, which is wrong for renderers that\n"
                    "blend or dither")
        ->needs(&blend)
        ->type_name("NUMBER");
    command.add_flag("--fallback-images", options.fallbackImages,
                     "Bake from the PNG or JPEG of textures that also have a KTX2, AVIF or DDS image,\n"
                     "which renderers that read it take instead");
    command
        .add_option("--leave-material", options.leaveMaterials,
                    "Leave primitives with a material of this name, a shell pattern; may be\n"
                    "given several times")
        ->allow_extra_args(false)
        ->type_name("PATTERN");
    command.add_option("--leave-mesh", options.leaveMeshes, "The same by the name of the mesh")
        ->allow_extra_args(false)
        ->type_name("PATTERN");
}

void declareHow(CLI::App &command, BakeOptions &bake, RawBakeOptions &raw)
{
    command.add_option("-l,--level", raw.level,
                       "Subdivision level of every triangle, 0 to 12, or auto: by the texels that a\n"
                       "triangle covers [auto]");
    command.add_option("--max-level", bake.maxLevel, "The highest level for auto, 0 to 12 [8]")
        ->check(CLI::Range(0, 12).description(""));
    command.add_option("--texels-per-edge", bake.texelsPerEdge,
                       "For auto: how many texels long the edges of micro-triangles are, about [4]");
    command
        .add_option("--budget", raw.budget,
                    "Most bytes of micromaps for a file, like 500K or 2M: levels are lowered where\n"
                    "that costs least [none]")
        ->type_name("BYTES");
    command.add_option("-f,--format", raw.format, "4: four states, exact. 2: two states, an approximation [4]")
        ->check(CLI::IsMember({2, 4}).description(""));
    command
        .add_option("--two-state-rule", raw.rule,
                    "For --format 2, what unknown becomes: nearest (what most of it is), opaque or\n"
                    "transparent [nearest]")
        ->check(CLI::IsMember(kRules).description(""))
        ->type_name("RULE");
    command.add_option("--worthwhile", bake.worthwhile,
                       "Share of a triangle, 0 to 1, that must be known for it to get data at all [0]");
    command.add_option("--value-tolerance", bake.valueTolerance,
                       "How far filtered alpha may be from exact on a GPU [2/255]");
    command.add_option("--subtexel-tolerance", bake.subtexelTolerance,
                       "How far from its place, in texels, a GPU may sample [1/16]");
    command.add_option("--barycentric-tolerance", bake.barycentricTolerance,
                       "How far outside of a micro-triangle, in barycentrics, a hit of it may lie [1e-5]");
    command.add_option("--interpolation-tolerance", bake.interpolationTolerance,
                       "How far interpolation may move texture coordinates, relative to the largest\n"
                       "of a triangle [1e-6]");
    CLI::Option &exact = *command.add_flag("--exact", raw.exact, "No tolerances: what is true in exact arithmetic");
    for (const char *tolerance :
         {"--value-tolerance", "--subtexel-tolerance", "--barycentric-tolerance", "--interpolation-tolerance"})
        exact.excludes(command.get_option(tolerance));
}

void finishBaking(DocumentBakeOptions &options, const RawBakeOptions &raw)
{
    BakeOptions &bake = options.bake;
    if (raw.level != "auto") {
        unsigned level = 0;
        const char *end = raw.level.data() + raw.level.size();
        const auto read = std::from_chars(raw.level.data(), end, level);
        if (read.ec != std::errc() || read.ptr != end || level > 12)
            throw Error("--level: " + raw.level + " is neither a subdivision level (0 to 12) nor auto");
        bake.level = level;
    }
    if (!raw.budget.empty())
        bake.budget = parseBytes(raw.budget);
    bake.format = raw.format == 2 ? Format::TwoState : Format::FourState;
    bake.twoStateRule = kRules.at(raw.rule);
    if (raw.exact)
        bake.exactly();
    if (!std::isfinite(options.blendCutoff.value_or(0)))
        throw Error("--blend-cutoff must be a number");
}

} // namespace

std::function<void()> declareBaking(CLI::App &command, DocumentBakeOptions &options, const std::string &group)
{
    const auto raw = std::make_shared<RawBakeOptions>();
    if (!group.empty())
        command.option_defaults()->group(group);
    declareWhich(command, options);
    declareHow(command, options.bake, *raw);
    return [&options, raw] { finishBaking(options, *raw); };
}

uint64_t parseBytes(const std::string &text)
{
    uint64_t number = 0;
    const char *end = text.data() + text.size();
    const auto read = std::from_chars(text.data(), end, number);
    unsigned shift = 0;
    const std::string unit(read.ptr, end);
    if (unit == "K" || unit == "k")
        shift = 10;
    else if (unit == "M")
        shift = 20;
    else if (unit == "G")
        shift = 30;
    if (read.ec != std::errc() || (!unit.empty() && shift == 0) || number > (~uint64_t{0} >> shift))
        throw Error(text + " is not a number of bytes like 1500, 64K, 2M or 1G");
    return number << shift;
}

std::function<int()> declareBakeCommand(CLI::App &app)
{
    const auto options = std::make_shared<BakeCommandOptions>();
    CLI::App &command = *app.add_subcommand("bake", "Bakes opacity micromaps into glTF files");
    command.footer(kBakeDetails);
    declareWhat(command, *options);
    const std::function<void()> finish = declareBaking(command, options->bake);
    return [options, finish] {
        finish();
        if (options->report && options->json)
            throw Error("--report and --json are one or the other");
        return bakeCommand(*options);
    };
}

} // namespace vellum::cli
