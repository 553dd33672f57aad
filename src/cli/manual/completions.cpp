// SPDX-License-Identifier: Apache-2.0
#include "cli/manual/completions.h"

namespace vellum::cli
{
namespace
{

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

// In single quotes, with `special` characters escaped by backslashes.
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

} // namespace

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

} // namespace vellum::cli
