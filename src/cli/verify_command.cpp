#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "cli/base/error.h"
#include "cli/base/progress.h"
#include "cli/commands.h"
#include "cli/verify_report.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kVerifyDetails = R"(
Says of every micro-triangle whether its state is true of the texture, by a method of its own (the file is read, and its
images are decoded, by the code that vellum bake uses), and checks the structure of the micromaps. A claim (opaque or transparent) is wrong if there is any point of the
micro-triangle, edges included, where the alpha test comes out otherwise in exact arithmetic. Claims that are true, but
not of what GPUs may do around the micro-triangle, are counted on their own, as is what is unknown without need. 2-state
data is an approximation: how good a one is printed.

Exit codes, of several the smallest:
  0  nothing to complain about
  1  something cannot be read, or not be verified
  2  the structure is broken
  3  wrong claims
  4  with --strict: claims outside the margins or left open, or cautions (animated alpha, variants, morph targets,
     other images or data for other renderers, a cutoff for alphaMode BLEND)
  5  with --strict: needlessly unknown
  6  with --strict: no micromaps

Examples:
  vellum verify ash.omm.glb
      a table, and the first findings
  vellum verify --strict *.glb && echo fine
      fails for anything that could be better
  vellum verify --exact ash.omm.glb
      for micromaps that were baked without tolerances
  vellum verify --json ash.omm.glb | jq .files[0].wrong
      the same for a machine)";

struct VerifyOptions {
    std::vector<std::string> files;
    verify::FileOptions file;
    bool exact = false;
    bool strict = false;
    bool json = false;
};

void declareTolerance(CLI::App &command, const char *name, double &value, const char *what)
{
    command.add_option(name, value, what)->type_name("NUMBER")->group("Tolerances, as of vellum bake");
}

void declareVerify(CLI::App &command, VerifyOptions &options)
{
    command.footer(kVerifyDetails);
    command.add_option("files", options.files, "The .glb and .gltf files")->required();
    command.add_option("--max", options.file.maxFindings, "Most findings of each kind to list for a primitive [20]")
        ->check(CLI::Range(0, 1'000'000).description(""));
    command.add_flag("--json", options.json, "Prints JSON instead of a table");
    command.add_flag("--strict", options.strict, "The exit code tells of all that could be better, too");
    command.add_flag("--strict-2-state", options.file.strictTwoState,
                     "Takes claims of 2-state data at their word: those that do not hold all over\n"
                     "the micro-triangle are wrong");
    command
        .add_option("--blend-cutoff", options.file.blendCutoff,
                    "The cutoff of materials of alphaMode BLEND [none: opaque where alpha is 1,\n"
                    "transparent where it is 0]")
        ->type_name("NUMBER");
    command.add_option("-j,--threads", options.file.threads, "Threads to work with [one for each processor]")
        ->check(CLI::Range(0, 1024).description(""));
    verify::Tolerances &tolerances = options.file.tolerances;
    CLI::Option &exact = *command.add_flag("--exact", options.exact, "No tolerances: all four are 0")
                              ->group("Tolerances, as of vellum bake");
    declareTolerance(command, "--value-tolerance", tolerances.value, "Of the filtered alpha [2/255]");
    declareTolerance(command, "--subtexel-tolerance", tolerances.subtexel, "Of the sample's place, in texels [1/16]");
    declareTolerance(command, "--barycentric-tolerance", tolerances.barycentric,
                     "Of the hit's place, in barycentrics [1e-5]");
    declareTolerance(command, "--interpolation-tolerance", tolerances.interpolation,
                     "Of a texture coordinate, relative to the triangle's largest [16/2^24]");
    for (const char *tolerance :
         {"--value-tolerance", "--subtexel-tolerance", "--barycentric-tolerance", "--interpolation-tolerance"})
        exact.excludes(command.get_option(tolerance));
}

void finishVerify(VerifyOptions &options)
{
    verify::Tolerances &t = options.file.tolerances;
    if (options.exact)
        t = {0, 0, 0, 0};
    for (const double tolerance : {t.value, t.subtexel, t.barycentric, t.interpolation})
        if (!(tolerance >= 0 && tolerance <= 1024))
            throw Error("tolerances must be numbers from 0 to 1024");
    if (!std::isfinite(options.file.blendCutoff.value_or(0)))
        throw Error("--blend-cutoff must be a number");
}

VerifiedFile verifyFile(const std::string &path, const VerifyOptions &options)
{
    VerifiedFile file{path, {}, {}, {}};
    Progress progress("verifying " + path);
    verify::FileOptions fileOptions = options.file;
    fileOptions.progress = [&](size_t done, size_t total) { progress.update(done, total); };
    try {
        const Document document(path);
        file.report = verify::verifyDocument(document, fileOptions);
        if (file.report.offences.empty() && !file.report.extension.empty())
            file.surface = surfaceShares(document, readMicromaps(document));
    } catch (const GltfError &error) {
        file.error = error.what();
    }
    return file;
}

int verifyCommand(VerifyOptions &options)
{
    finishVerify(options);
    std::vector<VerifiedFile> files;
    auto worst = Judgement::AllRight;
    for (const std::string &path : options.files) {
        VerifiedFile file = verifyFile(path, options);
        const Judgement judgement = judgementOf(file, options.strict);
        if (judgement != Judgement::AllRight && (worst == Judgement::AllRight || judgement < worst))
            worst = judgement;
        if (!file.error.empty())
            fmt::print(stderr, "vellum: {}\n", file.error);
        if (options.json) {
            files.push_back(std::move(file));
        } else {
            printVerified(file);
            std::fflush(stdout);
        }
    }
    if (options.json)
        fmt::print("{}\n", verifiedJson(files, options.strict));
    return static_cast<int>(worst);
}

} // namespace

std::function<int()> declareVerifyCommand(CLI::App &app)
{
    const auto options = std::make_shared<VerifyOptions>();
    declareVerify(*app.add_subcommand("verify", "Proves the micromaps of glTF files right, or finds what is wrong"),
                  *options);
    return [options] { return verifyCommand(*options); };
}

} // namespace vellum::cli
