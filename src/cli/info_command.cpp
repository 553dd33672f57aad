// `vellum info`
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "cli/base/error.h"
#include "cli/commands.h"
#include "cli/info/file_report.h"
#include "cli/info/loader_report.h"
#include "gltf/file/gltf_error.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kInfoDetails = R"(
Without a file: the Vulkan loader, where the layer is and how to turn it on, and for each device its driver, ray
tracing, and who brings micromaps. The first thing to run when something is off: what keeps micromaps from working is
said on stderr, a line for each reason.
With files: what is in them, which micromaps, and which alpha-tested primitives vellum bake would leave out, and why.

Exit code: 0 where all is well; 1 where a device with micromaps is wanting, or a file cannot be read or has wrong
micromaps.

Examples:
  vellum info
      is there a device with micromaps, and how is the layer turned on?
  vellum info tree.glb
      what vellum bake will find in it
  vellum info --json tree.omm.glb | jq '.files[0].micromaps'
      for a script)";

struct InfoOptions {
    std::vector<std::filesystem::path> files;
    bool json = false;
    std::optional<std::filesystem::path> layerFolder;
};

int infoOnLoader(const InfoOptions &options)
{
    const LoaderReport report = reportLoader(options.layerFolder);
    if (options.json) {
        JsonWriter json;
        write(report, json);
        std::printf("%s\n", json.text().c_str());
    } else {
        print(report);
    }
    std::fflush(stdout);
    for (const std::string &problem : report.problems)
        std::fprintf(stderr, "vellum: %s\n", problem.c_str());
    return report.problems.empty() ? 0 : 1;
}

int infoOnFiles(const InfoOptions &options)
{
    int code = 0;
    JsonWriter json;
    json.beginObject().key("files").beginArray();
    for (size_t i = 0; i < options.files.size(); ++i) {
        try {
            const FileReport report = reportFile(options.files[i]);
            if (!report.offences.empty() || !report.problems.empty())
                code = 1;
            if (options.json)
                write(report, json);
            else
                print(report);
        } catch (const GltfError &error) {
            code = 1;
            std::fflush(stdout);
            std::fprintf(stderr, "vellum: %s\n", error.what());
        }
        if (!options.json && i + 1 < options.files.size())
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
    CLI::App &command = *app.add_subcommand("info", "Says what devices and files have, and what is missing");
    command.footer(kInfoDetails);
    command.add_option("files", options->files, "glTF files; without one, this machine")->type_name("FILE");
    command.add_flag("--json", options->json, "For machines");
    command
        .add_option("--layer-path", options->layerFolder,
                    "Folder of the layer's manifest, instead of the one beside this program")
        ->type_name("FOLDER");
    return [options] { return options->files.empty() ? infoOnLoader(*options) : infoOnFiles(*options); };
}

} // namespace vellum::cli
