// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <fmt/format.h>
#include <memory>

#include "base/error.h"
#include "base/progress.h"
#include "cli/base/files.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "cli/verify/verify_report.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kVerifyDetails = R"(
Checks the structure of the micromaps, and every micro-triangle against the texture, independently of the baker: only the
reader of glTF files and images is shared. A claim (opaque or transparent) is wrong if the alpha test has the other
outcome anywhere in the micro-triangle, edges included, in exact arithmetic. Counted separately are claims that are true
but do not hold with the margins that GPUs have around a micro-triangle, and states that are unknown without need. 2-state
data is an approximation; how good it is, is printed.

Folders are searched recursively. Of several exit codes the smallest is returned.

Examples:
  vellum verify ash.omm.glb
      a table, and the first findings
  vellum verify --strict baked/ && echo fine
      all .glb and .gltf files in a folder; fails for anything that could be better
  vellum verify --exact ash.omm.glb
      for micromaps that were baked without tolerances
  vellum verify --json ash.omm.glb | jq .files[0].counts.wrong
      the same for a script
)";

struct VerifyOptions {
    std::vector<std::filesystem::path> files;
    verify::FileOptions file;
    bool exact = false;
    bool strict = false;
    bool requireMicromaps = false;
    bool json = false;
    bool verbose = false;
    bool quiet = false;
};

void declareVerify(CLI::App &command, VerifyOptions &options)
{
    command.footer(kVerifyDetails);
    command.option_defaults()->group(kInput);
    command.add_option("FILE", options.files, "glTF files (.glb, .gltf) or folders of them")
        ->type_name("FILE...")
        ->required();
    command
        .add_option("--blend-cutoff", options.file.blendCutoff,
                    "The cutoff of materials of alphaMode BLEND [that of vellum bake, which it notes in the file; else "
                    "none: opaque where alpha is 1, transparent where it is 0]")
        ->check(finite())
        ->type_name("ALPHA");
    command.option_defaults()->group(kOutput);
    command.add_flag("--strict", options.strict, "Exit with 5, 6 or 7 for what could be better");
    command.add_flag("--require-micromaps", options.requireMicromaps,
                     "Exit with 7 if a file has no micromaps, for example as a tool dropped them");
    command.add_flag(
        "--strict-2-state", options.file.strictTwoState,
        "Check 2-state data like 4-state data: claims that do not hold all over the micro-triangle are wrong");
    command
        .add_option("--max-findings", options.file.maxFindings,
                    "Most findings of each kind to list for a primitive [20]")
        ->check(wholeBetween(0, 1'000'000))
        ->type_name("COUNT");
    command.add_flag("-v,--verbose", options.verbose, "List primitives without findings, however many there are");
    command.add_flag("--json", options.json, "Print JSON instead of a table");
    verify::Tolerances &tolerances = options.file.tolerances;
    addToleranceOptions(command, options.exact,
                        {&tolerances.value, &tolerances.subtexel, &tolerances.barycentric, &tolerances.interpolation},
                        1024);
    command.option_defaults()->group(kGeneral);
    command.add_flag("-q,--quiet", options.quiet, "Print errors only");
    addThreadsOption(command, options.file.threads);
}

VerifiedFile verifyFile(const std::filesystem::path &path, const VerifyOptions &options)
{
    VerifiedFile file;
    file.path = utf8Text(path);
    ProgressLine progress("verifying " + file.path);
    verify::FileOptions fileOptions = options.file;
    fileOptions.progress = [&](size_t done, size_t total) { progress.update(done, total); };
    try {
        withinMemory(path, [&] {
            const Document document = openDocument(path);
            file.report = verify::verifyDocument(document, fileOptions);
            if (file.report.findings.empty() && !file.report.stored.extension.empty())
                file.surface = StoredShares(file.report.stored).of(surfaceAreas(document));
            file.micromaps = summariesOf(file.report.stored.micromaps);
            file.extension = std::move(file.report.stored.extension);
            file.report.stored = {}; // several files are reported together
        });
    } catch (const GltfError &error) {
        file.error = error.what();
    }
    return file;
}

int verifyCommand(VerifyOptions &options)
{
    if (options.exact)
        options.file.tolerances = {0, 0, 0, 0};
    if (options.quiet && !options.json)
        discardReports();
    std::vector<VerifiedFile> files;
    auto code = ExitCode::Success;
    for (const std::filesystem::path &path : gltfFiles(options.files)) {
        VerifiedFile file = verifyFile(path, options);
        file.code = exitCodeOf(file, options.strict, options.requireMicromaps);
        code = worse(code, file.code);
        if (!file.error.empty())
            std::fprintf(stderr, "vellum: %s\n", file.error.c_str());
        if (options.json) {
            files.push_back(std::move(file));
        } else {
            printVerified(file, options.verbose);
            std::fflush(stdout);
        }
    }
    if (options.json)
        fmt::print("{}\n", verifiedJson(files));
    return static_cast<int>(code);
}

} // namespace

std::function<int()> declareVerifyCommand(CLI::App &app)
{
    const auto options = std::make_shared<VerifyOptions>();
    declareVerify(*app.add_subcommand("verify", "Checks the micromaps of glTF files against their textures"), *options);
    return [options] { return verifyCommand(*options); };
}

} // namespace vellum::cli
