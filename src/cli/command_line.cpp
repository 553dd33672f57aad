// SPDX-License-Identifier: Apache-2.0
#include "cli/options/commands.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "base/error.h"
#include "base/process.h"
#include "base/version.h"
#include "cli/base/exit_code.h"
#include "cli/options/options.h"
#include "core/utf8_path.h"
#include "gltf/micromaps/stored_micromaps.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kDetails = R"(
vellum help SUBCOMMAND, vellum SUBCOMMAND --help and the manual page vellum-SUBCOMMAND explain each. Wherever a file is
read, - is stdin. The suffix of an output must be that of its format. vellum run returns the exit code of the program that it runs.
)";

std::vector<std::string> subcommandNames(const CLI::App &app)
{
    std::vector<std::string> names;
    for (const CLI::App *subcommand : app.get_subcommands(std::function<bool(const CLI::App *)>()))
        names.push_back(subcommand->get_name());
    return names;
}

std::vector<std::string> optionNames(const CLI::App &app)
{
    std::vector<std::string> names;
    for (const CLI::Option *option : app.get_options())
        for (const std::string &name : option->get_lnames())
            names.push_back("--" + name);
    return names;
}

[[noreturn]] void rejectSubcommand(const CLI::App &app, const std::string &word)
{
    std::vector<std::string> candidates = subcommandNames(app);
    const std::vector<std::string> options = optionNames(app); // vellum version
    candidates.insert(candidates.end(), options.begin(), options.end());
    throw UsageError(word + " is not a vellum subcommand" + suggestion(word, candidates));
}

std::function<int()> declareHelpCommand(CLI::App &app)
{
    const auto wanted = std::make_shared<std::string>();
    CLI::App &command = *app.add_subcommand("help", "Explains a subcommand, or lists them");
    command.add_option("SUBCOMMAND", *wanted, "The subcommand to explain")->type_name("[SUBCOMMAND]")->group(kInput);
    command.footer("\nExamples:\n  vellum help bake\n      the same as vellum bake --help\n");
    return [&app, wanted] {
        const std::vector<std::string> names = subcommandNames(app);
        if (!wanted->empty() && std::find(names.begin(), names.end(), *wanted) == names.end())
            rejectSubcommand(app, *wanted);
        // App::help() of the whole command would be that of the subcommand that was parsed: this one.
        const CLI::App &explained = wanted->empty() ? app : *app.get_subcommand(*wanted);
        std::fputs(helpFormatter()->make_help(&explained, "", CLI::AppFormatMode::Normal).c_str(), stdout);
        return static_cast<int>(ExitCode::Success);
    };
}

// What an argument that is not expected may be due to: a file whose name begins like an option, or a value that must be
// behind "=". Empty if neither is.
std::string hintFor(const CLI::App &command, const std::string &argument, const std::vector<std::string> &line)
{
    std::error_code error;
    if (argument.starts_with('-') && std::filesystem::exists(utf8Path(argument), error))
        return "; the file of this name is ./" + argument;
    for (size_t i = 0; i + 1 < line.size(); ++i) {
        const CLI::Option *option =
            line[i].starts_with("--") && line[i] != "--" ? command.get_option_no_throw(line[i]) : nullptr;
        const bool takesValue =
            option != nullptr && option->get_expected_max() == 0 && !option->get_type_name().empty();
        if (takesValue && !line[i + 1].starts_with('-'))
            return "; a value of " + line[i] + " follows it by =: " + line[i] + "=" + line[i + 1];
    }
    return "";
}

// CLI11's errors, with the option and its range first, in one line.
std::string messageOf(const CLI::App &app, const CLI::ParseError &error, const std::vector<std::string> &line)
{
    const std::vector<CLI::App *> subcommands = app.get_subcommands();
    const CLI::App &command = subcommands.empty() ? app : *subcommands.front();
    const std::string name = subcommands.empty() ? "vellum" : "vellum " + command.get_name();
    std::string text = error.what();
    std::replace(text.begin(), text.end(), '\n', ' ');
    const size_t colon = text.find(": ");
    // Without a subcommand, CLI11 reports that first and ignores remaining words.
    const std::vector<std::string> words = app.remaining(true);
    if (dynamic_cast<const CLI::ExtrasError *>(&error) != nullptr || (subcommands.empty() && !words.empty())) {
        // An argument too many may be the value of an unknown option.
        const auto unknown = std::ranges::find_if(words, [](const std::string &w) { return w.starts_with('-'); });
        const std::string word = words.empty() ? std::string() : unknown != words.end() ? *unknown : words.front();
        const std::string option = word.substr(0, word.find('='));
        text = word.starts_with('-')
                   ? option + " is not an option of " + name + suggestion(option, optionNames(command))
                   : "unexpected argument " + word;
        text += hintFor(command, word, line);
    } else if (dynamic_cast<const CLI::ArgumentMismatch *>(&error) != nullptr && colon != std::string::npos) {
        text = text.substr(0, colon) + " takes one value";
    } else if (dynamic_cast<const CLI::ValidationError *>(&error) != nullptr && colon != std::string::npos) {
        text.replace(colon, 2, " ");
    }
    return text + " (see " + name + " --help)";
}

// CLI11 2.6 passes over a variable whose value the option does not take.
void rejectVariablesPassedOver(const CLI::App &command)
{
    for (const CLI::Option *option : command.get_options()) {
        const char *value = option->get_envname().empty() ? nullptr : std::getenv(option->get_envname().c_str());
        if (value != nullptr && *value != '\0' && option->count() == 0)
            throw UsageError(option->get_envname() + " has a value that " + option->get_name() + " does not take, " +
                             value + " (see vellum " + command.get_name() + " --help)");
    }
}

void warnOfMisspeltVariables(const CLI::App &command)
{
    for (const CLI::Option *option : command.get_options()) {
        const std::string wanted = option->get_envname();
        for (const std::string &name : wanted.empty() ? std::vector<std::string>() : variableNames())
            if (isMisspelling(name, wanted))
                std::fprintf(stderr, "vellum: warning: nothing reads %s; did you mean %s?\n", name.c_str(),
                             wanted.c_str());
    }
}

std::string versionAndLimits()
{
    std::string text = "vellum " + versionText();
    for (const std::string &format : unreadableFormats())
        text += "\nthis build cannot read " + format;
    return text;
}

} // namespace

std::map<std::string, std::function<int()>> declareCommands(CLI::App &app, const std::vector<std::string> &words)
{
    app.name("vellum");
    app.allow_windows_style_options(false); // paths begin with a slash everywhere
    app.description("Bakes, checks and shows opacity micromaps, and renders with them");
    app.formatter(helpFormatter());
    app.set_help_flag("-h,--help", "Print this help")->group(kGeneral);
    app.set_version_flag("-V,--version", versionAndLimits(),
                         "Print the version, the commit and what this build cannot read")
        ->group(kGeneral);
    app.require_subcommand(1);
    app.footer(exitStatus("") + kDetails + "\nMicromaps in glTF files are by " + kMicromapExtension + " (" +
               kMicromapDraft + ").");
    std::map<std::string, std::function<int()>> commands;
    commands["bake"] = declareBakeCommand(app);
    commands["sweep"] = declareSweepCommand(app);
    commands["inspect"] = declareInspectCommand(app);
    commands["render"] = declareRenderCommand(app);
    commands["info"] = declareInfoCommand(app);
    commands["run"] = declareRunCommand(app, words);
    commands["spirv"] = declareSpirvCommand(app);
    commands["verify"] = declareVerifyCommand(app);
    commands["bench"] = declareBenchCommand(app);
    commands["check"] = declareCheckCommand(app);
    commands["help"] = declareHelpCommand(app);
    for (CLI::App *subcommand : app.get_subcommands(std::function<bool(CLI::App *)>())) {
        subcommand->get_help_ptr()->group(kGeneral);
        subcommand->footer(subcommand->get_footer() + exitStatus(subcommand->get_name()));
    }
    return commands;
}

int runCommandLine(const std::vector<std::string> &words)
{
    CLI::App app;
    const std::map<std::string, std::function<int()>> commands = declareCommands(app, words);
    if (words.empty()) {
        std::fputs(app.help().c_str(), stderr);
        return static_cast<int>(ExitCode::Usage);
    }
    if (!words[0].starts_with('-') && !commands.contains(words[0]))
        rejectSubcommand(app, words[0]);
    try {
        app.parse(std::vector<std::string>(words.rbegin(), words.rend())); // CLI11 takes the last word first
    } catch (const CLI::Success &request) {                                // --help and --version
        return app.exit(request);
    } catch (const CLI::ParseError &error) {
        throw UsageError(messageOf(app, error, words));
    }
    const CLI::App &command = *app.get_subcommands().front();
    rejectVariablesPassedOver(command);
    if (command.get_name() != "run") // which rejects them
        warnOfMisspeltVariables(command);
    return commands.at(command.get_name())();
}

} // namespace vellum::cli
