// SPDX-License-Identifier: Apache-2.0
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
    // Otherwise roff takes the line for a request.
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

// Text at the margin is filled. Indented lines are terms, what is indented further explains them. A heading ends in a
// colon and begins a section.
std::string detailsOf(const std::string &details)
{
    std::string page;
    bool paragraph = false; // inside one
    for (const std::string &line : linesOf(details)) {
        const size_t indent = indentOf(line);
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

} // namespace

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

} // namespace vellum::cli
