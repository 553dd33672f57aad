// SPDX-License-Identifier: Apache-2.0
#include "cli/run/message_summary.h"

#include <algorithm>
#include <fmt/format.h>
#include <optional>

namespace vellum::cli
{
namespace
{

struct Message {
    MessageSeverity severity;
    std::string id;
    std::string text;
};

// "<severity> <id>: <text>"; nothing for a line that is cut off.
std::optional<Message> parse(const std::string &line)
{
    const size_t space = line.find(' ');
    const size_t colon = line.find(": ");
    if (space == std::string::npos || colon == std::string::npos || colon < space)
        return std::nullopt;
    const std::string severity = line.substr(0, space);
    Message message{MessageSeverity::Info, line.substr(space + 1, colon - space - 1), line.substr(colon + 2)};
    if (severity == "error")
        message.severity = MessageSeverity::Error;
    else if (severity == "warning")
        message.severity = MessageSeverity::Warning;
    else if (severity != "info")
        return std::nullopt;
    return message;
}

std::string counted(size_t count, const char *what)
{
    return fmt::format("{} {}{}", count == 0 ? "no" : std::to_string(count), what, count == 1 ? "" : "s");
}

} // namespace

MessageSummary readMessages(std::istream &lines)
{
    MessageSummary summary;
    for (std::string line; std::getline(lines, line);) {
        const std::optional<Message> message = parse(line);
        if (!message)
            continue;
        if (message->severity == MessageSeverity::Info) {
            summary.devices += message->id == "VELLUM-device" ? 1u : 0u;
            continue;
        }
        ++(message->severity == MessageSeverity::Error ? summary.errors : summary.warnings);
        const auto kind = std::ranges::find_if(summary.kinds, [&](const MessageSummary::Kind &k) {
            return k.severity == message->severity && k.id == message->id;
        });
        if (kind == summary.kinds.end())
            summary.kinds.push_back({message->severity, message->id, message->text, 1});
        else
            ++kind->count;
    }
    return summary;
}

void print(const MessageSummary &summary)
{
    if (summary.devices == 0)
        fmt::print(stderr, "vellum run: no device used micromaps through the layer: nothing was checked\n");
    fmt::print(stderr, "vellum run: {}, {}, {} checked\n", counted(summary.errors, "error"),
               counted(summary.warnings, "warning"), counted(summary.devices, "device"));
    for (const MessageSummary::Kind &kind : summary.kinds)
        fmt::print(stderr, "  {:<7} {}{}: {}\n", kind.severity == MessageSeverity::Error ? "error" : "warning", kind.id,
                   kind.count == 1 ? "" : fmt::format(" ({} times)", kind.count), kind.text);
}

} // namespace vellum::cli
