#include "cli/manual/man_page.h"

#include <algorithm>
#include <cctype>

namespace vellum::cli
{
namespace
{

std::string escaped(const std::string &text)
{
    std::string result;
    for (const char c : text)
        result += c == '\\' ? std::string("\\e") : c == '-' ? std::string("\\-") : std::string(1, c);
    // Not to be taken for a request.
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

std::vector<std::string> linesOf(const std::string &text)
{
    std::vector<std::string> lines;
    size_t begin = 0;
    while (begin < text.size()) {
        const size_t end = std::min(text.find('\n', begin), text.size());
        lines.push_back(text.substr(begin, end - begin));
        begin = end + 1;
    }
    return lines;
}

size_t indentOf(const std::string &line)
{
    return std::min(line.find_first_not_of(' '), line.size());
}

// Text at the margin is filled; what is indented is an example, and what is indented further says what it does.
std::string detailsOf(const std::string &details)
{
    std::string page;
    bool paragraph = false; // inside of one
    for (const std::string &line : linesOf(details)) {
        const size_t indent = indentOf(line);
        const std::string text = line.substr(indent);
        if (text.empty()) {
            paragraph = false;
            continue;
        }
        if (indent == 0) {
            page += paragraph ? "" : ".PP\n";
            page += escaped(text) + "\n";
            paragraph = true;
        } else {
            page += indent < 4 ? ".TP\n" + bold(text) + "\n" : escaped(text) + "\n";
            paragraph = false;
        }
    }
    return page;
}

std::string synopsisOf(const ReferenceCommand &command)
{
    std::string line = ".B vellum " + command.name + "\n";
    if (command.name.empty())
        return ".B vellum\n" + italic("subcommand") + " [" + italic("option") + "...]\n";
    line += "[" + italic("option") + "...]";
    for (const ReferenceOption &option : command.options)
        if (option.positional)
            line += " [" + italic(option.value) + (option.many ? "...]" : "]");
    return line + "\n";
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

} // namespace

std::string manPage(const std::vector<ReferenceCommand> &commands, const std::string &version, const std::string &date)
{
    const ReferenceCommand &own = commands.front();
    std::string page = ".TH VELLUM 1 \"" + date + "\" \"vellum " + version + "\" \"User Commands\"\n";
    page += ".SH NAME\nvellum \\- opacity micromaps for every device that traces rays\n.SH SYNOPSIS\n";
    for (size_t i = 0; i < commands.size(); ++i)
        page += (i == 0 ? "" : ".br\n") + synopsisOf(commands[i]);
    page += ".SH DESCRIPTION\n" + escaped(own.description) + "\nIts subcommands:\n";
    for (size_t i = 1; i < commands.size(); ++i)
        page += ".TP\n" + bold(commands[i].name) + "\n" + escaped(commands[i].description) + "\n";
    page += ".SH OPTIONS\n";
    for (const ReferenceOption &option : own.options)
        page += optionOf(option);
    for (size_t i = 1; i < commands.size(); ++i) {
        page += ".SH VELLUM " + upper(commands[i].name) + "\n" + escaped(commands[i].description) + ".\n";
        for (const ReferenceOption &option : commands[i].options)
            page += optionOf(option);
        page += detailsOf(commands[i].details);
    }
    return page;
}

} // namespace vellum::cli
