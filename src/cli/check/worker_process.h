// SPDX-License-Identifier: Apache-2.0
// A worker process, seen from `vellum check`.
#pragma once

#include <array>
#include <csignal>
#include <optional>
#include <string>
#include <sys/types.h>
#include <vector>

#include "cli/check/protocol.h"

namespace vellum::cli
{

// A file descriptor that is closed with it.
class Descriptor
{
public:
    explicit Descriptor(int number = -1) : number_(number) {}
    ~Descriptor() { close(); }
    Descriptor(Descriptor &&other) noexcept : number_(other.number_) { other.number_ = -1; }
    Descriptor &operator=(Descriptor &&other) noexcept;
    void close();
    [[nodiscard]] int number() const { return number_; }

private:
    int number_;
};

// A write to a worker that has ended fails instead of ending this process.
class IgnoredPipeSignal
{
public:
    IgnoredPipeSignal() : before_(std::signal(SIGPIPE, SIG_IGN)) {}
    ~IgnoredPipeSignal() { std::signal(SIGPIPE, before_); }
    IgnoredPipeSignal(const IgnoredPipeSignal &) = delete;
    IgnoredPipeSignal &operator=(const IgnoredPipeSignal &) = delete;

private:
    void (*before_)(int);
};

class WorkerProcess
{
public:
    // Starts `vellum check --worker` with these options, in a process group of its own. Throws Error.
    explicit WorkerProcess(const check::SessionOptions &options);
    // Kills it if it is still there.
    ~WorkerProcess();
    WorkerProcess(const WorkerProcess &) = delete;
    WorkerProcess &operator=(const WorkerProcess &) = delete;

    void send(const Request &request);
    // The worker ends when it has answered.
    void endRequests() { requests_.close(); }
    // With all processes that it started.
    void kill();

    // How it has ended, once it has: "SIGSEGV", "exit code 1"; empty for success. What it has written before can still
    // be read.
    [[nodiscard]] std::optional<std::string> ending() const;
    // The events that have come.
    std::vector<Event> read();
    // The end of what the driver printed since the last request.
    [[nodiscard]] const std::string &printed() const { return printed_; }

    // Readable when something has come.
    [[nodiscard]] std::array<int, 2> descriptors() const { return {events_.number(), output_.number()}; }

private:
    pid_t process_ = 0;
    Descriptor requests_;
    Descriptor events_;
    Descriptor output_;
    std::string line_; // begun
    std::string printed_;
};

// What a worker answers to a request.
struct Answer {
    std::optional<Event> event;        // no Event::Begin
    std::optional<std::string> ending; // of a process that has ended instead; neither: the time is over
};
// Waits that many seconds for the device to be open, and as many for what follows; less if vellum is interrupted.
Answer waitForAnswer(WorkerProcess &worker, double seconds);

// Of a case whose worker ended or did not end in time.
check::Outcome outcomeOfEnd(check::Status status, std::string cause, const std::string &printed);
// What became of the worker, with the failed assertion that a driver has printed.
std::string causeOfEnd(const std::string &ending, const std::string &printed);

// Waits until one of them has something to read, or for some milliseconds.
void waitForAny(const std::vector<const WorkerProcess *> &workers, int milliseconds);

} // namespace vellum::cli
