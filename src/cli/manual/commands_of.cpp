// SPDX-License-Identifier: Apache-2.0
#include "cli/manual/commands_of.h"

#include "cli/command_line.h"
#include "cli/options/cli11.h"
#include "cli/options/help.h"

namespace vellum::cli
{
namespace
{

// "alpha|omm" -> alpha, omm; empty for anything else.
std::vector<std::string> wordsOf(const std::string &value)
{
    std::vector<std::string> words;
    if (value.find('|') == std::string::npos)
        return words;
    size_t begin = 0;
    while (begin <= value.size()) {
        const size_t end = std::min(value.find('|', begin), value.size());
        words.push_back(value.substr(begin, end - begin));
        begin = end + 1;
    }
    return words;
}

ReferenceOption read(const CLI::Option &option)
{
    ReferenceOption result;
    for (const std::string &name : option.get_snames())
        result.names.push_back("-" + name);
    for (const std::string &name : option.get_lnames())
        result.names.push_back("--" + name);
    result.positional = option.get_positional();
    if (result.positional || option.get_expected_max() > 0)
        result.value = option.get_type_name();
    result.words = wordsOf(result.value);
    result.folder = result.value == "FOLDER";
    result.description = option.get_description();
    return result;
}

ReferenceCommand read(const CLI::App &app, const std::string &name)
{
    ReferenceCommand command{name, usageOf(app), app.get_description(), app.get_footer(), {}};
    for (const OptionGroup &group : optionGroups(app)) {
        ReferenceGroup &read = command.groups.emplace_back();
        read.name = group.name;
        for (const CLI::Option *option : group.options)
            read.options.push_back(cli::read(*option));
    }
    return command;
}

} // namespace

std::vector<ReferenceOption> ReferenceCommand::options() const
{
    std::vector<ReferenceOption> all;
    for (const ReferenceGroup &group : groups)
        all.insert(all.end(), group.options.begin(), group.options.end());
    return all;
}

std::vector<ReferenceCommand> readCommands()
{
    CLI::App app;
    declareCommands(app, {});
    std::vector<ReferenceCommand> commands = {read(app, "")};
    for (const CLI::App *subcommand : app.get_subcommands(nullptr))
        commands.push_back(read(*subcommand, subcommand->get_name()));
    // The words of `vellum help`.
    for (ReferenceCommand &command : commands)
        for (ReferenceGroup &group : command.groups)
            for (ReferenceOption &option : group.options)
                if (option.value == "[SUBCOMMAND]")
                    for (size_t i = 1; i < commands.size(); ++i)
                        option.words.push_back(commands[i].name);
    return commands;
}

} // namespace vellum::cli
