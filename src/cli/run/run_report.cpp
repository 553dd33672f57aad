// SPDX-License-Identifier: Apache-2.0
#include "cli/run/run_report.h"

#include <algorithm>
#include <cstdio>
#include <fmt/format.h>
#include <optional>

#include "base/json_writer.h"
#include "base/text.h"
#include "base/version.h"
#include "inspect/report_parts.h"
#include "layer/base/setting_names.h"

namespace vellum::cli
{
namespace
{

// All parts of validation, as the layer writes them.
const std::string &allParts()
{
    struct All {
#define VELLUM_MEMBER(name, member, label, description) bool member = true;
        VELLUM_CHECKS(VELLUM_MEMBER)
#undef VELLUM_MEMBER
    };
    static const std::string parts = layer::namesOf(All());
    return parts;
}

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

// What follows the last ": " of a message, without the process at its end: "core, gpu".
std::string valueOf(const std::string &text)
{
    const size_t colon = text.rfind(": ");
    const std::string value = colon == std::string::npos ? text : text.substr(colon + 2);
    return value.substr(0, value.rfind(" ["));
}

void addInfo(const Message &message, MessageSummary &summary)
{
    if (message.id == "VELLUM-instance") {
        ++summary.instances;
        summary.validated |= valueOf(message.text) != "none";
    } else if (message.id == "VELLUM-device") {
        ++summary.devices;
    } else if (message.id == "VELLUM-device-unchanged") {
        ++summary.plainDevices;
        summary.driversOwn |= message.text.starts_with("the driver's");
    } else if (message.id == "VELLUM-checked") {
        ++summary.checked;
        if (const std::string parts = valueOf(message.text);
            std::ranges::find(summary.parts, parts) == summary.parts.end())
            summary.parts.push_back(parts);
    }
}

std::string countOf(size_t count, const char *what)
{
    return fmt::format("{} {}{}", count == 0 ? "no" : std::to_string(count), what, count == 1 ? "" : "s");
}

const char *nameOf(MessageSeverity severity)
{
    return severity == MessageSeverity::Error ? "error" : "warning";
}

// "1 device checked (core only)"
std::string checkedDevices(const MessageSummary &messages)
{
    const std::string parts = messages.partsInWords();
    return countOf(messages.checked, "device") + " checked" + (parts.empty() ? "" : " (" + parts + ")");
}

// " (2 times, ignored)"
std::string remarksOn(const MessageSummary::Kind &kind)
{
    std::string text = kind.count == 1 ? "" : fmt::format("{} times", kind.count);
    if (kind.ignored)
        text += text.empty() ? "ignored" : ", ignored";
    return text.empty() ? text : " (" + text + ")";
}

} // namespace

size_t MessageSummary::count(MessageSeverity severity) const
{
    size_t sum = 0;
    for (const Kind &kind : kinds)
        sum += !kind.ignored && kind.severity == severity ? kind.count : 0;
    return sum;
}

size_t MessageSummary::ignored() const
{
    size_t sum = 0;
    for (const Kind &kind : kinds)
        sum += kind.ignored ? kind.count : 0;
    return sum;
}

std::string MessageSummary::partsInWords() const
{
    if (parts.empty() || (parts.size() == 1 && parts.front() == allParts()))
        return {};
    std::string text;
    for (const std::string &part : parts)
        text += (text.empty() ? "" : "; ") + part + (part == allParts() ? "" : " only");
    return text;
}

std::string MessageSummary::whyUnchecked() const
{
    if (checked != 0)
        return "";
    if (instances == 0 && devices == 0)
        return "no Vulkan instance was created with the layer: no process of the program used Vulkan with the "
               "environment of vellum run";
    if (devices == 0 && plainDevices == 0)
        return "no Vulkan device was created";
    if (devices == 0 && !driversOwn)
        return "no device enables an extension of opacity micromaps";
    if (devices == 0)
        return "micromaps are the driver's own, and validation is off";
    return validated ? "no micromap or acceleration structure was built on a device with validation"
                     : "validation is off";
}

MessageSummary readMessages(std::istream &lines, const std::vector<std::string> &ignored)
{
    MessageSummary summary;
    for (std::string line; std::getline(lines, line);) {
        const std::optional<Message> message = parse(line);
        if (!message)
            continue;
        if (message->severity == MessageSeverity::Info) {
            addInfo(*message, summary);
            continue;
        }
        const auto kind = std::ranges::find_if(summary.kinds, [&](const MessageSummary::Kind &k) {
            return k.severity == message->severity && k.id == message->id;
        });
        if (kind != summary.kinds.end())
            ++kind->count;
        else
            summary.kinds.push_back({message->severity, message->id, message->text, 1,
                                     std::ranges::find(ignored, message->id) != ignored.end()});
    }
    return summary;
}

bool RunReport::fails(const MessageSummary::Kind &kind) const
{
    return !kind.ignored && (failOn == "warning" || (failOn == "error" && kind.severity == MessageSeverity::Error));
}

std::string RunReport::failure() const
{
    if (std::ranges::any_of(messages.kinds, [&](const MessageSummary::Kind &kind) { return fails(kind); }))
        return "because of messages of the layer (--fail-on " + failOn + ")";
    return requireChecks && messages.checked == 0 ? "because nothing was checked (--require-checks)" : "";
}

std::vector<std::string> RunReport::staleIgnores() const
{
    std::vector<std::string> stale;
    for (const std::string &id : ignored)
        if (std::ranges::find(messages.kinds, id, &MessageSummary::Kind::id) == messages.kinds.end())
            stale.push_back(id);
    return stale;
}

void print(const RunReport &report)
{
    const MessageSummary &messages = report.messages;
    std::string text;
    if (report.end.code != 0)
        text += fmt::format("vellum run: the program {}\n", report.end.text);
    if (const std::string why = messages.whyUnchecked(); !why.empty())
        text += fmt::format("vellum run: {}\n", messages.devices != 0 && !messages.validated
                                                    ? "not validated: add --validate"
                                                    : "nothing was checked: " + why);
    text += fmt::format("vellum run: {}, {}, {}{}\n", countOf(messages.count(MessageSeverity::Error), "error"),
                        countOf(messages.count(MessageSeverity::Warning), "warning"),
                        messages.ignored() == 0 ? "" : countOf(messages.ignored(), "message") + " ignored, ",
                        checkedDevices(messages));
    for (const MessageSummary::Kind &kind : messages.kinds)
        text += fmt::format("  {:<7} {}{}: {}\n", nameOf(kind.severity), kind.id, remarksOn(kind), kind.text);
    for (const std::string &id : report.staleIgnores())
        text += fmt::format("vellum run: --ignore {}: no such message\n", id);
    std::fputs(text.c_str(), stderr); // fmt::print() throws where nothing can be written
}

std::string junitXml(const RunReport &report)
{
    std::string cases;
    size_t tests = 0;
    size_t failures = 0;
    const auto add = [&](const std::string &name, bool failed, const std::string &text) {
        ++tests;
        failures += failed ? 1u : 0u;
        const std::string shown = markupText(printable(text));
        cases += fmt::format("    <testcase classname=\"vellum.run\" name=\"{}\"", markupText(printable(name)));
        if (failed)
            cases += fmt::format("><failure message=\"{}\"/></testcase>\n", shown);
        else
            cases += text.empty() ? "/>\n" : fmt::format("><system-out>{}</system-out></testcase>\n", shown);
    };
    if (!report.ended) {
        add("program", true, "the run has not ended");
    } else if (!report.notRun.empty()) {
        add("program", true, "not run: " + report.notRun);
    } else {
        add("program", report.end.code != 0, report.end.code != 0 ? report.end.text : "");
        const std::string unchecked = report.messages.whyUnchecked();
        const bool inPart = !report.messages.partsInWords().empty();
        add("checks", !unchecked.empty() && report.requireChecks, inPart ? checkedDevices(report.messages) : unchecked);
        for (const MessageSummary::Kind &kind : report.messages.kinds)
            add(kind.id, report.fails(kind),
                (kind.ignored ? "ignored: " : "") + kind.text +
                    (kind.count == 1 ? "" : fmt::format(" ({} times)", kind.count)));
        for (const std::string &id : report.staleIgnores())
            add("--ignore " + id, false, "no such message");
    }
    return fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"vellum run\">\n"
                       "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" time=\"{:.3f}\">\n{}  </testsuite>\n"
                       "</testsuites>\n",
                       markupText(printable(report.program.front())), tests, failures, report.seconds, cases);
}

std::string reportJson(const RunReport &report)
{
    JsonWriter json;
    beginReport(json, "run");
    json.member("version", versionText()).values("program", report.program);
    if (!report.ended)
        json.member("incomplete", "the run has not ended");
    else
        json.member("exitCode", report.exitCode);
    if (!report.notRun.empty())
        json.member("notRun", report.notRun);
    if (report.ended && report.notRun.empty()) {
        const MessageSummary &messages = report.messages;
        json.key("programEnd").beginObject().member("code", report.end.code).member("text", report.end.text);
        if (!report.end.signal.empty())
            json.member("signal", report.end.signal);
        json.member("timedOut", report.end.timedOut).end();
        json.member("seconds", report.seconds);
        if (const std::string failure = report.failure(); report.end.code == 0 && !failure.empty())
            json.member("failure", failure);
        json.member("instances", messages.instances).member("devices", messages.devices);
        json.member("unchangedDevices", messages.plainDevices).member("checkedDevices", messages.checked);
        json.list("validation", messages.parts, [&](const std::string &parts) {
            json.beginArray();
            for (std::string part : partsOf(parts, ',')) {
                part.erase(0, part.find_first_not_of(' '));
                json.value(part);
            }
            json.end();
        });
        if (const std::string why = messages.whyUnchecked(); !why.empty())
            json.member("unchecked", why);
        json.member("errors", messages.count(MessageSeverity::Error));
        json.member("warnings", messages.count(MessageSeverity::Warning)).member("ignored", messages.ignored());
        json.list("messages", messages.kinds, [&](const MessageSummary::Kind &kind) {
            json.beginObject().member("severity", nameOf(kind.severity)).member("id", kind.id);
            json.member("count", kind.count).member("text", kind.text);
            json.member("ignored", kind.ignored).member("fails", report.fails(kind)).end();
        });
        json.values("staleIgnores", report.staleIgnores());
    }
    return json.end().text() + "\n";
}

} // namespace vellum::cli
