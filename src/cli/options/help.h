// SPDX-License-Identifier: Apache-2.0
// What --help prints: options in groups, wrapped to the width of the terminal.
#pragma once

#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include "cli/base/exit_code.h"

namespace CLI
{
class App;
class FormatterBase;
class Option;
} // namespace CLI

namespace vellum::cli
{

// The groups of options. Help lists them in the order in which they are declared, kGeneral last.
inline constexpr const char *kInput = "Input";
inline constexpr const char *kOutput = "Output";
inline constexpr const char *kSelection = "Selection";
inline constexpr const char *kQuality = "Quality";
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

// A section of help and of a manual page: "Exit status:" and these codes; all of them for an empty list. `first`: a
// line before them, a term and its explanation.
std::string exitStatus(std::initializer_list<ExitCode> codes, const std::string &first = {});

} // namespace vellum::cli
