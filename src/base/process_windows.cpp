// SPDX-License-Identifier: Apache-2.0
#include "base/process.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <fmt/format.h>
#include <io.h>
#include <utility>
#include <vulkan/vulkan_core.h>
#include <windows.h>

#include "base/error.h"
#include "base/windows_text.h"
#include "core/elevation_windows.h"

#include <delayimp.h> // after windows.h
#include <shellapi.h>

namespace vellum
{
namespace
{

UINT codePageBefore = 0;

// Texts are UTF-8, and progress uses escape sequences.
void prepareConsole()
{
    for (const DWORD stream : {STD_OUTPUT_HANDLE, STD_ERROR_HANDLE}) {
        const HANDLE console = GetStdHandle(stream);
        if (DWORD mode = 0; GetConsoleMode(console, &mode) != 0)
            SetConsoleMode(console, mode | ENABLE_PROCESSED_OUTPUT | ENABLE_VIRTUAL_TERMINAL_PROCESSING);
    }
    codePageBefore = GetConsoleOutputCP();
    if (codePageBefore != 0 && SetConsoleOutputCP(CP_UTF8) != 0) // the console may be a shell's, which goes on
        std::atexit([] { SetConsoleOutputCP(codePageBefore); });
}

// The loader of Vulkan, loaded when the first of its functions is called: from the folder of this program or from
// Windows, but not from the working directory, which may contain files of others. Without a loader, functions are
// looked up in this program, which does not have them.
FARPROC WINAPI findVulkan(unsigned what, DelayLoadInfo *)
{
    if (what != dliNotePreLoadLibrary)
        return nullptr;
    HMODULE loader =
        LoadLibraryExW(L"vulkan-1.dll", nullptr, LOAD_LIBRARY_SEARCH_APPLICATION_DIR | LOAD_LIBRARY_SEARCH_SYSTEM32);
    if (loader == nullptr)
        loader = GetModuleHandleW(nullptr);
    return reinterpret_cast<FARPROC>(reinterpret_cast<void *>(loader));
}

// Replaces every function if there is no loader.
VkResult VKAPI_CALL withoutLoader()
{
    return VK_ERROR_INCOMPATIBLE_DRIVER;
}

// An exception cannot pass through Vulkan's functions.
FARPROC WINAPI replaceFunction(unsigned what, DelayLoadInfo *info)
{
    if (what != dliFailGetProc)
        return nullptr;
    if (info->hmodCur == GetModuleHandleW(nullptr))
        return reinterpret_cast<FARPROC>(reinterpret_cast<void *>(withoutLoader));
    std::fprintf(stderr, "vellum: %s is too old: it has no %s\n", info->szDll, info->dlp.szProcName);
    std::exit(1);
}

} // namespace

std::vector<std::string> prepareProcess(int, char **)
{
    for (std::FILE *stream : {stdin, stdout, stderr})
        _setmode(_fileno(stream), _O_BINARY); // output is the same on every system
    std::setvbuf(stderr, nullptr, _IONBF, 0); // output before a crash must not be lost
    prepareConsole();
    __pfnDliNotifyHook2 = findVulkan;
    __pfnDliFailureHook2 = replaceFunction;
    // A dialog would be waited for.
    SetErrorMode(SEM_FAILCRITICALERRORS | SEM_NOGPFAULTERRORBOX | SEM_NOOPENFILEERRORBOX);
    int count = 0;
    std::vector<std::string> words;
    wchar_t **const arguments = CommandLineToArgvW(GetCommandLineW(), &count);
    for (int i = 1; i < count; ++i)
        words.push_back(utf8(arguments[i]));
    LocalFree(arguments);
    return words;
}

std::filesystem::path programPath()
{
    std::wstring path(32768, L'\0');
    path.resize(GetModuleFileNameW(nullptr, path.data(), static_cast<DWORD>(path.size())));
    return path;
}

bool environmentIsIgnored()
{
    return isElevated();
}

std::optional<std::string> variable(const char *name)
{
    const wchar_t *value = _wgetenv(wide(name).c_str());
    return value != nullptr ? std::optional<std::string>(utf8(value)) : std::nullopt;
}

void setVariable(const char *name, const std::string &value)
{
    _wputenv_s(wide(name).c_str(), wide(value).c_str());
}

std::vector<std::string> variableNames()
{
    std::vector<std::string> names;
    wchar_t *const block = GetEnvironmentStringsW();
    for (const wchar_t *text = block; text != nullptr && *text != L'\0';) {
        const std::wstring_view both = text;
        names.push_back(utf8(both.substr(0, both.find(L'=', 1)))); // names of Windows' own begin with =
        text += both.size() + 1;
    }
    FreeEnvironmentStringsW(block);
    return names;
}

namespace
{

constexpr DWORD kPipeBytes = 1 << 20;
constexpr DWORD kMillisecondsBetweenLooks = 2;
constexpr size_t kMostReadAtOnce = 4 * kPipeBytes; // of a process that never stops writing

// A handle that is closed with it.
class Handle
{
public:
    explicit Handle(HANDLE handle = nullptr) : handle_(handle == INVALID_HANDLE_VALUE ? nullptr : handle) {}
    ~Handle() { close(); }
    Handle(Handle &&other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
    Handle &operator=(Handle &&other) noexcept
    {
        std::swap(handle_, other.handle_);
        return *this;
    }
    void close()
    {
        if (handle_ != nullptr)
            CloseHandle(handle_);
        handle_ = nullptr;
    }
    [[nodiscard]] HANDLE get() const { return handle_; }

private:
    HANDLE handle_;
};

struct Pipe {
    Handle reading;
    Handle writing;
};

Pipe makePipe()
{
    HANDLE reading = nullptr;
    HANDLE writing = nullptr;
    if (CreatePipe(&reading, &writing, nullptr, kPipeBytes) == 0)
        throw Error("no pipe can be made: " + lastMessage());
    return {Handle(reading), Handle(writing)};
}

// All processes in it end when this process ends, however it does. `flags`: further limits.
Handle makeJob(DWORD flags = 0)
{
    Handle job(CreateJobObjectW(nullptr, nullptr));
    JOBOBJECT_EXTENDED_LIMIT_INFORMATION limits{};
    limits.BasicLimitInformation.LimitFlags = JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE | flags;
    SetInformationJobObject(job.get(), JobObjectExtendedLimitInformation, &limits, sizeof limits);
    return job;
}

// The attribute of a new process that it inherits these handles only.
class InheritedHandles
{
public:
    explicit InheritedHandles(std::array<HANDLE, 3> handles) : handles_(handles)
    {
        SIZE_T size = 0;
        InitializeProcThreadAttributeList(nullptr, 1, 0, &size);
        memory_.resize(size);
        if (InitializeProcThreadAttributeList(list(), 1, 0, &size) == 0 ||
            UpdateProcThreadAttribute(list(), 0, PROC_THREAD_ATTRIBUTE_HANDLE_LIST, handles_.data(), sizeof handles_,
                                      nullptr, nullptr) == 0)
            throw Error("no process can be started: " + lastMessage());
        for (const HANDLE handle : handles_)
            SetHandleInformation(handle, HANDLE_FLAG_INHERIT, HANDLE_FLAG_INHERIT);
    }
    ~InheritedHandles() { DeleteProcThreadAttributeList(list()); }
    InheritedHandles(const InheritedHandles &) = delete;
    InheritedHandles &operator=(const InheritedHandles &) = delete;

    [[nodiscard]] LPPROC_THREAD_ATTRIBUTE_LIST list()
    {
        return reinterpret_cast<LPPROC_THREAD_ATTRIBUTE_LIST>(memory_.data());
    }

private:
    std::array<HANDLE, 3> handles_;
    std::vector<std::byte> memory_;
};

// The process is in the job from its first instruction on.
Handle startSelf(std::span<const std::string> words, const Handle &job, std::array<HANDLE, 3> streams)
{
    InheritedHandles inherited(streams);
    STARTUPINFOEXW start{};
    start.StartupInfo.cb = sizeof start;
    start.StartupInfo.dwFlags = STARTF_USESTDHANDLES;
    start.StartupInfo.hStdInput = streams[0];
    start.StartupInfo.hStdOutput = streams[1];
    start.StartupInfo.hStdError = streams[2];
    start.lpAttributeList = inherited.list();
    std::wstring line = commandLineOf(words);
    PROCESS_INFORMATION started{};
    const DWORD flags = CREATE_SUSPENDED | CREATE_NEW_PROCESS_GROUP | EXTENDED_STARTUPINFO_PRESENT;
    if (CreateProcessW(programPath().c_str(), line.data(), nullptr, nullptr, TRUE, flags, nullptr, nullptr,
                       &start.StartupInfo, &started) == 0)
        throw Error("no process can be started: " + lastMessage());
    AssignProcessToJobObject(job.get(), started.hProcess);
    ResumeThread(started.hThread);
    CloseHandle(started.hThread);
    return Handle(started.hProcess);
}

DWORD bytesIn(const Handle &pipe)
{
    DWORD bytes = 0;
    return pipe.get() != nullptr && PeekNamedPipe(pipe.get(), nullptr, 0, nullptr, &bytes, nullptr) != 0 ? bytes : 0;
}

void readInto(const Handle &pipe, std::string &text)
{
    char buffer[65536];
    const size_t end = text.size() + kMostReadAtOnce;
    for (DWORD bytes = bytesIn(pipe); bytes != 0 && text.size() < end; bytes = bytesIn(pipe)) {
        DWORD read = 0;
        if (ReadFile(pipe.get(), buffer, sizeof buffer, &read, nullptr) == 0)
            return;
        text.append(buffer, read);
    }
}

std::string nameOfCrash(DWORD code)
{
    const auto named = [&](const char *name) { return fmt::format("{} (0x{:08X})", name, code); };
    switch (code) {
    case STATUS_ACCESS_VIOLATION: return named("access violation");
    case STATUS_IN_PAGE_ERROR: return named("error of paging");
    case STATUS_ILLEGAL_INSTRUCTION: return named("illegal instruction");
    case STATUS_INTEGER_DIVIDE_BY_ZERO: return named("division by zero");
    case STATUS_STACK_OVERFLOW: return named("stack overflow");
    case STATUS_BREAKPOINT: return named("breakpoint");
    case STATUS_CONTROL_C_EXIT: return named("Ctrl-C");
    case 0xC0000374: return named("heap corruption");
    case 0xC0000409: return named("fail-fast");
    default: return named("exception");
    }
}

bool isCrash(DWORD code)
{
    return code >= 0xC0000000 || code == STATUS_BREAKPOINT;
}

} // namespace

struct ChildProcess::System {
    Handle job;
    Handle input;
    Handle output;
    Handle errors;
    Handle process;
};

ChildProcess::ChildProcess(const std::vector<std::string> &arguments)
{
    std::vector<std::string> words = {"vellum"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    Pipe input = makePipe();
    Pipe output = makePipe();
    Pipe errors = makePipe();
    Handle job = makeJob();
    Handle process = startSelf(words, job, {input.reading.get(), output.writing.get(), errors.writing.get()});
    system_.reset(new System{std::move(job), std::move(input.writing), std::move(output.reading),
                             std::move(errors.reading), std::move(process)});
}

ChildProcess::~ChildProcess()
{
    kill();
    // A process that hangs in the kernel cannot be waited for.
    WaitForSingleObject(system_->process.get(), 5000);
}

void ChildProcess::write(std::string_view text)
{
    DWORD written = 0;
    if (WriteFile(system_->input.get(), text.data(), static_cast<DWORD>(text.size()), &written, nullptr) == 0)
        closeInput();
}

void ChildProcess::closeInput()
{
    system_->input.close();
}

void ChildProcess::kill()
{
    TerminateJobObject(system_->job.get(), 1);
    TerminateProcess(system_->process.get(), 1); // where it could not be assigned to the job
}

double ChildProcess::waitedForProcessor() const
{
    return 0;
}

std::optional<ProcessEnd> ChildProcess::end() const
{
    DWORD code = 0;
    if (WaitForSingleObject(system_->process.get(), 0) != WAIT_OBJECT_0 ||
        GetExitCodeProcess(system_->process.get(), &code) == 0)
        return std::nullopt;
    if (isCrash(code))
        return ProcessEnd{0, nameOfCrash(code)};
    return ProcessEnd{static_cast<int>(code), {}};
}

void ChildProcess::read(std::string &output, std::string &errors)
{
    readInto(system_->output, output);
    readInto(system_->errors, errors);
}

// Anonymous pipes cannot be waited for.
void ChildProcess::waitForAny(std::span<const ChildProcess *const> processes, int milliseconds)
{
    const auto hasNews = [](const ChildProcess *process) {
        const System &system = *process->system_;
        return bytesIn(system.output) != 0 || bytesIn(system.errors) != 0 ||
               WaitForSingleObject(system.process.get(), 0) == WAIT_OBJECT_0;
    };
    const ULONGLONG end = GetTickCount64() + static_cast<ULONGLONG>(milliseconds);
    while (std::none_of(processes.begin(), processes.end(), hasNews) && GetTickCount64() < end)
        Sleep(kMillisecondsBetweenLooks);
}

namespace
{

// Ends the process at once. Otherwise Windows would report the error first, or start a debugger.
LONG WINAPI endByException(EXCEPTION_POINTERS *exception)
{
    TerminateProcess(GetCurrentProcess(), exception->ExceptionRecord->ExceptionCode);
    return EXCEPTION_EXECUTE_HANDLER;
}

// The console sends Ctrl-C to the program as well, which decides. When the console closes, this process would end as
// soon as this returns, and the program with it; so it does not return before the program has ended, or Windows ends
// both.
BOOL WINAPI ignore(DWORD event)
{
    if (event != CTRL_C_EVENT && event != CTRL_BREAK_EVENT)
        Sleep(INFINITE);
    return TRUE;
}

} // namespace

// The job ends it with its parent.
void endWithParent()
{
    SetUnhandledExceptionFilter(endByException);
}

const char *const kExitCodesOfPrograms = "others    that of the program, such as 0xC0000005 if it crashed";

ProgramEnd runProgram(std::span<const std::string> words, std::optional<double> seconds)
{
    SetConsoleCtrlHandler(ignore, TRUE); // to the end: removing it would wait for one that does not return
    // Processes that the program starts may outlive it, unless its time is limited.
    const Handle job = makeJob(seconds ? 0 : JOB_OBJECT_LIMIT_SILENT_BREAKAWAY_OK);
    STARTUPINFOW start{};
    start.cb = sizeof start;
    PROCESS_INFORMATION started{};
    std::wstring line = commandLineOf(words);
    ProgramEnd end;
    // Errors of the program are reported and dumped as usual, unlike those of this process (prepareProcess).
    constexpr DWORD kFlags = CREATE_SUSPENDED | CREATE_DEFAULT_ERROR_MODE;
    if (CreateProcessW(nullptr, line.data(), nullptr, nullptr, TRUE, kFlags, nullptr, nullptr, &start, &started) == 0) {
        const DWORD error = GetLastError();
        const bool missing = error == ERROR_FILE_NOT_FOUND || error == ERROR_PATH_NOT_FOUND;
        end.started = false;
        end.code = missing ? ProgramEnd::kNoProgram : ProgramEnd::kNotExecutable;
        end.text = words[0] + ": " + messageOf(error);
        return end;
    }
    const Handle process(started.hProcess);
    AssignProcessToJobObject(job.get(), process.get());
    ResumeThread(started.hThread);
    CloseHandle(started.hThread);
    const DWORD milliseconds = seconds ? static_cast<DWORD>(std::min(*seconds * 1000, 4e9)) : INFINITE;
    if (WaitForSingleObject(process.get(), milliseconds) == WAIT_TIMEOUT) {
        TerminateJobObject(job.get(), ProgramEnd::kTimedOut);
        TerminateProcess(process.get(), ProgramEnd::kTimedOut); // where it could not be assigned to the job
        WaitForSingleObject(process.get(), 5000);               // one that hangs in the kernel does not end
        end.timedOut = true;
        end.code = ProgramEnd::kTimedOut;
        return end;
    }
    DWORD code = 0;
    if (GetExitCodeProcess(process.get(), &code) == 0)
        throw Error("the program cannot be waited for");
    end.code = static_cast<int>(code);
    end.signal = isCrash(code) ? nameOfCrash(code) : "";
    end.text = isCrash(code) ? "ended by " + end.signal : "exited with " + std::to_string(code);
    return end;
}

namespace
{

std::atomic<bool> came{false};

// Windows calls it in a thread of its own. What it does not handle ends the process. So does a console that closes, or
// a user who logs off, as soon as this returns; without that, after some seconds, in which the process can clean up.
BOOL WINAPI remember(DWORD event)
{
    if (came.exchange(true))
        return FALSE;
    if (event != CTRL_C_EVENT && event != CTRL_BREAK_EVENT)
        Sleep(INFINITE);
    return TRUE;
}

} // namespace

Interruptible::Interruptible()
{
    came = false;
    SetConsoleCtrlHandler(remember, TRUE);
}

Interruptible::~Interruptible()
{
    SetConsoleCtrlHandler(remember, FALSE);
}

bool Interruptible::interrupted()
{
    return came;
}

void Interruptible::die()
{
    ExitProcess(STATUS_CONTROL_C_EXIT);
}

} // namespace vellum
