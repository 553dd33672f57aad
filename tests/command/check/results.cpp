// SPDX-License-Identifier: Apache-2.0
#include "results.h"

#include <fstream>
#include <iterator>

namespace vellum::test
{

std::string textOf(const std::filesystem::path &path)
{
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::string> linesOf(const std::filesystem::path &path)
{
    std::ifstream file(path);
    std::vector<std::string> lines;
    for (std::string line; std::getline(file, line);)
        lines.push_back(line);
    return lines;
}

void writeFile(const std::filesystem::path &path, const std::string &text)
{
    std::ofstream(path, std::ios::binary) << text;
}

std::map<std::string, std::string> statusesIn(const std::filesystem::path &path)
{
    std::map<std::string, std::string> statuses;
    for (const std::string &line : linesOf(path)) {
        const size_t comma = line.find(',');
        const size_t end = line.find(',', comma + 1);
        statuses[line.substr(0, comma)] = line.substr(comma + 1, end == std::string::npos ? end : end - comma - 1);
    }
    return statuses;
}

CheckRun runCheck(const TemporaryFolder &folder, std::vector<std::string> arguments, const Environment &environment)
{
    const std::filesystem::path output = folder / "out";
    arguments.insert(arguments.begin(), "check");
    arguments.insert(arguments.end(), {"--output", output.string()});
    CheckRun run;
    run.outcome = runVellum(arguments, environment);
    run.results = statusesIn(output / "results.csv");
    run.failures = statusesIn(output / "failures.csv");
    return run;
}

} // namespace vellum::test
