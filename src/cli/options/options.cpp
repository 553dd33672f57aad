// SPDX-License-Identifier: Apache-2.0
#include "cli/options/options.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <limits>
#include <sstream>

#include "base/files.h"
#include "base/process.h"
#include "base/text.h"

namespace vellum::cli
{
namespace
{

template <typename Number>
CLI::Validator numberWhere(bool (*holds)(Number number, Number low, Number high), Number low, Number high,
                           std::string rule)
{
    return CLI::Validator(
        [=](std::string &text) {
            const std::optional<Number> number = parseNumber<Number>(text);
            return number && holds(*number, low, high) ? std::string() : fmt::format("must be {}, got {}", rule, text);
        },
        "");
}

} // namespace

CLI::Validator between(double low, double high)
{
    return numberWhere<double>([](double n, double l, double h) { return n >= l && n <= h; }, low, high,
                               fmt::format("between {} and {}", low, high));
}

CLI::Validator atLeast(double low)
{
    return numberWhere<double>([](double n, double l, double) { return n >= l && std::isfinite(n); }, low, 0,
                               fmt::format("a number of at least {}", low));
}

CLI::Validator finite()
{
    constexpr double kMost = std::numeric_limits<float>::max();
    return numberWhere<double>([](double n, double, double most) { return std::abs(n) <= most; }, 0, kMost, "a number");
}

CLI::Validator wholeBetween(uint64_t low, uint64_t high)
{
    return numberWhere<uint64_t>([](uint64_t n, uint64_t l, uint64_t h) { return n >= l && n <= h; }, low, high,
                                 fmt::format("a whole number between {} and {}", low, high));
}

void takesWords(CLI::Option &option, const std::vector<std::string> &words)
{
    std::string list;
    for (const std::string &word : words)
        list += (list.empty() ? "" : "|") + word;
    option.type_name(list);
    option.check(CLI::Validator(
        [words, list](std::string &text) {
            if (std::find(words.begin(), words.end(), text) != words.end())
                return std::string();
            return fmt::format("must be one of {}, got {}{}", list, text, suggestion(text, words));
        },
        ""));
}

CLI::Option &addBlendOptions(CLI::App &command, bool &blend, std::optional<float> &cutoff, const char *blendText,
                             const char *cutoffText)
{
    CLI::Option &option = *command.add_flag("--blend", blend, blendText);
    command.add_option("--blend-cutoff", cutoff, cutoffText)->needs(&option)->check(finite())->type_name("ALPHA");
    return option;
}

CLI::Option &addBakeNumber(CLI::App &command, const BakeNumber &number, double &value, std::optional<double> most)
{
    const double largest = most.value_or(number.most);
    return *command.add_option(number.option, value, number.help)
                ->check(largest == kAnyFinite ? atLeast(0) : between(0, largest))
                ->type_name(number.unit);
}

void addToleranceOptions(CLI::App &command, bool &exact, const std::array<double *, 4> &values,
                         std::optional<double> most)
{
    command.option_defaults()->group(kTolerances);
    CLI::Option &none = *command.add_flag("--exact", exact, "No tolerances: what is true in exact arithmetic");
    for (size_t i = 0; i < values.size(); ++i) {
        // Alphas of glTF are 0 to 1: with a tolerance of more, nothing would be known.
        const bool ofAlpha = kBakeTolerances[i].member == &BakeOptions::valueTolerance;
        addBakeNumber(command, kBakeTolerances[i], *values[i], ofAlpha && !most ? std::optional(1.0) : most)
            .excludes(&none);
    }
}

void addDeviceOption(CLI::App &command, gpu::DeviceSelection &device)
{
    command
        .add_option_function<std::string>(
            "-d,--device", [&device](const std::string &text) { device = gpu::DeviceSelection(text); },
            "The Vulkan device: its number, as vellum info prints it, or a part of its name [the most powerful]")
        ->type_name("DEVICE");
}

void addLayerPathOption(CLI::App &command, std::optional<std::filesystem::path> &folder)
{
    command
        .add_option("--layer-path", folder,
                    "Folder of the layer's manifest, instead of the one installed with this program")
        ->type_name("FOLDER");
}

void addThreadsOption(CLI::App &command, unsigned &threads)
{
    command.add_option("-j,--threads", threads, "Number of threads [one for each processor]")
        ->check(wholeBetween(0, kMostBakeThreads))
        ->type_name("COUNT");
}

namespace
{

constexpr size_t kDescriptionColumn = 28;

size_t lineWidth()
{
    size_t width = terminalWidth().value_or(80);
    if (const char *columns = std::getenv("COLUMNS"); columns != nullptr && std::atoi(columns) > 0)
        width = static_cast<size_t>(std::atoi(columns));
    return std::clamp(width, size_t{60}, size_t{100}) - 1;
}

// The words of `text` from column `indent` on, the first line at column `at`.
std::string filled(const std::string &text, size_t indent, size_t at, size_t width)
{
    std::string result;
    std::istringstream words(text);
    bool first = true;
    for (std::string word; words >> word; first = false) {
        if (!first && at + 1 + word.size() > width) {
            result += "\n" + std::string(indent, ' ');
            at = indent;
        } else if (!first) {
            result += ' ';
            ++at;
        }
        result += word;
        at += word.size();
    }
    return result;
}

// A term and its explanation, which are two spaces apart, or any other text.
std::string indentedLine(const std::string &line, size_t indent, size_t width)
{
    const size_t gap = line.find("  ", indent);
    const size_t text = gap == std::string::npos ? indent : line.find_first_not_of(' ', gap);
    return line.substr(0, text) + filled(line.substr(text), text == indent ? indent + 2 : text, text, width);
}

// Fills paragraphs. Indented lines and headings ("Examples:") stay lines.
std::string wrapped(const std::string &text, size_t width)
{
    std::string result;
    std::string paragraph;
    const auto flush = [&] {
        if (!paragraph.empty())
            result += filled(paragraph, 0, 0, width) + "\n";
        paragraph.clear();
    };
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        const size_t indent = std::min(line.find_first_not_of(' '), line.size());
        if (line.empty() || indent != 0 || line.back() == ':') {
            flush();
            result += indentedLine(line, indent, width) + "\n";
        } else {
            paragraph += line + " ";
        }
    }
    flush();
    return result;
}

std::string namesOf(const CLI::Option &option)
{
    if (option.get_positional())
        return "  " + option.get_type_name();
    std::string names;
    for (const std::string &name : option.get_snames())
        names += (names.empty() ? "  -" : ", -") + name;
    for (const std::string &name : option.get_lnames())
        names += (names.empty() ? "      --" : ", --") + name;
    return option.get_expected_max() > 0 ? names + " " + option.get_type_name() : names;
}

std::string row(const std::string &names, const std::string &description, size_t width)
{
    const bool fits = names.size() + 2 <= kDescriptionColumn;
    return names +
           (fits ? std::string(kDescriptionColumn - names.size(), ' ') : "\n" + std::string(kDescriptionColumn, ' ')) +
           filled(description, kDescriptionColumn, kDescriptionColumn, width) + "\n";
}

class HelpFormatter : public CLI::FormatterBase
{
public:
    std::string make_help(const CLI::App *app, std::string, CLI::AppFormatMode) const override
    {
        const size_t width = lineWidth();
        std::string help = filled(app->get_description(), 0, 0, width) + ".\n\n";
        help += filled("Usage: " + usageOf(*app), 7, 0, width) + "\n";
        const auto subcommands = app->get_subcommands(std::function<bool(const CLI::App *)>());
        if (!subcommands.empty())
            help += "\nSubcommands:\n";
        for (const CLI::App *subcommand : subcommands)
            help += row("  " + subcommand->get_name(), subcommand->get_description(), width);
        for (const OptionGroup &group : optionGroups(*app)) {
            help += "\n" + group.name + ":\n";
            for (const CLI::Option *option : group.options)
                help += row(namesOf(*option), option->get_description(), width);
        }
        return help + wrapped(app->get_footer(), width);
    }
};

} // namespace

std::shared_ptr<CLI::FormatterBase> helpFormatter()
{
    return std::make_shared<HelpFormatter>();
}

std::string usageOf(const CLI::App &app)
{
    if (app.get_parent() == nullptr)
        return "vellum SUBCOMMAND [OPTION]...";
    std::string usage = "vellum " + app.get_name() + " [OPTION]...";
    for (const CLI::Option *option : app.get_options())
        if (option->get_positional())
            usage += " " + option->get_type_name();
    return usage;
}

std::vector<OptionGroup> optionGroups(const CLI::App &app)
{
    std::vector<OptionGroup> groups;
    for (const CLI::Option *option : app.get_options()) {
        if (option->get_group().empty()) // hidden
            continue;
        const auto group = std::find_if(groups.begin(), groups.end(),
                                        [&](const OptionGroup &g) { return g.name == option->get_group(); });
        if (group != groups.end())
            group->options.push_back(option);
        else
            groups.push_back({option->get_group(), {option}});
    }
    std::stable_partition(groups.begin(), groups.end(), [](const OptionGroup &g) { return g.name != kGeneral; });
    return groups;
}

std::string exitStatus(const std::string &subcommand)
{
    std::vector<std::pair<std::string, std::string>> codes = exitCodesOf(subcommand);
    if (subcommand == "run") {
        const std::string ofProgram = kExitCodesOfPrograms;
        const size_t gap = ofProgram.find("  ");
        codes.insert(codes.begin(),
                     {ofProgram.substr(0, gap), ofProgram.substr(ofProgram.find_first_not_of(' ', gap))});
    }
    size_t width = 0;
    for (const auto &[code, meaning] : codes)
        width = std::max(width, code.size());
    std::string text = "\nExit status:\n";
    for (const auto &[code, meaning] : codes)
        text += fmt::format("  {:<{}}  {}\n", code, width, meaning);
    return text;
}

} // namespace vellum::cli
