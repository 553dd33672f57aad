// SPDX-License-Identifier: Apache-2.0
#include "base/process.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <poll.h>
#include <spawn.h>
#include <sys/auxv.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <utility>

#include "base/error.h"

namespace vellum
{
namespace
{

// A file that is opened later must not become a standard stream. What is in the place of a closed one cannot be used
// either, and programs that are started have it closed.
void occupyStandardStreams()
{
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        if (fcntl(stream, F_GETFD) < 0)
            static_cast<void>(open("/dev/null", (stream == STDIN_FILENO ? O_WRONLY : O_RDONLY) | O_CLOEXEC));
}

} // namespace

std::vector<std::string> prepareProcess(int argc, char **argv)
{
    occupyStandardStreams();
    std::signal(SIGCHLD, SIG_DFL); // where a parent ignores it, children cannot be waited for
    return {argv + (argc > 0 ? 1 : 0), argv + argc};
}

std::filesystem::path programPath()
{
    std::error_code error;
    return std::filesystem::read_symlink("/proc/self/exe", error);
}

bool environmentIsIgnored()
{
    return getauxval(AT_SECURE) != 0;
}

std::optional<std::string> variable(const char *name)
{
    const char *value = std::getenv(name);
    return value != nullptr ? std::optional<std::string>(value) : std::nullopt;
}

void setVariable(const char *name, const std::string &value)
{
    setenv(name, value.c_str(), 1);
}

std::vector<std::string> variableNames()
{
    std::vector<std::string> names;
    for (char **text = environ; text != nullptr && *text != nullptr; ++text)
        names.emplace_back(*text, std::strcspn(*text, "="));
    return names;
}

namespace
{

// A file descriptor that is closed with it.
class Descriptor
{
public:
    explicit Descriptor(int number = -1) : number_(number) {}
    ~Descriptor() { close(); }
    Descriptor(Descriptor &&other) noexcept : number_(std::exchange(other.number_, -1)) {}
    Descriptor &operator=(Descriptor &&other) noexcept
    {
        std::swap(number_, other.number_);
        return *this;
    }
    void close()
    {
        if (number_ >= 0)
            ::close(number_);
        number_ = -1;
    }
    [[nodiscard]] int number() const { return number_; }

private:
    int number_;
};

struct Ends {
    Descriptor own;
    Descriptor child;
};

// Ensures that neither descriptor has the number of a standard stream.
Ends endsOf(int own, int child)
{
    const Descriptor first(own);
    const Descriptor second(child);
    Ends ends{Descriptor(fcntl(own, F_DUPFD_CLOEXEC, 3)), Descriptor(fcntl(child, F_DUPFD_CLOEXEC, 3))};
    if (ends.own.number() < 0 || ends.child.number() < 0)
        throw Error("no pipe can be made: " + std::string(std::strerror(errno)));
    return ends;
}

// A socket: writing to one whose other end is closed need not raise a signal.
Ends makeInput()
{
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
        throw Error("no pipe can be made: " + std::string(std::strerror(errno)));
    return endsOf(ends[0], ends[1]);
}

Ends makeOutput()
{
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0)
        throw Error("no pipe can be made: " + std::string(std::strerror(errno)));
    Ends output = endsOf(ends[0], ends[1]);
    fcntl(output.own.number(), F_SETFL, O_NONBLOCK);
    return output;
}

// Closes the descriptor at the end of what it has. A process that never stops writing does not keep it here.
void readInto(Descriptor &descriptor, std::string &text)
{
    constexpr size_t kMostAtOnce = size_t{4} << 20; // more than a pipe holds
    char buffer[65536];
    const size_t end = text.size() + kMostAtOnce;
    while (descriptor.number() >= 0 && text.size() < end) {
        const ssize_t count = ::read(descriptor.number(), buffer, sizeof buffer);
        if (count > 0)
            text.append(buffer, static_cast<size_t>(count));
        else if (count == 0)
            descriptor.close();
        else if (errno != EINTR)
            return;
    }
}

// The signals that end programs. sigabbrev_np, which knows all, is new in glibc 2.32.
std::string nameOfSignal(int signal)
{
    constexpr std::pair<int, const char *> kNames[] = {
        {SIGHUP, "SIGHUP"},   {SIGINT, "SIGINT"},   {SIGQUIT, "SIGQUIT"}, {SIGILL, "SIGILL"},   {SIGTRAP, "SIGTRAP"},
        {SIGABRT, "SIGABRT"}, {SIGBUS, "SIGBUS"},   {SIGFPE, "SIGFPE"},   {SIGKILL, "SIGKILL"}, {SIGUSR1, "SIGUSR1"},
        {SIGSEGV, "SIGSEGV"}, {SIGUSR2, "SIGUSR2"}, {SIGPIPE, "SIGPIPE"}, {SIGALRM, "SIGALRM"}, {SIGTERM, "SIGTERM"},
        {SIGXCPU, "SIGXCPU"}, {SIGXFSZ, "SIGXFSZ"}, {SIGSYS, "SIGSYS"},
    };
    for (const auto &[number, name] : kNames)
        if (number == signal)
            return name;
    return "signal " + std::to_string(signal);
}

std::vector<char *> pointersTo(std::vector<std::string> &words)
{
    std::vector<char *> pointers;
    for (std::string &word : words)
        pointers.push_back(word.data());
    pointers.push_back(nullptr);
    return pointers;
}

// In a process group of its own, with the signals that this command ignores.
pid_t startSelf(std::vector<std::string> words, const Ends &input, const Ends &output, const Ends &errors)
{
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, input.child.number(), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, output.child.number(), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files, errors.child.number(), STDERR_FILENO);
    sigset_t ignored;
    sigemptyset(&ignored);
    sigaddset(&ignored, SIGXFSZ);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setsigdefault(&attributes, &ignored);
    pid_t process = 0;
    const int error = posix_spawn(&process, "/proc/self/exe", &files, &attributes, pointersTo(words).data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    if (error != 0)
        throw Error("no process can be started: " + std::string(std::strerror(error)));
    return process;
}

} // namespace

struct ChildProcess::System {
    pid_t process;
    Descriptor input;
    Descriptor output;
    Descriptor errors;
};

ChildProcess::ChildProcess(const std::vector<std::string> &arguments)
{
    std::vector<std::string> words = {"vellum"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    Ends input = makeInput();
    Ends output = makeOutput();
    Ends errors = makeOutput();
    const pid_t process = startSelf(std::move(words), input, output, errors);
    system_.reset(new System{process, std::move(input.own), std::move(output.own), std::move(errors.own)});
}

ChildProcess::~ChildProcess()
{
    kill();
    // A process that hangs in the kernel cannot be waited for.
    for (int i = 0; i < 500 && waitpid(system_->process, nullptr, WNOHANG) == 0; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

void ChildProcess::write(std::string_view text)
{
    if (send(system_->input.number(), text.data(), text.size(), MSG_NOSIGNAL) < 0)
        closeInput();
}

void ChildProcess::closeInput()
{
    system_->input.close();
}

void ChildProcess::kill()
{
    ::kill(-system_->process, SIGKILL);
}

double ChildProcess::waitedForProcessor() const
{
    double seconds = 0;
    std::error_code error;
    const std::string tasks = "/proc/" + std::to_string(system_->process) + "/task";
    for (const auto &task : std::filesystem::directory_iterator(tasks, error)) {
        std::ifstream file(task.path() / "schedstat"); // nanoseconds: on a processor, waiting for one
        double running = 0, waiting = 0;
        if (file >> running >> waiting)
            seconds += waiting * 1e-9;
    }
    return seconds;
}

std::optional<ProcessEnd> ChildProcess::end() const
{
    siginfo_t info{};
    // The process keeps its number until the destructor, so that kill() can end what it has left.
    const int result = waitid(P_PID, static_cast<id_t>(system_->process), &info, WEXITED | WNOHANG | WNOWAIT);
    if (result != 0 || info.si_pid == 0)
        return std::nullopt;
    if (info.si_code != CLD_EXITED)
        return ProcessEnd{0, nameOfSignal(info.si_status)};
    return ProcessEnd{info.si_status, {}};
}

void ChildProcess::read(std::string &output, std::string &errors)
{
    readInto(system_->output, output);
    readInto(system_->errors, errors);
}

void ChildProcess::waitForAny(std::span<const ChildProcess *const> processes, int milliseconds)
{
    std::vector<pollfd> descriptors;
    for (const ChildProcess *process : processes) {
        descriptors.push_back({process->system_->output.number(), POLLIN, 0});
        descriptors.push_back({process->system_->errors.number(), POLLIN, 0});
    }
    poll(descriptors.data(), descriptors.size(), milliseconds);
}

void endWithParent()
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
}

namespace
{

volatile sig_atomic_t program = 0;      // of runProgram
volatile sig_atomic_t programLeads = 0; // it leads a process group of its own

void passOn(int signal, siginfo_t *info, void *)
{
    // A terminal sends Ctrl-C to the program as well, unless that is in another process group.
    if (program > 0 && (programLeads != 0 || info->si_code == SI_USER))
        kill(programLeads != 0 ? -program : program, signal);
}

// While there is one, signals that end processes are passed on instead.
class PassedOnSignals
{
public:
    PassedOnSignals()
    {
        struct sigaction handler {
        };
        handler.sa_sigaction = passOn;
        handler.sa_flags = SA_SIGINFO | SA_RESTART;
        sigemptyset(&set_);
        for (size_t i = 0; i < kSignals.size(); ++i) {
            sigaddset(&set_, kSignals[i]);
            sigaction(kSignals[i], nullptr, &before_[i]);
            if (before_[i].sa_handler != SIG_IGN) // the program inherits that
                sigaction(kSignals[i], &handler, nullptr);
        }
    }
    ~PassedOnSignals()
    {
        for (size_t i = 0; i < kSignals.size(); ++i)
            sigaction(kSignals[i], &before_[i], nullptr);
    }
    PassedOnSignals(const PassedOnSignals &) = delete;
    PassedOnSignals &operator=(const PassedOnSignals &) = delete;

    [[nodiscard]] const sigset_t &set() const { return set_; }

private:
    static constexpr std::array<int, 4> kSignals{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
    sigset_t set_{};
    std::array<struct sigaction, kSignals.size()> before_{};
};

// The error of posix_spawnp; 0: it runs, as `program`. `leads`: in a process group of its own.
int startProgram(std::vector<std::string> words, const sigset_t &signals, bool leads)
{
    // Signals are blocked between the start and the assignment to `program`.
    sigset_t before;
    sigprocmask(SIG_BLOCK, &signals, &before);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes,
                             static_cast<short>(POSIX_SPAWN_SETSIGMASK | (leads ? POSIX_SPAWN_SETPGROUP : 0)));
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setsigmask(&attributes, &before);
    pid_t process = 0;
    const int error = posix_spawnp(&process, words[0].c_str(), nullptr, &attributes, pointersTo(words).data(), environ);
    posix_spawnattr_destroy(&attributes);
    programLeads = leads ? 1 : 0;
    program = error == 0 ? process : 0;
    sigprocmask(SIG_SETMASK, &before, nullptr);
    return error;
}

// Waits until the program has ended, without reaping it: its number stays that of its group. Returns false after the
// time.
bool waitForProgram(double seconds)
{
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    for (;;) {
        siginfo_t info{};
        const int result = waitid(P_PID, static_cast<id_t>(program), &info, WEXITED | WNOHANG | WNOWAIT);
        if (result != 0 || info.si_pid != 0)
            return true;
        if (std::chrono::steady_clock::now() >= end)
            return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
}

// Ends the group of the program if it has not ended by itself. Returns whether it had to.
bool endAfter(double seconds)
{
    constexpr double kSecondsToEnd = 2; // after SIGTERM
    if (waitForProgram(seconds))
        return false;
    kill(-program, SIGTERM);
    kill(-program, SIGCONT); // to one that is stopped
    // Others of the group may need the time although the program has ended.
    std::this_thread::sleep_for(std::chrono::duration<double>(kSecondsToEnd));
    kill(-program, SIGKILL);
    return true;
}

} // namespace

const char *const kExitCodesOfPrograms = "0 to 255  that of the program; 128 + n if signal n ended it";

ProgramEnd runProgram(std::span<const std::string> words, std::optional<double> seconds)
{
    const PassedOnSignals signals;
    ProgramEnd end;
    if (const int error = startProgram({words.begin(), words.end()}, signals.set(), seconds.has_value()); error != 0) {
        end.started = false;
        end.code = error == ENOENT ? ProgramEnd::kNoProgram : ProgramEnd::kNotExecutable;
        end.text = words[0] + ": " + std::strerror(error);
        return end;
    }
    end.timedOut = seconds && endAfter(*seconds);
    constexpr double kSecondsToDie = 5;
    const bool hangsInKernel = end.timedOut && !waitForProgram(kSecondsToDie);
    int status = 0;
    while (!hangsInKernel && waitpid(program, &status, 0) < 0)
        if (errno != EINTR)
            throw Error("the program cannot be waited for");
    program = 0;
    if (end.timedOut) {
        end.code = ProgramEnd::kTimedOut;
        return end;
    }
    if (WIFSIGNALED(status)) {
        end.code = 128 + WTERMSIG(status);
        end.signal = nameOfSignal(WTERMSIG(status));
        end.text = "ended by signal " + std::to_string(WTERMSIG(status)) +
                   (end.signal.starts_with("SIG") ? " (" + end.signal + ")" : "");
    } else {
        end.code = WEXITSTATUS(status);
        end.text = "exited with " + std::to_string(end.code);
    }
    return end;
}

namespace
{

constexpr std::array kSignals = {SIGINT, SIGTERM, SIGHUP};

std::atomic<int> came{0};
static_assert(std::atomic<int>::is_always_lock_free);

void remember(int signal)
{
    came = signal;
}

void handle(int signal, void (*handler)(int), int flags)
{
    struct sigaction action {
    };
    action.sa_handler = handler;
    action.sa_flags = flags;
    sigaction(signal, &action, nullptr);
}

} // namespace

Interruptible::Interruptible()
{
    came = 0;
    for (const int signal : kSignals) {
        struct sigaction before {
        };
        sigaction(signal, nullptr, &before);
        if (before.sa_handler != SIG_IGN) // nohup
            handle(signal, remember, static_cast<int>(SA_RESETHAND));
    }
    handle(SIGXFSZ, SIG_IGN, 0);
}

Interruptible::~Interruptible()
{
    for (const int signal : kSignals) {
        struct sigaction now {
        };
        sigaction(signal, nullptr, &now);
        if (now.sa_handler == remember)
            handle(signal, SIG_DFL, 0);
    }
    handle(SIGXFSZ, SIG_DFL, 0);
}

bool Interruptible::interrupted()
{
    return came != 0;
}

void Interruptible::die()
{
    handle(came, SIG_DFL, 0);
    std::raise(came);
    std::_Exit(128 + came);
}

} // namespace vellum
