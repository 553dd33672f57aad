// SPDX-License-Identifier: Apache-2.0
#include "command.h"

#include <algorithm>

namespace vellum::test
{

int Outcome::errorLines() const
{
    const auto ended = std::count(errors.begin(), errors.end(), '\n');
    return static_cast<int>(ended) + (errors.empty() || errors.back() == '\n' ? 0 : 1);
}

bool has(const std::string &text, const std::string &part)
{
    return text.find(part) != std::string::npos;
}

std::string lineOf(const Outcome &outcome, const std::string &beginning)
{
    const std::string lines = "\n" + outcome.output;
    const size_t at = lines.find("\n" + beginning);
    if (at == std::string::npos)
        return {};
    return lines.substr(at + 1, lines.find('\n', at + 1) - at - 1);
}

} // namespace vellum::test
