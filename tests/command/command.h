// Runs the `vellum` command as its user does.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace vellum::test
{

struct Outcome {
    int exitCode = -1; // -1: ended by a signal
    std::string output;
    std::string errors;

    // Number of lines on stderr; an unfinished one counts.
    [[nodiscard]] int errorLines() const;
};

// Runs it with these arguments, and these variables added to the environment.
Outcome runVellum(const std::vector<std::string> &arguments,
                  const std::vector<std::pair<std::string, std::string>> &environment = {});

} // namespace vellum::test
