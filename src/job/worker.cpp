// SPDX-License-Identifier: Apache-2.0
#include "job/worker.h"

#include <exception>
#include <iostream>

#include "base/error.h"
#include "base/json_writer.h"

namespace vellum::job
{
namespace
{

constexpr size_t kMostPrinted = 4096;

} // namespace

void Worker::send(const std::string &request)
{
    printed_.clear();
    process_.write(request + "\n");
}

std::vector<std::string> Worker::read()
{
    process_.read(line_, printed_);
    if (printed_.size() > kMostPrinted)
        printed_.erase(0, printed_.size() - kMostPrinted);
    std::vector<std::string> lines;
    size_t begin = 0;
    for (size_t end = line_.find('\n'); end != std::string::npos; end = line_.find('\n', begin)) {
        lines.push_back(line_.substr(begin, end - begin));
        begin = end + 1;
    }
    line_.erase(0, begin);
    return lines;
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

int answerRequests(const std::function<void(const std::string &request, Events &events)> &answer)
{
    endWithParent();
    Events events;
    bool asked = false;
    for (std::string line; std::getline(std::cin, line); asked = true) {
        try {
            answer(line, events);
        } catch (const std::exception &error) {
            events.send(errorEvent(error.what()));
            return 1;
        }
    }
    if (!asked)
        throw UsageError("--worker is for vellum itself");
    return 0;
}

} // namespace vellum::job
