// SPDX-License-Identifier: Apache-2.0
#include "cli/check/worker_process.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <utility>

#include "cli/base/error.h"
#include "cli/base/interrupt.h"
#include "cli/check/case_id.h"
#include "cli/check/worker.h"

namespace vellum::cli
{
namespace
{

constexpr size_t kMostPrinted = 4096;
constexpr int kMillisecondsOfWaiting = 20;

struct Pipe {
    Descriptor reading;
    Descriptor writing;
};

// Neither end has one of the numbers that the worker's descriptors get.
Pipe makePipe()
{
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0)
        throw Error("no pipe can be made: " + std::string(std::strerror(errno)));
    const Descriptor first(ends[0]);
    const Descriptor second(ends[1]);
    Pipe pipe{Descriptor(fcntl(ends[0], F_DUPFD_CLOEXEC, 10)), Descriptor(fcntl(ends[1], F_DUPFD_CLOEXEC, 10))};
    if (pipe.reading.number() < 0 || pipe.writing.number() < 0)
        throw Error("no pipe can be made: " + std::string(std::strerror(errno)));
    return pipe;
}

// Reads what there is. Closes the descriptor at the end of what it has.
void readInto(Descriptor &descriptor, std::string &text)
{
    char buffer[65536];
    while (descriptor.number() >= 0) {
        const ssize_t count = ::read(descriptor.number(), buffer, sizeof buffer);
        if (count > 0)
            text.append(buffer, static_cast<size_t>(count));
        else if (count == 0)
            descriptor.close();
        else if (errno != EINTR)
            return;
    }
}

std::string nameOfSignal(int signal)
{
    const char *name = sigabbrev_np(signal);
    return name != nullptr ? std::string("SIG") + name : "signal " + std::to_string(signal);
}

pid_t spawn(std::vector<std::string> words, const Descriptor &requests, const Descriptor &events,
            const Descriptor &output)
{
    std::vector<char *> arguments;
    for (std::string &word : words)
        arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, requests.number(), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, output.number(), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files, output.number(), STDERR_FILENO);
    posix_spawn_file_actions_adddup2(&files, events.number(), kEventDescriptor);
    sigset_t ignored;
    sigemptyset(&ignored);
    sigaddset(&ignored, SIGPIPE);
    sigaddset(&ignored, SIGXFSZ);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setsigdefault(&attributes, &ignored);
    pid_t process = 0;
    const int error = posix_spawn(&process, "/proc/self/exe", &files, &attributes, arguments.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    if (error != 0)
        throw Error("no worker process can be started: " + std::string(std::strerror(error)));
    return process;
}

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

Descriptor &Descriptor::operator=(Descriptor &&other) noexcept
{
    std::swap(number_, other.number_);
    return *this;
}

void Descriptor::close()
{
    if (number_ >= 0)
        ::close(number_);
    number_ = -1;
}

WorkerProcess::WorkerProcess(const check::SessionOptions &options)
{
    Pipe requests = makePipe();
    Pipe events = makePipe();
    Pipe output = makePipe();
    std::vector<std::string> words = {"vellum", "check", "--worker", "--api", nameOf(options.api)};
    if (options.device)
        words.insert(words.end(), {"--device", *options.device});
    if (!options.layer)
        words.emplace_back("--no-layer");
    process_ = spawn(std::move(words), requests.reading, events.writing, output.writing);
    requests_ = std::move(requests.writing);
    events_ = std::move(events.reading);
    output_ = std::move(output.reading);
    fcntl(events_.number(), F_SETFL, O_NONBLOCK);
    fcntl(output_.number(), F_SETFL, O_NONBLOCK);
}

WorkerProcess::~WorkerProcess()
{
    kill();
    // A process that hangs in the kernel cannot be waited for.
    for (int i = 0; i < 500 && waitpid(process_, nullptr, WNOHANG) == 0; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

void WorkerProcess::send(const Request &request)
{
    printed_.clear();
    const std::string line = write(request) + "\n";
    // A worker that has ended shows it by ending(). Requests are shorter than a pipe's buffer.
    if (::write(requests_.number(), line.data(), line.size()) < 0)
        requests_.close();
}

void WorkerProcess::kill()
{
    ::kill(-process_, SIGKILL);
}

std::optional<std::string> WorkerProcess::ending() const
{
    siginfo_t info{};
    // The process keeps its number until the destructor, so that kill() can end what it has left.
    if (waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid == 0)
        return std::nullopt;
    if (info.si_code != CLD_EXITED)
        return nameOfSignal(info.si_status);
    return info.si_status == 0 ? std::string() : "exit code " + std::to_string(info.si_status);
}

std::vector<Event> WorkerProcess::read()
{
    readInto(output_, printed_);
    if (printed_.size() > kMostPrinted)
        printed_.erase(0, printed_.size() - kMostPrinted);
    readInto(events_, line_);
    std::vector<Event> events;
    for (size_t end = line_.find('\n'); end != std::string::npos; end = line_.find('\n')) {
        try {
            events.push_back(parseEvent(line_.substr(0, end)));
        } catch (const Error &) { // a driver writes where it should not
        }
        line_.erase(0, end + 1);
    }
    return events;
}

std::string causeOfEnd(const std::string &ending, const std::string &printed)
{
    const std::string assertion = assertionIn(printed);
    return (ending.empty() ? "exit code 0" : ending) + (assertion.empty() ? "" : ": " + assertion);
}

check::Outcome outcomeOfEnd(check::Status status, std::string cause, const std::string &printed)
{
    check::Outcome outcome;
    outcome.status = status;
    outcome.cause = std::move(cause);
    if (printed.empty())
        return outcome;
    outcome.detail = "The last output was:\n";
    for (const char c : printed)
        outcome.detail += (c >= ' ' && c <= '~') || c == '\n' || c == '\t' ? c : '?';
    return outcome;
}

Answer waitForAnswer(WorkerProcess &worker, double seconds)
{
    using Clock = std::chrono::steady_clock;
    Clock::time_point begin = Clock::now();
    while (std::chrono::duration<double>(Clock::now() - begin).count() < seconds && !Interruptible::interrupted()) {
        waitForAny({&worker}, kMillisecondsOfWaiting);
        const std::optional<std::string> ending = worker.ending(); // first: what was written before it is read below
        for (const Event &event : worker.read()) {
            if (event.kind != Event::Kind::Begin)
                return {event, {}};
            begin = Clock::now();
        }
        if (ending)
            return {{}, ending};
    }
    return {};
}

void waitForAny(const std::vector<const WorkerProcess *> &workers, int milliseconds)
{
    std::vector<pollfd> descriptors;
    for (const WorkerProcess *worker : workers)
        for (const int descriptor : worker->descriptors())
            descriptors.push_back({descriptor, POLLIN, 0});
    poll(descriptors.data(), descriptors.size(), milliseconds);
}

} // namespace vellum::cli
