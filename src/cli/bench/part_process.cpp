// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/part_process.h"

#include <chrono>
#include <fmt/format.h>
#include <memory>
#include <rapidjson/document.h>
#include <string_view>

#include "cli/base/error.h"
#include "cli/base/paired_timing.h"
#include "cli/base/system/child_process.h"
#include "cli/base/system/interrupt.h"
#include "core/utf8_path.h"

namespace vellum::cli
{
namespace
{

constexpr size_t kMostErrors = 1 << 16; // of what is printed, the end

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
        words.insert(words.end(), {"--layer-path", utf8Text(*device.layerFolder)});
    return words;
}

// How a part failed, in words; empty for success. Other lines than the program's own may name files of the machine.
std::string failureOf(const ProcessEnd &end, const std::string &errors)
{
    if (!end.crash.empty())
        return "crashed: " + end.crash;
    if (end.code == 0)
        return {};
    const std::string_view printed = std::string_view(errors).substr(0, errors.find_last_not_of("\r\n") + 1);
    const std::string_view message = printed.substr(printed.find_last_of('\n') + 1);
    constexpr std::string_view kName = "vellum: "; // before a message
    return message.starts_with(kName) ? std::string(message.substr(kName.size()))
                                      : fmt::format("ended with code {}", end.code);
}

// Whether it is a row. A driver may print as well, in the middle of one too.
bool isRow(const std::string &line)
{
    rapidjson::Document row;
    return !row.Parse<rapidjson::kParseIterativeFlag>(line.data(), line.size()).HasParseError() && row.IsObject() &&
           row.HasMember("row") && row["row"].IsString();
}

} // namespace

PartResult runPartProcess(const Part &part, const BenchDevice &device, double timeout,
                          const std::function<void()> &progress)
{
    constexpr double kSecondsOfLook = 0.1;
    PartResult result;
    result.part = part;
    result.others = shareOfOthers(kSecondsOfLook);
    const auto begin = std::chrono::steady_clock::now();
    const auto elapsed = [&] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
    std::unique_ptr<ChildProcess> child;
    try {
        child = std::make_unique<ChildProcess>(argumentsOf(part, device));
    } catch (const Error &error) { // a limit of processes or of files
        result.failure = error.what();
        return result;
    }
    child->closeInput();
    const ChildProcess *const process = child.get();
    std::string output, errors;
    std::optional<ProcessEnd> end;
    for (double last = 0; !end && elapsed() < last + timeout && !Interruptible::interrupted(); progress()) {
        ChildProcess::waitForAny({&process, 1}, 200);
        end = child->end(); // first: what was written before it is read below
        child->read(output, errors);
        if (errors.size() > kMostErrors)
            errors.erase(0, errors.size() - kMostErrors);
        for (size_t line = output.find('\n'); line != std::string::npos; line = output.find('\n')) {
            const std::string row = output.substr(0, line);
            output.erase(0, line + 1);
            if (isRow(row))
                result.rows.push_back(row);
            else if (row != kProgressLine)
                continue; // a driver that hangs may print
            last = elapsed();
        }
    }
    if (Interruptible::interrupted()) // which may have ended the process as well
        result.failure = "interrupted";
    else
        result.failure = end ? failureOf(*end, errors) : fmt::format("hung: no progress for {:g} seconds", timeout);
    result.seconds = elapsed();
    child.reset();
    result.others = (result.others + shareOfOthers(kSecondsOfLook)) / 2;
    return result;
}

} // namespace vellum::cli
