// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/part_process.h"

#include <chrono>
#include <fmt/format.h>
#include <string_view>

#include "cli/base/system/child_process.h"

namespace vellum::cli
{
namespace
{

std::vector<std::string> argumentsOf(const Part &part, const BenchDevice &device)
{
    std::vector<std::string> words = {"bench",
                                      "--part",
                                      kPartNames[static_cast<size_t>(part.kind)],
                                      "--implementation",
                                      part.implementation,
                                      "--api",
                                      part.api == MicromapApi::Khr ? "khr" : "ext",
                                      "--trace",
                                      part.trace == Trace::Query ? "query" : "pipeline",
                                      "--seconds",
                                      fmt::format("{}", part.seconds)};
    if (device.device)
        words.insert(words.end(), {"--device", *device.device});
    if (device.layerFolder)
        words.insert(words.end(), {"--layer-path", device.layerFolder->string()});
    return words;
}

// How a part failed, in words; empty for success.
std::string failureOf(const ProcessEnd &end, const std::string &errors)
{
    if (!end.crash.empty())
        return "crashed: " + end.crash;
    if (end.code == 0)
        return {};
    const size_t last = errors.find_last_not_of('\n');
    if (last == std::string::npos)
        return fmt::format("ended with code {}", end.code);
    const size_t line = errors.rfind('\n', last);
    const size_t begin = line == std::string::npos ? 0 : line + 1;
    constexpr std::string_view kName = "vellum: "; // of the program, before a message
    const std::string message = errors.substr(begin, last + 1 - begin);
    return message.starts_with(kName) ? message.substr(kName.size()) : message;
}

} // namespace

PartResult runPartProcess(const Part &part, const BenchDevice &device, double timeout,
                          const std::function<void()> &progress)
{
    PartResult result{part, {}, {}, 0};
    const auto begin = std::chrono::steady_clock::now();
    const auto elapsed = [&] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
    ChildProcess child(argumentsOf(part, device));
    child.closeInput();
    const ChildProcess *const process = &child;
    std::string output, errors;
    std::optional<ProcessEnd> end;
    for (double last = 0; !end && elapsed() < last + timeout; progress()) {
        ChildProcess::waitForAny({&process, 1}, 200);
        end = child.end(); // first: what was written before it is read below
        child.read(output, errors);
        for (size_t line = output.find('\n'); line != std::string::npos; line = output.find('\n')) {
            const std::string row = output.substr(0, line);
            output.erase(0, line + 1);
            if (!row.starts_with("{\"row\":")) // a driver printed it
                continue;
            result.rows.push_back(row);
            last = elapsed();
        }
    }
    result.failure = end ? failureOf(*end, errors) : fmt::format("hung: no result for {:g} seconds", timeout);
    result.seconds = elapsed();
    return result;
}

} // namespace vellum::cli
