// SPDX-License-Identifier: Apache-2.0
// Writes the manual pages and the completions of shells into a folder, at build time, made from the declarations that
// parse the command line: vellum-reference FOLDER VERSION DATE
#include <algorithm>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "base/text.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "core/utf8_path.h"

namespace vellum::cli
{
namespace
{

struct ReferenceOption {
    std::vector<std::string> names; // "-m", "--mode"; of a positional argument none
    std::string value;              // the operand: "WxH"; empty for a flag
    std::vector<std::string> words; // the values that it takes, if these are all
    std::string description;
    bool positional = false;
    bool folder = false; // takes a folder
};

struct ReferenceGroup {
    std::string name; // "Output"
    std::vector<ReferenceOption> options;
};

struct ReferenceCommand {
    std::string name; // "render"; empty for the command itself
    std::string usage;
    std::string description;
    std::string details; // printed by --help below the options
    std::vector<ReferenceGroup> groups;

    [[nodiscard]] std::vector<ReferenceOption> options() const; // of all groups
};

struct ManEdition {
    std::string version;
    std::string date; // 2026-01-31
};

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
    if (result.value.find('|') != std::string::npos) // "alpha|omm"
        result.words = partsOf(result.value, '|');
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

std::vector<ReferenceOption> ReferenceCommand::options() const
{
    std::vector<ReferenceOption> all;
    for (const ReferenceGroup &group : groups)
        all.insert(all.end(), group.options.begin(), group.options.end());
    return all;
}

// The command itself first, then its subcommands in their order.
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

std::string joined(const std::vector<std::string> &words, const std::string &between)
{
    std::string text;
    for (const std::string &word : words)
        text += (text.empty() ? "" : between) + word;
    return text;
}

std::vector<std::string> optionNames(const ReferenceCommand &command)
{
    std::vector<std::string> names;
    for (const ReferenceOption &option : command.options())
        names.insert(names.end(), option.names.begin(), option.names.end());
    return names;
}

std::vector<std::string> subcommandNames(const std::vector<ReferenceCommand> &commands)
{
    std::vector<std::string> names;
    for (size_t i = 1; i < commands.size(); ++i)
        names.push_back(commands[i].name);
    return names;
}

// The text in single quotes, with `special` characters escaped by backslashes.
std::string quoted(const std::string &text, const std::string &special = "")
{
    std::string result = "'";
    for (const char c : text) {
        if (special.find(c) != std::string::npos)
            result += '\\';
        result += c == '\'' ? std::string("'\\''") : std::string(1, c);
    }
    return result + "'";
}

// The first sentence, for one line.
std::string shortened(const std::string &description)
{
    const size_t end = std::min(description.find(". "), description.find(": "));
    return description.substr(0, std::min(end, description.size()));
}

// The specification of an option or an operand for _arguments.
std::string zshArgument(const ReferenceOption &option)
{
    const std::string action = option.folder          ? "_files -/"
                               : option.words.empty() ? "_files"
                                                      : "(" + joined(option.words, " ") + ")";
    if (option.positional)
        return quoted("*:" + option.value + ":" + action);
    const std::string text = "[" + shortened(option.description) + "]";
    const std::string value = option.value.empty() ? "" : ":" + option.value + ":" + action;
    std::string list;
    for (const std::string &name : option.names) {
        std::string escaped;
        for (const char c : text)
            escaped += (c == ':' ? std::string("\\:") : std::string(1, c));
        list += (list.empty() ? "" : " \\\n            ") + quoted(name + escaped + value);
    }
    return list;
}

std::string bashCompletion(const std::vector<ReferenceCommand> &commands)
{
    std::string script = "# Completion of vellum for bash, made from its options when it was built.\n"
                         "_vellum()\n{\n"
                         "    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}\n"
                         "    local subcommand= word\n"
                         "    for word in \"${COMP_WORDS[@]:1:COMP_CWORD - 1}\"; do\n"
                         "        case $word in\n        " +
                         joined(subcommandNames(commands), "|") +
                         ") subcommand=$word; break ;;\n        esac\n    done\n"
                         "    COMPREPLY=()\n    case \"$subcommand $previous\" in\n";
    for (const ReferenceCommand &command : commands) {
        for (const ReferenceOption &option : command.options()) {
            if (option.value.empty() || option.positional)
                continue;
            std::vector<std::string> patterns;
            for (const std::string &name : option.names)
                patterns.push_back("\"" + command.name + " " + name + "\"");
            // Without words the shell completes files.
            const std::string reply = option.folder          ? "COMPREPLY=($(compgen -d -- \"$current\")); "
                                      : option.words.empty() ? ""
                                                             : "COMPREPLY=($(compgen -W \"" +
                                                                   joined(option.words, " ") + "\" -- \"$current\")); ";
            script += "    " + joined(patterns, "|") + ") " + reply + "return ;;\n";
        }
    }
    script += "    esac\n    case $subcommand in\n";
    for (const ReferenceCommand &command : commands)
        script += "    " + (command.name.empty() ? std::string("''") : command.name) + ") word=\"" +
                  joined(optionNames(command), " ") + "\" ;;\n";
    script += "    esac\n    if [[ $current != -* && $subcommand == help ]]; then\n"
              "        COMPREPLY=($(compgen -W \"" +
              joined(subcommandNames(commands), " ") +
              "\" -- \"$current\"))\n"
              "    elif [[ $current == -* ]]; then\n"
              "        COMPREPLY=($(compgen -W \"$word\" -- \"$current\"))\n"
              "    elif [[ -z $subcommand ]]; then\n"
              "        COMPREPLY=($(compgen -W \"" +
              joined(subcommandNames(commands), " ") +
              "\" -- \"$current\"))\n    fi\n}\ncomplete -o default -F _vellum vellum\n";
    return script;
}

std::string zshCompletion(const std::vector<ReferenceCommand> &commands)
{
    std::string script = "#compdef vellum\n# Completion of vellum for zsh, made from its options when it was built.\n"
                         "_vellum() {\n    local -a subcommands\n    subcommands=(\n";
    for (size_t i = 1; i < commands.size(); ++i)
        script += "        " + quoted(commands[i].name + ":" + commands[i].description) + "\n";
    script += "    )\n    if (( CURRENT == 2 )); then\n";
    script += "        _arguments ";
    for (const ReferenceOption &option : commands.front().options())
        script += "\\\n            " + zshArgument(option) + " ";
    script += "\\\n            '1:subcommand:->subcommand'\n"
              "        [[ $words[2] == -* ]] || _describe subcommand subcommands\n        return\n    fi\n"
              "    local subcommand=$words[2]\n    shift words\n    (( CURRENT-- ))\n    case $subcommand in\n";
    for (size_t i = 1; i < commands.size(); ++i) {
        script += "    " + commands[i].name + ")\n        _arguments ";
        for (const ReferenceOption &option : commands[i].options())
            script += "\\\n            " + zshArgument(option) + " ";
        script += "\n        ;;\n";
    }
    return script + "    esac\n}\n_vellum \"$@\"\n";
}

std::string fishCompletion(const std::vector<ReferenceCommand> &commands)
{
    std::string script = "# Completion of vellum for fish, made from its options when it was built.\n";
    const std::string all = joined(subcommandNames(commands), " ");
    for (size_t i = 1; i < commands.size(); ++i)
        script += "complete -c vellum -f -n \"not __fish_seen_subcommand_from " + all + "\" -a " + commands[i].name +
                  " -d " + quoted(commands[i].description, "\\") + "\n";
    for (const ReferenceCommand &command : commands) {
        const std::string when = command.name.empty() ? "not __fish_seen_subcommand_from " + all
                                                      : "__fish_seen_subcommand_from " + command.name;
        for (const ReferenceOption &option : command.options()) {
            if (option.positional && option.words.empty())
                continue;
            script += "complete -c vellum -n \"" + when + "\"";
            for (const std::string &name : option.names)
                script += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
            if (!option.words.empty())
                script += " -x -a " + quoted(joined(option.words, " "));
            else if (option.folder)
                script += " -x -a \"(__fish_complete_directories)\"";
            else if (!option.value.empty())
                script += " -r";
            script += " -d " + quoted(shortened(option.description), "\\") + "\n";
        }
    }
    return script;
}

std::string escaped(const std::string &text)
{
    std::string result;
    for (const char c : text)
        result += c == '\\' ? std::string("\\e") : c == '-' ? std::string("\\-") : std::string(1, c);
    // Otherwise roff would interpret the line as a request.
    if (!result.empty() && (result.front() == '.' || result.front() == '\''))
        result.insert(0, "\\&");
    return result;
}

std::string bold(const std::string &text)
{
    return "\\fB" + escaped(text) + "\\fR";
}

std::string italic(const std::string &text)
{
    return "\\fI" + escaped(text) + "\\fR";
}

std::string upper(std::string text)
{
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return text;
}

// Text at the margin is filled. Indented lines are terms, what is indented further explains them. A heading ends in a
// colon and begins a section.
std::string detailsOf(const std::string &details)
{
    std::string page;
    bool paragraph = false; // inside one
    std::istringstream lines(details);
    for (std::string line; std::getline(lines, line);) {
        const size_t indent = std::min(line.find_first_not_of(' '), line.size());
        const std::string text = line.substr(indent);
        const size_t gap = text.find("  ");
        if (text.empty()) {
            paragraph = false;
        } else if (indent == 0 && text.back() == ':') {
            page += ".SH " + upper(text.substr(0, text.size() - 1)) + "\n";
        } else if (indent == 0) {
            page += (paragraph ? "" : ".PP\n") + escaped(text) + "\n";
            paragraph = true;
        } else if (indent < 4 && gap != std::string::npos) { // a term with its explanation in one line
            page += ".TP\n" + bold(text.substr(0, gap)) + "\n" +
                    escaped(text.substr(text.find_first_not_of(' ', gap))) + "\n";
        } else {
            page += indent < 4 ? ".TP\n" + bold(text) + "\n" : escaped(text) + "\n";
            paragraph = false;
        }
    }
    return page;
}

std::string optionOf(const ReferenceOption &option)
{
    std::string heading;
    for (const std::string &name : option.names)
        heading += (heading.empty() ? "" : ", ") + bold(name);
    if (!option.value.empty())
        heading += (heading.empty() ? "" : " ") + italic(option.value);
    return ".TP\n" + heading + "\n" + escaped(option.description) + "\n";
}

std::string titleOf(const std::string &name, const ManEdition &edition)
{
    return ".TH " + upper(name) + " 1 \"" + edition.date + "\" \"vellum " + edition.version + "\" \"User Commands\"\n";
}

// The usage line with its first words in bold.
std::string synopsisOf(const ReferenceCommand &command)
{
    const size_t end = command.usage.find(" [OPTION]");
    return bold(command.usage.substr(0, end)) + escaped(command.usage.substr(end)) + "\n";
}

std::string optionsOf(const ReferenceCommand &command)
{
    std::string page = ".SH OPTIONS\n";
    for (const ReferenceGroup &group : command.groups) {
        page += ".SS " + group.name + "\n";
        for (const ReferenceOption &option : group.options)
            page += optionOf(option);
    }
    return page;
}

constexpr const char *kFiles = ".SH FILES\n"
                               ".TP\n\\fIprefix\\fR/share/vulkan/explicit_layer.d/\n"
                               "The manifest of the layer, found relative to the program.\n"
                               ".TP\n\\fIprefix\\fR/share/vellum/schema.json\n"
                               "The JSON Schema of all reports that \\fB\\-\\-json\\fR prints.\n";

std::string seeAlso(const std::vector<ReferenceCommand> &commands, const ReferenceCommand &except)
{
    std::string page = ".SH SEE ALSO\n";
    std::string separator;
    for (const ReferenceCommand &command : commands)
        if (&command != &except && command.name != "help") {
            page += separator + ".BR " + escaped(command.name.empty() ? "vellum" : "vellum-" + command.name) + " (1)";
            separator = ",\n";
        }
    return page + separator + ".BR VK_LAYER_VELLUM_opacity_micromap (7)\n";
}

// vellum.1
std::string manPage(const std::vector<ReferenceCommand> &commands, const ManEdition &edition)
{
    const ReferenceCommand &own = commands.front();
    std::string page = titleOf("vellum", edition);
    page += ".SH NAME\nvellum \\- opacity micromaps for Vulkan and glTF\n.SH SYNOPSIS\n";
    for (size_t i = 0; i < commands.size(); ++i)
        page += (i == 0 ? "" : ".br\n") + synopsisOf(commands[i]);
    page += ".SH DESCRIPTION\n" + escaped(own.description) + ".\n";
    for (size_t i = 1; i < commands.size(); ++i)
        page += ".TP\n" + bold(commands[i].name) + "\n" + escaped(commands[i].description) + "\n";
    return page + optionsOf(own) + detailsOf(own.details) + kFiles + seeAlso(commands, own);
}

// vellum-bake.1 and so on: of commands[number].
std::string manPageOf(const std::vector<ReferenceCommand> &commands, size_t number, const ManEdition &edition)
{
    const ReferenceCommand &command = commands.at(number);
    const std::string name = "vellum-" + command.name;
    // The prose of the details precedes their first section.
    const size_t sections = std::min(command.details.find("\n\nE"), command.details.size());
    std::string page = titleOf(name, edition);
    page += ".SH NAME\n" + escaped(name) + " \\- " + escaped(command.description) + "\n";
    page += ".SH SYNOPSIS\n" + synopsisOf(command);
    page += ".SH DESCRIPTION\n" + escaped(command.description) + ".\n" + detailsOf(command.details.substr(0, sections));
    page += optionsOf(command) + detailsOf(command.details.substr(sections));
    return page + kFiles + seeAlso(commands, command);
}

} // namespace
} // namespace vellum::cli

int main(int argc, char **argv)
{
    using namespace vellum::cli;
    if (argc != 4) {
        std::fprintf(stderr, "usage: vellum-reference FOLDER VERSION DATE\n");
        return 1;
    }
    const std::filesystem::path folder = argv[1];
    bool written = true;
    const auto write = [&](const std::string &name, const std::string &text) {
        std::ofstream file(folder / name, std::ios::binary);
        file << text;
        file.close();
        if (!file)
            std::fprintf(stderr, "%s cannot be written\n", vellum::utf8Text(folder / name).c_str());
        written = written && !file.fail();
    };
    const std::vector<ReferenceCommand> commands = readCommands();
    const ManEdition edition{argv[2], argv[3]};
    for (size_t i = 1; i < commands.size(); ++i)
        if (commands[i].name != "help")
            write("vellum-" + commands[i].name + ".1", manPageOf(commands, i, edition));
    write("vellum.1", manPage(commands, edition));
    write("vellum.bash", bashCompletion(commands));
    write("_vellum", zshCompletion(commands));
    write("vellum.fish", fishCompletion(commands));
    return written ? 0 : 1;
}
