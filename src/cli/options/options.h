// SPDX-License-Identifier: Apache-2.0
// Options of CLI11: groups, checks of their values with messages that name the range ("must be between 0 and 1, got
// 2"), and what --help prints of them: wrapped to the width of the terminal.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bake/option_ranges.h"
#include "cli/base/exit_code.h"
#include "core/nearest.h"
#include "core/utf8_path.h"
#include "gpu/device_selection.h"

// Options of type std::filesystem::path take UTF-8. CLI11's templates look these up, and must therefore come after
// them. Their own conversion assigns the text, from which a path of Windows would take each byte as a character.
namespace CLI::detail
{

inline bool lexical_cast(const std::string &input, std::filesystem::path &output)
{
    output = vellum::utf8Path(input);
    return true;
}

inline bool lexical_cast(const std::string &input, std::optional<std::filesystem::path> &output)
{
    output = vellum::utf8Path(input);
    return true;
}

} // namespace CLI::detail

#include <CLI/CLI.hpp>

namespace vellum::cli
{

// The groups of options. Help lists them in the order in which they are declared, kGeneral last.
inline constexpr const char *kInput = "Input";
inline constexpr const char *kOutput = "Output";
inline constexpr const char *kSelection = "Selection";
inline constexpr const char *kQuality = "Quality";
inline constexpr const char *kCache = "Cache";
inline constexpr const char *kTolerances = "Tolerances";
inline constexpr const char *kPicture = "Picture";
inline constexpr const char *kDevice = "Device";
inline constexpr const char *kGeneral = "General";

// Positional arguments have the type name that usage lines show: "IN", "[OUT]".
std::shared_ptr<CLI::FormatterBase> helpFormatter();

// "vellum bake [OPTION]... IN [OUT]"
std::string usageOf(const CLI::App &app);

struct OptionGroup {
    std::string name;
    std::vector<const CLI::Option *> options;
};
std::vector<OptionGroup> optionGroups(const CLI::App &app);

// A section of help and of a manual page: "Exit status:" and the codes of a subcommand, or all of them if it is empty.
std::string exitStatus(const std::string &subcommand);

CLI::Validator between(double low, double high);
CLI::Validator atLeast(double low);
CLI::Validator finite(); // in single precision
CLI::Validator wholeBetween(uint64_t low, uint64_t high);
// The option accepts only these words. Also sets the type name to them, for completions.
void takesWords(CLI::Option &option, const std::vector<std::string> &words);

// Adds a number that a bake takes. `most`: instead of the largest that the baker accepts.
CLI::Option &addBakeNumber(CLI::App &command, const BakeNumber &number, double &value,
                           std::optional<double> most = std::nullopt);
// Adds --blend and --blend-cutoff, and returns the first.
CLI::Option &addBlendOptions(CLI::App &command, bool &blend, std::optional<float> &cutoff, const char *blendText,
                             const char *cutoffText);
// Adds --exact and kBakeTolerances, for the baker and the verifier.
void addToleranceOptions(CLI::App &command, bool &exact, const std::array<double *, 4> &values,
                         std::optional<double> most = std::nullopt);

// Add --device, --layer-path and --threads.
void addDeviceOption(CLI::App &command, gpu::DeviceSelection &device);
void addLayerPathOption(CLI::App &command, std::optional<std::filesystem::path> &folder);
void addThreadsOption(CLI::App &command, unsigned &threads);

} // namespace vellum::cli
