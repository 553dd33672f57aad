// SPDX-License-Identifier: Apache-2.0
// `vellum info`
#include <cstdio>
#include <memory>

#include "base/error.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/info/file_report.h"
#include "cli/info/loader_report.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "gltf/file/gltf_error.h"

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
