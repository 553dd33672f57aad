// SPDX-License-Identifier: Apache-2.0
#include "cli/base/variables.h"

#include "base/process.h"
#include "layer/base/setting_names.h"

namespace vellum::cli
{

std::vector<std::string> problemsOfVariables()
{
    std::vector<std::string> problems;
    for (const std::string &name : variableNames())
        for (const char *prefix : {"VK_VELLUM_OPACITY_MICROMAP_", "VK_VELLUM_", "VELLUM_"})
            if (name.starts_with(prefix)) {
                if (std::string problem = layer::problemOfVariable(name, prefix); !problem.empty())
                    problems.push_back(std::move(problem));
                break;
            }
    return problems;
}

} // namespace vellum::cli
