// SPDX-License-Identifier: Apache-2.0
#include "command.h"

#include <fstream>
#include <iterator>
#include <stdexcept>
#include <windows.h>

#include "base/windows_text.h"
#include "glb_file.h"

namespace vellum::test
{
namespace
{

std::string textOf(const std::filesystem::path &path)
{
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

// Variables of this process while it exists, which children inherit.
class Environment
{
public:
    explicit Environment(const std::vector<std::pair<std::string, std::string>> &variables)
    {
        for (const auto &[name, value] : variables) {
            before_.emplace_back(wide(name), std::wstring(32767, L'\0'));
            auto &[wideName, old] = before_.back();
            old.resize(GetEnvironmentVariableW(wideName.c_str(), old.data(), static_cast<DWORD>(old.size())));
            SetEnvironmentVariableW(wideName.c_str(), wide(value).c_str());
        }
    }
    ~Environment()
    {
        for (const auto &[name, value] : before_)
            SetEnvironmentVariableW(name.c_str(), value.empty() ? nullptr : value.c_str());
    }
    Environment(const Environment &) = delete;
    Environment &operator=(const Environment &) = delete;

private:
    std::vector<std::pair<std::wstring, std::wstring>> before_;
};

HANDLE openInherited(const std::filesystem::path &path, DWORD access, DWORD disposition)
{
    SECURITY_ATTRIBUTES inherited{sizeof(SECURITY_ATTRIBUTES), nullptr, TRUE};
    const HANDLE file = CreateFileW(path.c_str(), access, FILE_SHARE_READ | FILE_SHARE_WRITE, &inherited, disposition,
                                    FILE_ATTRIBUTE_NORMAL, nullptr);
    if (file == INVALID_HANDLE_VALUE)
        throw std::runtime_error(path.string() + " cannot be opened");
    return file;
}

} // namespace

Outcome runVellum(const std::vector<std::string> &arguments,
                  const std::vector<std::pair<std::string, std::string>> &variables, const std::filesystem::path &input)
{
    const TemporaryFolder folder;
    const Environment environment(variables);
    std::vector<std::string> words = {"vellum"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    STARTUPINFOW start{};
    start.cb = sizeof start;
    start.dwFlags = STARTF_USESTDHANDLES;
    start.hStdInput = openInherited(input == "/dev/null" ? "NUL" : input, GENERIC_READ, OPEN_EXISTING);
    start.hStdOutput = openInherited(folder / "output", GENERIC_WRITE, CREATE_ALWAYS);
    start.hStdError = openInherited(folder / "errors", GENERIC_WRITE, CREATE_ALWAYS);
    std::wstring line = commandLineOf(words);
    PROCESS_INFORMATION started{};
    const std::wstring program = std::filesystem::path(VELLUM_COMMAND).wstring();
    const BOOL runs =
        CreateProcessW(program.c_str(), line.data(), nullptr, nullptr, TRUE, 0, nullptr, nullptr, &start, &started);
    for (const HANDLE stream : {start.hStdInput, start.hStdOutput, start.hStdError})
        CloseHandle(stream);
    if (runs == 0)
        throw std::runtime_error(program.empty() ? "no program" : "no process");
    WaitForSingleObject(started.hProcess, INFINITE);
    DWORD code = 0;
    GetExitCodeProcess(started.hProcess, &code);
    CloseHandle(started.hProcess);
    CloseHandle(started.hThread);
    return {static_cast<int>(code), 0, textOf(folder / "output"), textOf(folder / "errors")};
}

} // namespace vellum::test
