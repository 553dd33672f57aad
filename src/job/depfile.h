// SPDX-License-Identifier: Apache-2.0
// Files that outputs depend on, for Make and Ninja.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace vellum::job
{

// A rule of a depfile, escaped as compilers do it, and one without dependencies for each dependency, so that Make goes
// on where one no longer exists. Throws Error for a name that the syntax cannot express.
std::string depfileRule(const std::filesystem::path &output, const std::vector<std::filesystem::path> &dependencies);

} // namespace vellum::job
