#include "cli/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "cli/base/error.h"
#include "cli/commands.h"

namespace vellum::cli
{
namespace
{

// CLI11's messages can have several lines.
std::string oneLine(std::string text)
{
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text;
}

} // namespace

std::map<std::string, std::function<int()>> declareCommands(CLI::App &app)
{
    app.name("vellum");
    app.description("Opacity micromaps for every device that traces rays.");
    app.set_version_flag("--version", std::string("vellum ") + VELLUM_VERSION);
    app.require_subcommand(1);
    app.footer("vellum <subcommand> --help has examples.");
    std::map<std::string, std::function<int()>> commands;
    commands["bake"] = declareBakeCommand(app);
    commands["inspect"] = declareInspectCommand(app);
    commands["render"] = declareRenderCommand(app);
    commands["info"] = declareInfoCommand(app);
    commands["run"] = declareRunCommand(app);
    commands["verify"] = declareVerifyCommand(app);
    return commands;
}

int runCommandLine(int argc, char **argv)
{
    CLI::App app;
    const std::map<std::string, std::function<int()>> commands = declareCommands(app);
    try {
        app.parse(argc, argv);
    } catch (const CLI::Success &asked) { // --help and --version
        return app.exit(asked);
    } catch (const CLI::ParseError &error) {
        throw Error(oneLine(error.what()) + " (vellum --help tells more)");
    }
    return commands.at(app.get_subcommands().front()->get_name())();
}

} // namespace vellum::cli
