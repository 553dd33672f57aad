// SPDX-License-Identifier: Apache-2.0
// What the system knows about this process. All texts are UTF-8.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vellum::cli
{

// To be called first in main. Returns the arguments, without the program's name.
std::vector<std::string> prepareProcess(int argc, char **argv);

// Of the program's file. Empty if it is not known.
std::filesystem::path programPath();

// Whether Vulkan's loader and the layer ignore the environment and what is registered for the user, in this process and
// in those that it starts: if it has more rights than its user's programs usually have.
bool environmentIsIgnored();

// Of the environment.
std::optional<std::string> variable(const char *name);
void setVariable(const char *name, const std::string &value);
// What is between the parts of a variable that is a list.
#ifdef _WIN32
inline constexpr char kListSeparator = ';';
#else
inline constexpr char kListSeparator = ':';
#endif
// The parts of such a list that are not empty.
std::vector<std::string> listOf(const std::string &value);

} // namespace vellum::cli
