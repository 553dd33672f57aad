// SPDX-License-Identifier: Apache-2.0
#include "cli/base/variables.h"

#include "base/process.h"
#include "layer/base/setting_names.h"

namespace vellum::cli
{

std::vector<std::string> misspeltVariables()
{
    std::vector<std::string> problems;
    for (const std::string &name : variableNames())
        for (const std::string_view prefix : {"VK_VELLUM_OPACITY_MICROMAP_", "VK_VELLUM_", "VELLUM_"})
            if (name.starts_with(prefix)) {
                const auto isNear = [key = std::string_view(name).substr(prefix.size())](const std::string &known) {
                    return isMisspelling(key, known);
                };
                std::string problem = layer::problemOfVariable(name, prefix);
                if (!problem.empty() && std::ranges::any_of(layer::variableKeys(prefix), isNear))
                    problems.push_back(std::move(problem));
                break;
            }
    return problems;
}

} // namespace vellum::cli
