// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <sys/auxv.h>

#include "cli/base/system/this_process.h"

namespace vellum::cli
{

std::vector<std::string> prepareProcess(int argc, char **argv)
{
    return {argv + (argc > 0 ? 1 : 0), argv + argc};
}

std::filesystem::path programPath()
{
    std::error_code error;
    return std::filesystem::read_symlink("/proc/self/exe", error);
}

bool environmentIsIgnored()
{
    return getauxval(AT_SECURE) != 0;
}

std::optional<std::string> variable(const char *name)
{
    const char *value = std::getenv(name);
    return value != nullptr ? std::optional<std::string>(value) : std::nullopt;
}

void setVariable(const char *name, const std::string &value)
{
    setenv(name, value.c_str(), 1);
}

} // namespace vellum::cli
