// SPDX-License-Identifier: Apache-2.0
#include "cli/bake/bake.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fmt/format.h>
#include <map>
#include <memory>

#include "base/error.h"
#include "base/sha256.h"
#include "base/text.h"
#include "cli/base/files.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "core/curve.h"
#include "core/utf8_path.h"
#include "gltf/micromaps/bake_cache.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kBakeDetails = R"(
Every primitive with an alpha-tested material (alphaMode MASK) gets a micromap by the glTF extension
EXT_mesh_opacity_micromap. A micro-triangle is opaque or transparent only if the alpha test has that outcome at every
point of it, so a renderer that samples the texture for the others draws exactly what it draws without micromaps.
Everything else in the file stays as it is, byte for byte. All micromaps of the file are replaced; a primitive that is
skipped loses its micromap. Where nothing is baked and nothing changes, no output is written, except to stdout, with
--copy, and in place of an earlier output.

Without OUT, NAME.omm.glb is written beside the input. OUT can be a folder; several inputs, and folders, need -o FOLDER.
Folders are searched recursively, and files keep their place below the output folder. Inputs are never modified. Outputs
appear whole or not at all. An existing file is replaced only if vellum bake wrote it, or with --force. After Ctrl-C or
SIGTERM the files that are done stay and are reported, the others are listed, and the command ends by the signal. Where
a folder cannot be written or the disk is read-only or too full, the files that would go there are not baked but listed.

--files takes many files: INPUT, or INPUT and OUTPUT with a tab between them, in each line. Without OUTPUT, the output is
in the folder of -o, or beside the input.

--shard K/N bakes part K of N, on each of N machines another one. The name of its output decides which part a file is
in, so names must be written alike on all machines.

--log appends a line of JSON whenever a file has ended; each process has its own log, and cat merges logs. --resume skips
the files that a log has as done with the same options, whose outputs must be there still. After changing inputs, start a
new log. Both may be the same file, which then need not exist.

--cache keeps each micromap in a folder, by a digest of all that determines it: the bytes of the image, the sampler, the
texture coordinates of the triangles, the cutoff, the options and the version of the baker. A file whose micromaps are
there is neither decoded nor baked, and gets the same bytes. Names, positions and other meshes do not matter. With
--budget and --target-known, all micromaps of a file are kept together, and positions matter. Any number of processes
and machines may share the folder, which takes --cache-size at most: what was not used for the longest time is removed.
Damaged micromaps are baked again. If the folder cannot be used, a warning says why, and everything is baked.

--depfile states for each output the input and the files that this names, and replaces FILE. A build that needs every
output also needs --copy.

A .glb stays a .glb. A .gltf stays a .gltf: its micromaps go into NAME.omm-DIGEST.bin beside it, and the files that it
names are copied if the output is in another folder.

Examples:
  vellum bake tree.glb
      writes tree.omm.glb
  vellum bake tree.glb baked/tree.glb --report
      writes that file, and prints a table of what each primitive got
  vellum bake models/ -o baked/ --json > baked.json
      all .glb and .gltf files in models/
  vellum bake tree.glb --level 5 --budget 2M
      no finer than level 5, and at most 2 MiB of micromaps
  vellum bake tree.glb --target-known 0.9
      the smallest micromaps that know 90 % of the alpha-tested surface
  vellum bake house.gltf -o out/ --blend --exclude-material 'glass*'
      alphaMode BLEND as well, but not glass
  vellum bake --files list.txt -o baked/ --shard 2/8 --log 2.jsonl --resume 2.jsonl
      the second of eight parts; the same command goes on where it was interrupted
  vellum bake tree.gltf -o out/tree.gltf --copy --depfile out/tree.d --cache ~/.cache/vellum
      in a rule of Make or Ninja
  vellum bake - - < tree.glb > tree.omm.glb
      as a filter
)";

struct RawBakeOptions {
    std::string level = "auto";
    std::string rule = "nearest";
    std::string states = "4";
    bool exact = false;
};

// 4 values for each folder of the cache.
constexpr uint64_t kLeastCacheSize = uint64_t{1} << 20;

const std::map<std::string, TwoStateRule> kRules = {{"nearest", TwoStateRule::Nearest},
                                                    {"opaque", TwoStateRule::UnknownIsOpaque},
                                                    {"transparent", TwoStateRule::UnknownIsTransparent}};

void declareFiles(CLI::App &command, BakeCommandOptions &options)
{
    command.option_defaults()->group(kInput);
    command
        .add_option("IN", options.inputs,
                    "glTF files (.glb, .gltf) or folders of them; of two operands the second is OUT")
        ->type_name("[IN... [OUT]]");
    command
        .add_option("--files", options.files,
                    "Bake the files of this list instead: INPUT or INPUT<TAB>OUTPUT a line; - is stdin")
        ->type_name("LIST");
    command
        .add_option_function<std::string>(
            "--shard", [&options](const std::string &text) { options.shard = job::parseShard(text); },
            "Bake the files of part K of N only, as 2/8")
        ->type_name("K/N");
    command
        .add_option("--resume", options.resume,
                    "Skip what this log has as done and whose outputs exist; the log must exist, except that of --log; "
                    "repeatable")
        ->allow_extra_args(false)
        ->type_name("LOG");
    command.option_defaults()->group(kOutput);
    command.add_option("-o,--output", options.output, "Output file or folder [NAME.omm.glb beside the input]")
        ->type_name("OUT");
    command.add_flag("--force", options.force, "Replace existing files, whoever wrote them");
    command.add_flag("-n,--dry-run", options.dryRun, "Bake, but write nothing");
    command.add_flag("--embed", options.bake.embed, "Put the micromaps of a .gltf into the file itself (data URI)");
    command.add_flag(
        "--copy", options.copy,
        "Also write outputs in which nothing is baked: copies of their input with a mark, for a complete folder");
    command.add_flag("--require-micromaps", options.bake.requireMicromaps,
                     "Where no primitive of a file gets a micromap, write nothing and exit with 7");
    command.add_flag("-v,--verbose,--report", options.table, "Print a table of what each primitive got");
    command.add_flag("--json", options.json, "Print the report as JSON");
    command
        .add_option("--log", options.log, "Append a line of JSON to this file whenever a file is done or has failed")
        ->type_name("LOG");
    command
        .add_option("--depfile", options.depfile,
                    "Write the files that each output depends on to this file, for Make and Ninja")
        ->type_name("FILE");
    command.option_defaults()->group(kCache);
    command
        .add_option("--cache", options.cache,
                    "Keep micromaps in this folder, and take from there what an earlier bake kept; empty for none "
                    "[VELLUM_CACHE, or else none]")
        ->envname("VELLUM_CACHE")
        ->type_name("FOLDER");
    command
        .add_option_function<std::string>(
            "--cache-size",
            [&options](const std::string &text) { options.cacheSize = parseBytes("--cache-size", text); },
            "Most bytes that the cache takes, like 500M or 20G, from 1M on [5G]")
        ->type_name("BYTES");
    command.option_defaults()->group(kGeneral);
    command.add_flag("-q,--quiet", options.quiet, "Print errors only");
    addThreadsOption(command, options.threads);
}

void declareSelection(CLI::App &command, DocumentBakeOptions &options)
{
    command.option_defaults()->group(kSelection);
    addBlendOptions(command, options.blend, options.blendCutoff,
                    "Bake alphaMode BLEND as well: opaque only where alpha is 1, transparent only where it is 0",
                    "With --blend: bake as a mask with this cutoff, which is wrong for renderers that blend or dither");
    command.add_flag(
        "--fallback-images", options.fallbackImages,
        "For textures with an image that is not supported (KTX2, DDS) and another one, bake from the latter");
    command
        .add_option("--exclude-material", options.excludedMaterials,
                    "Skip primitives with a material of this name, a shell pattern; repeatable")
        ->allow_extra_args(false)
        ->type_name("PATTERN");
    command
        .add_option("--exclude-mesh", options.excludedMeshes, "Skip meshes of this name, a shell pattern; repeatable")
        ->allow_extra_args(false)
        ->type_name("PATTERN");
}

void declareQuality(CLI::App &command, DocumentBakeOptions &options, RawBakeOptions &raw)
{
    BakeOptions &bake = options.bake;
    command.option_defaults()->group(kQuality);
    command
        .add_option(
            "-l,--level", raw.level,
            "Subdivision level of every triangle, 0 to 12, or auto: by the texels that a triangle covers [auto]")
        ->type_name("LEVEL");
    command.add_option("--max-level", bake.maxLevel, "The highest level that auto chooses, 0 to 12 [8]")
        ->check(wholeBetween(0, shared::kMaxSubdivisionLevel))
        ->type_name("LEVEL");
    addBakeNumber(command, kTexelsPerEdge, bake.texelsPerEdge);
    command
        .add_option_function<std::string>(
            "--budget", [&bake](const std::string &text) { bake.budget = parseBytes("--budget", text); },
            "Most bytes of micromaps for a file, like 500K or 2M, without the indices of triangles: levels are lowered "
            "where that loses the least known "
            "surface, or automatic ones raised where that gains the most. 0: one state "
            "for each triangle; what then remains are the 9 bytes of an empty micromap for each material [none]")
        ->type_name("BYTES");
    command
        .add_option(
            "--target-known", options.targetKnown,
            "The smallest micromaps that know this share of the alpha-tested surface, 0 to 1, with levels as for "
            "--budget; a file of which no levels know as much fails, with the share that they do [none]")
        ->check(between(0, 1))
        ->type_name("SHARE");
    takesWords(*command.add_option("--states", raw.states,
                                   "4: opaque, transparent and two unknown states, exact. 2: an approximation [4]"),
               {"2", "4"});
    takesWords(*command.add_option("--two-state-rule", raw.rule,
                                   "With --states 2, what unknown becomes: nearest (what most of it is), opaque "
                                   "or transparent [nearest]"),
               {"nearest", "opaque", "transparent"});
    addBakeNumber(command, kMinKnown, bake.minKnown);
}

void finishBaking(DocumentBakeOptions &options, const RawBakeOptions &raw)
{
    BakeOptions &bake = options.bake;
    bake.level = parseLevel(raw.level);
    bake.format = raw.states == "2" ? Format::TwoState : Format::FourState;
    bake.twoStateRule = kRules.at(raw.rule);
    if (bake.budget && options.targetKnown)
        throw UsageError("--budget and --target-known exclude each other");
    if (bake.format == Format::TwoState && options.targetKnown)
        throw UsageError("--target-known is for 4 states: with --states 2 nothing is unknown");
    if (raw.exact)
        bake.exactly();
}

// IN OUT without -o; from stdin to stdout.
void splitOperands(BakeCommandOptions &options)
{
    if (!options.output && options.inputs.size() > 2)
        throw UsageError("several inputs need an output folder: -o FOLDER");
    if (!options.output && options.inputs.size() == 2) {
        options.output = options.inputs.back();
        options.inputs.pop_back();
        options.operandOutput = true;
    }
    const bool fromStdin = std::any_of(options.inputs.begin(), options.inputs.end(), isStandardStream);
    if (fromStdin && options.inputs.size() > 1)
        throw UsageError("stdin (-) must be the only input");
    if (fromStdin && !options.output)
        options.output = "-";
}

// A file that is written beside the outputs.
void checkOwnFile(const BakeCommandOptions &options, const char *option, const std::filesystem::path &file)
{
    if (options.dryRun)
        throw UsageError(std::string(option) + " and --dry-run exclude each other");
    if (isStandardStream(file) || isGltfName(file))
        throw UsageError(std::string(option) + " must be a file of its own, got " + utf8Text(file));
}

void checkTogether(const BakeCommandOptions &options)
{
    if (options.inputs.empty() && !options.files)
        throw UsageError("IN is required: files, folders, or --files LIST");
    if (!options.inputs.empty() && options.files)
        throw UsageError("IN and --files exclude each other");
    if (options.files && options.output == "-")
        throw UsageError("--files needs an output folder, not stdout");
    if (options.log)
        checkOwnFile(options, "--log", *options.log);
    if (options.depfile)
        checkOwnFile(options, "--depfile", *options.depfile);
    if (options.depfile && options.output == "-")
        throw UsageError("--depfile needs an output file, not stdout");
    // It would lack the files that are skipped, and a build repeats only what it needs.
    if (options.depfile && !options.resume.empty())
        throw UsageError("--depfile and --resume exclude each other");
    if ((options.log || !options.resume.empty()) &&
        (options.output == "-" || std::any_of(options.inputs.begin(), options.inputs.end(), isStandardStream)))
        throw UsageError("--log and --resume are for files, not for stdin or stdout");
    if (options.cacheSize < kLeastCacheSize)
        throw UsageError("--cache-size must be at least 1M");
    if (options.table && options.json)
        throw UsageError("--report and --json exclude each other");
    if (options.json && options.output == "-")
        throw UsageError("--json and an output to stdout exclude each other");
    if (options.output == "-" && !options.dryRun)
        checkWritable(*options.output, options.force);
}

} // namespace

std::function<void()> declareBaking(CLI::App &command, DocumentBakeOptions &options)
{
    const auto raw = std::make_shared<RawBakeOptions>();
    declareSelection(command, options);
    declareQuality(command, options, *raw);
    BakeOptions &bake = options.bake;
    addToleranceOptions(
        command, raw->exact,
        {&bake.valueTolerance, &bake.subtexelTolerance, &bake.barycentricTolerance, &bake.interpolationTolerance});
    return [&options, raw] { finishBaking(options, *raw); };
}

std::optional<uint32_t> parseLevel(const std::string &text)
{
    if (text == "auto")
        return std::nullopt;
    const auto level = parseNumber<uint32_t>(text);
    if (!level || *level > shared::kMaxSubdivisionLevel)
        throw UsageError("--level must be auto or a whole number between 0 and 12, got " + text);
    return level;
}

uint64_t parseBytes(const std::string &option, const std::string &text)
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
        throw UsageError(option + " must be a number of bytes like 1500, 64K, 2M or 1G, got " + text);
    return number << shift;
}

std::string digestOf(const BakeCommandOptions &options)
{
    // New members do not compile here until it is stated whether outputs depend on them.
    const auto &[bake, targetKnown, blend, blendCutoff, fallbackImages, excludedMaterials, excludedMeshes, images,
                 cache] = static_cast<const DocumentBakeOptions &>(options.bake);
    std::string text = fmt::format("{} {} {} {}", blend, fallbackImages, options.bake.embed, options.copy);
    text += fmt::format(" {} ", options.bake.requireMicromaps);
    if (targetKnown)
        text += fmt::format("known {} ", *targetKnown);
    if (blendCutoff)
        text += fmt::format("cutoff {} ", *blendCutoff);
    for (const auto &[name, patterns] : {std::pair("material", &excludedMaterials), std::pair("mesh", &excludedMeshes)})
        for (const std::string &pattern : *patterns)
            text += fmt::format("{} {} {} ", name, pattern.size(), pattern);
    // An input makes the key depend on the options that matter to some inputs only.
    Sha256 sha256;
    sha256.add(bakeKey(std::array{BakeInput()}, {}, bake));
    sha256.add({reinterpret_cast<const uint8_t *>(text.data()), text.size()});
    return hexOf(sha256.finish()).substr(0, 16);
}

std::function<int()> declareBakeCommand(CLI::App &app)
{
    const auto options = std::make_shared<BakeCommandOptions>();
    CLI::App &command = *app.add_subcommand("bake", "Bakes opacity micromaps into glTF files");
    command.footer(kBakeDetails);
    declareFiles(command, *options);
    const std::function<void()> finish = declareBaking(command, options->bake);
    return [options, finish] {
        finish();
        splitOperands(*options);
        checkTogether(*options);
        return bakeCommand(*options);
    };
}

} // namespace vellum::cli
