// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/part_process.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "cli/base/error.h"

namespace vellum::cli
{
namespace
{

std::vector<std::string> wordsOf(const Part &part, const BenchDevice &device)
{
    std::vector<std::string> words = {"vellum",
                                      "bench",
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

// The child, in a process group of its own, with its output in pipes.
class Child
{
public:
    explicit Child(std::vector<std::string> words)
    {
        int output[2], errors[2];
        if (pipe2(output, O_CLOEXEC) != 0)
            throw Error("no pipe can be made: " + std::string(std::strerror(errno)));
        if (pipe2(errors, O_CLOEXEC) != 0) {
            close(output[0]);
            close(output[1]);
            throw Error("no pipe can be made: " + std::string(std::strerror(errno)));
        }
        std::vector<char *> arguments;
        for (std::string &word : words)
            arguments.push_back(word.data());
        arguments.push_back(nullptr);
        posix_spawn_file_actions_t files;
        posix_spawn_file_actions_init(&files);
        posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
        posix_spawn_file_actions_adddup2(&files, output[1], STDOUT_FILENO);
        posix_spawn_file_actions_adddup2(&files, errors[1], STDERR_FILENO);
        posix_spawnattr_t attributes;
        posix_spawnattr_init(&attributes);
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
        posix_spawnattr_setpgroup(&attributes, 0);
        const int error = posix_spawn(&process_, "/proc/self/exe", &files, &attributes, arguments.data(), environ);
        posix_spawnattr_destroy(&attributes);
        posix_spawn_file_actions_destroy(&files);
        close(output[1]);
        close(errors[1]);
        descriptors_[0] = {output[0], POLLIN, 0};
        descriptors_[1] = {errors[0], POLLIN, 0};
        if (error == 0)
            return;
        process_ = 0;
        throw Error("no process can be started: " + std::string(std::strerror(error)));
    }
    ~Child()
    {
        kill();
        for (const pollfd &descriptor : descriptors_)
            close(descriptor.fd);
    }
    Child(const Child &) = delete;
    Child &operator=(const Child &) = delete;

    void kill()
    {
        if (process_ == 0)
            return;
        ::kill(-process_, SIGKILL);
        waitpid(process_, nullptr, 0);
        process_ = 0;
    }
    // Waits for output, at most for some milliseconds, and adds it to the texts. False at the end of both.
    bool read(std::string &output, std::string &errors, int milliseconds)
    {
        poll(descriptors_, 2, milliseconds);
        bool open = false;
        for (size_t i = 0; i < 2; ++i) {
            if (descriptors_[i].fd < 0 || (descriptors_[i].revents & (POLLIN | POLLHUP)) == 0) {
                open = open || descriptors_[i].fd >= 0;
                continue;
            }
            char buffer[4096];
            const ssize_t bytes = ::read(descriptors_[i].fd, buffer, sizeof buffer);
            if (bytes > 0) {
                (i == 0 ? output : errors).append(buffer, static_cast<size_t>(bytes));
                open = true;
            } else {
                close(descriptors_[i].fd);
                descriptors_[i].fd = -1;
            }
        }
        return open;
    }
    // After its end: how it ended, in words; empty for success.
    std::string ending(const std::string &errors)
    {
        int status = 0;
        waitpid(process_, &status, 0);
        process_ = 0;
        if (WIFSIGNALED(status)) {
            const char *name = sigabbrev_np(WTERMSIG(status));
            return std::string("crashed: SIG") + (name != nullptr ? name : "?");
        }
        if (WEXITSTATUS(status) == 0)
            return {};
        const size_t last = errors.find_last_not_of('\n');
        const std::string text = last == std::string::npos ? "" : errors.substr(0, last + 1);
        const size_t line = text.rfind('\n');
        if (text.empty())
            return fmt::format("ended with code {}", WEXITSTATUS(status));
        constexpr std::string_view kName = "vellum: "; // of the program, before a message
        const std::string message = text.substr(line == std::string::npos ? 0 : line + 1);
        return message.starts_with(kName) ? message.substr(kName.size()) : message;
    }

private:
    pid_t process_ = 0;
    pollfd descriptors_[2] = {{-1, 0, 0}, {-1, 0, 0}};
};

} // namespace

PartResult runPartProcess(const Part &part, const BenchDevice &device, double timeout,
                          const std::function<void()> &progress)
{
    PartResult result{part, {}, {}, 0};
    const auto begin = std::chrono::steady_clock::now();
    const auto elapsed = [&] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
    Child child(wordsOf(part, device));
    std::string output, errors;
    bool open = true;
    for (double last = 0; open && elapsed() < last + timeout; progress()) {
        open = child.read(output, errors, 200);
        for (size_t end = output.find('\n'); end != std::string::npos; end = output.find('\n')) {
            const std::string line = output.substr(0, end);
            output.erase(0, end + 1);
            if (!line.starts_with("{\"row\":")) // a driver printed it
                continue;
            result.rows.push_back(line);
            last = elapsed();
        }
    }
    if (open) {
        child.kill();
        result.failure = fmt::format("hung: no result for {:g} seconds", timeout);
    } else {
        result.failure = child.ending(errors);
    }
    result.seconds = elapsed();
    return result;
}

} // namespace vellum::cli
