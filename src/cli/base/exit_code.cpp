// SPDX-License-Identifier: Apache-2.0
#include "cli/base/exit_code.h"

#include <algorithm>
#include <optional>

namespace vellum::cli
{

namespace
{

struct Meaning {
    ExitCode code;
    std::string_view users; // subcommands, each with the options that it is for; or one of these two
    const char *text;
};
constexpr std::string_view kEvery = "*";
constexpr std::string_view kEveryButRun = "";

constexpr Meaning kMeanings[] = {
    {ExitCode::Success, kEveryButRun, "success, and nothing to report"},
    {ExitCode::Failed, kEveryButRun,
     "failed: something cannot be read, baked, verified or written, or no device has micromaps"},
    {ExitCode::Failed, "spirv --lint", "findings"},
    {ExitCode::Failed, "check", "failures, or cases better than the baseline"},
    {ExitCode::Failed, "bench", "a self-check failed, or a part was not completed"},
    {ExitCode::Failed, "run --junit or --json", "the file cannot be written"},
    {ExitCode::Usage, kEvery, "usage error: nothing was done"},
    {ExitCode::InvalidMicromaps, "info, verify", "micromaps that break a rule of the glTF extension"},
    {ExitCode::WrongClaims, "verify", "states that contradict the texture"},
    {ExitCode::UncertainClaims, "verify --strict", "states outside the margins, undecided claims, or cautions"},
    {ExitCode::NeedlesslyUnknown, "verify --strict", "states that are unknown without need"},
    {ExitCode::NoMicromaps, "verify --strict or --require-micromaps, bake --require-micromaps", "no micromaps"},
    {ExitCode::MessagesFailed, "run",
     "the program succeeded, but there were messages of the severity of --fail-on, or nothing was checked "
     "(--require-checks)"},
    {ExitCode::TimedOut, "run --timeout", "the program did not end in time, and was ended"},
    {ExitCode::NotRun, "run", "the program was not run, for example because the layer is not found"},
    {ExitCode::NotRun, "check", "nothing was tested, because no device has micromaps or all cases were skipped"},
    {ExitCode::NotExecutable, "run", "the program cannot be executed"},
    {ExitCode::NoProgram, "run", "there is no such program"},
    {ExitCode::Interrupted, "bake, bench, check", "interrupted by Ctrl-C; what was finished before is kept"},
};

// The prefix of the text: the options for a subcommand, all users for none. Nothing where the subcommand is not among
// them.
std::optional<std::string_view> usersFor(const Meaning &meaning, std::string_view subcommand)
{
    std::string_view users = meaning.users;
    if (users == kEvery || users == kEveryButRun)
        return users == kEveryButRun && subcommand == "run" ? std::nullopt : std::optional<std::string_view>("");
    if (subcommand.empty())
        return users;
    while (!users.empty()) {
        const size_t end = std::min(users.find(", "), users.size());
        const std::string_view user = users.substr(0, end);
        const size_t name = std::min(user.find(' '), user.size());
        if (user.substr(0, name) == subcommand)
            return user.substr(std::min(name + 1, user.size()));
        users.remove_prefix(std::min(end + 2, users.size()));
    }
    return std::nullopt;
}

} // namespace

std::vector<std::pair<std::string, std::string>> exitCodesOf(std::string_view subcommand)
{
    std::vector<std::pair<std::string, std::string>> codes;
    for (const Meaning &meaning : kMeanings) {
        const std::optional<std::string_view> users = usersFor(meaning, subcommand);
        if (!users)
            continue;
        const std::string code = std::to_string(static_cast<int>(meaning.code));
        const std::string text = std::string(*users) + (users->empty() ? "" : ": ") + meaning.text;
        if (!codes.empty() && codes.back().first == code)
            codes.back().second += "; " + text;
        else
            codes.emplace_back(code, text);
    }
    return codes;
}

ExitCode worse(ExitCode a, ExitCode b)
{
    if (a == ExitCode::Success || b == ExitCode::Success)
        return std::max(a, b);
    return std::min(a, b);
}

} // namespace vellum::cli
