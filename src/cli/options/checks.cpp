// SPDX-License-Identifier: Apache-2.0
#include "cli/options/checks.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numeric>

namespace vellum::cli
{
namespace
{

template <typename Number>
std::optional<Number> numberIn(const std::string &text)
{
    Number number{};
    const char *end = text.data() + text.size();
    const auto [last, error] = std::from_chars(text.data(), end, number);
    return error == std::errc() && last == end ? std::optional(number) : std::nullopt;
}

template <typename Number>
CLI::Validator numberWhere(bool (*holds)(Number number, Number low, Number high), Number low, Number high,
                           std::string rule)
{
    return CLI::Validator(
        [=](std::string &text) {
            const std::optional<Number> number = numberIn<Number>(text);
            return number && holds(*number, low, high) ? std::string() : fmt::format("must be {}, got {}", rule, text);
        },
        "");
}

// Levenshtein's.
size_t distance(const std::string &a, const std::string &b)
{
    std::vector<size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), size_t{0});
    for (size_t i = 0; i < a.size(); ++i) {
        size_t diagonal = row[0];
        row[0] = i + 1;
        for (size_t j = 0; j < b.size(); ++j) {
            const size_t replaced = diagonal + (a[i] == b[j] ? 0u : 1u);
            diagonal = row[j + 1];
            row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
        }
    }
    return row.back();
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
    return numberWhere<double>([](double n, double, double) { return std::isfinite(n); }, 0, 0, "a number");
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

void addDeviceOption(CLI::App &command, std::optional<std::string> &device)
{
    command
        .add_option(
            "-d,--device", device,
            "The Vulkan device: its number, as vellum info prints it, or a part of its name [the most powerful]")
        ->type_name("DEVICE");
}

std::string nearest(const std::string &word, const std::vector<std::string> &candidates)
{
    std::string best;
    size_t least = word.size() / 2 + 1; // beyond that it is another word
    for (const std::string &candidate : candidates) {
        const bool begins = word.size() > 1 && candidate.starts_with(word);
        const size_t away = begins ? 0 : distance(word, candidate);
        if (away < least) {
            least = away;
            best = candidate;
        }
    }
    return best;
}

std::string suggestion(const std::string &word, const std::vector<std::string> &candidates)
{
    const std::string best = nearest(word, candidates);
    return best.empty() ? "" : "; did you mean " + best + "?";
}

} // namespace vellum::cli
