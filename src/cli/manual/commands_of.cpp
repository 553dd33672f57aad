#include "cli/manual/commands_of.h"

#include <CLI/CLI.hpp>

#include "cli/command_line.h"

namespace vellum::cli
{
namespace
{

std::string joinLines(std::string text)
{
    for (char &c : text)
        c = c == '\n' ? ' ' : c;
    return text;
}

// "alpha|omm" -> alpha, omm; nothing for what is no such list.
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
    result.positional = result.names.empty();
    if (result.positional)
        result.value = option.get_type_name() == "TEXT" ? option.get_name(true) : option.get_type_name();
    else if (option.get_expected_max() > 0)
        result.value = option.get_type_name();
    result.words = wordsOf(result.value);
    result.many = option.get_expected_max() > 1;
    result.folder = result.value == "FOLDER";
    result.description = joinLines(option.get_description());
    return result;
}

ReferenceCommand read(const CLI::App &app, const std::string &name)
{
    ReferenceCommand command{name, app.get_description(), app.get_footer(), {}};
    for (const CLI::Option *option : app.get_options())
        if (!option->get_group().empty()) // hidden ones have none
            command.options.push_back(read(*option));
    return command;
}

} // namespace

std::vector<ReferenceCommand> readCommands()
{
    CLI::App app;
    declareCommands(app);
    std::vector<ReferenceCommand> commands = {read(app, "")};
    for (const CLI::App *subcommand : app.get_subcommands(nullptr))
        commands.push_back(read(*subcommand, subcommand->get_name()));
    return commands;
}

} // namespace vellum::cli
