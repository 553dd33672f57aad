// SPDX-License-Identifier: Apache-2.0
#include "job/worker.h"

#include <exception>
#include <iostream>

#include "base/error.h"
#include "base/json_reader.h"
#include "base/json_writer.h"

namespace vellum::job
{
namespace
{

constexpr size_t kMostPrinted = 4096;
constexpr std::string_view kErrorEvent = R"({"event":"error")";

// The failed assertion that a driver printed; empty if there is none.
std::string assertionIn(const std::string &printed)
{
    for (const char *word : {"Assertion ", "assertion "}) {
        const size_t at = printed.rfind(word);
        if (at == std::string::npos)
            continue;
        const size_t line = printed.rfind('\n', at);
        const size_t begin = line == std::string::npos ? 0 : line + 1;
        return printed.substr(begin, printed.find('\n', at) - begin);
    }
    return {};
}

} // namespace

void Worker::send(const std::string &request)
{
    printed_.clear();
    process_.write(request + "\n");
}

Worker::Output Worker::read()
{
    Output output{{}, process_.end()}; // first: the output before the end is then read below
    process_.read(line_, printed_);
    if (printed_.size() > kMostPrinted)
        printed_.erase(0, printed_.size() - kMostPrinted);
    size_t begin = 0;
    for (size_t end = line_.find('\n'); end != std::string::npos; end = line_.find('\n', begin)) {
        output.lines.push_back(line_.substr(begin, end - begin));
        begin = end + 1;
    }
    line_.erase(0, begin);
    return output;
}

std::string Worker::causeOf(const ProcessEnd &end) const
{
    const std::string assertion = assertionIn(printed_);
    return (end.text().empty() ? "exit code 0" : end.text()) + (assertion.empty() ? "" : ": " + assertion);
}

void Worker::startWaiting()
{
    waitingSince_ = std::chrono::steady_clock::now();
    waitedBefore_ = process_.waitedForProcessor();
}

bool Worker::isLate(double seconds) const
{
    constexpr double kMostTimes = 5;
    const double passed = std::chrono::duration<double>(std::chrono::steady_clock::now() - waitingSince_).count();
    return passed > seconds &&
           (passed > kMostTimes * seconds || passed - (process_.waitedForProcessor() - waitedBefore_) > seconds);
}

void Events::send(const std::string &event)
{
    output_.write(event + "\n");
    output_.finish();
}

std::string errorEvent(std::string_view message)
{
    JsonWriter json(JsonStyle::Compact);
    return json.beginObject().member("event", "error").member("message", message).end().text();
}

std::optional<std::string> errorIn(const std::string &line)
{
    if (!line.starts_with(kErrorEvent))
        return std::nullopt;
    try {
        return JsonReader(line).text("message");
    } catch (const Error &) {
        return std::nullopt;
    }
}

int answerRequests(const std::function<void(const std::string &request, Events &events)> &answer)
{
    endWithParent();
    Events events;
    bool hasRequest = false;
    for (std::string line; std::getline(std::cin, line); hasRequest = true) {
        try {
            answer(line, events);
        } catch (const std::exception &error) {
            events.send(errorEvent(error.what()));
            return 1;
        }
    }
    if (!hasRequest)
        throw UsageError("--worker is for vellum itself");
    return 0;
}

} // namespace vellum::job
