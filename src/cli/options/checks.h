// SPDX-License-Identifier: Apache-2.0
// Checks of option values, with messages that name the range: "must be between 0 and 1, got 2".
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/options/cli11.h"

namespace vellum::cli
{

CLI::Validator between(double low, double high);
CLI::Validator atLeast(double low);
CLI::Validator finite();
CLI::Validator wholeBetween(uint64_t low, uint64_t high);
// One of these words. Also sets the type name to them, for completions.
void takesWords(CLI::Option &option, const std::vector<std::string> &words);

// Adds --device, whose value chooseDevice (cli/vulkan/context.h) takes.
void addDeviceOption(CLI::App &command, std::optional<std::string> &device);

// The candidate that `word` was probably meant to be; empty if there is none.
std::string nearest(const std::string &word, const std::vector<std::string> &candidates);
// "; did you mean bake?"; empty if nothing is near.
std::string suggestion(const std::string &word, const std::vector<std::string> &candidates);

} // namespace vellum::cli
