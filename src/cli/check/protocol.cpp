// SPDX-License-Identifier: Apache-2.0
#include "cli/check/protocol.h"

#include <array>
#include <charconv>

#include "base/error.h"
#include "base/json_reader.h"
#include "base/json_writer.h"
#include "cli/base/files.h"
#include "cli/check/cases.h"
#include "cli/check/expectations.h"
#include "core/utf8_path.h"
#include "inspect/report_parts.h"
#include "job/worker.h"

namespace vellum::cli
{
namespace
{

constexpr std::array kRequests = {"describe", "run", "replay", "make", "separate"};
constexpr std::array kEvents = {"device", "begin", "end", "error"};

std::string bytesOf(const std::string &hex)
{
    std::string bytes;
    for (size_t i = 0; i + 1 < hex.size(); i += 2) {
        uint8_t byte = 0;
        std::from_chars(hex.data() + i, hex.data() + i + 2, byte, 16);
        bytes += static_cast<char>(byte);
    }
    return bytes;
}

template <typename Kind, typename Names>
Kind kindOf(const std::string &name, const Names &names)
{
    for (size_t i = 0; i < names.size(); ++i)
        if (name == names[i])
            return static_cast<Kind>(i);
    throw Error(name + " is unknown");
}

check::Status statusOf(const std::string &name)
{
    if (const auto status = parseStatus(name))
        return *status;
    throw Error("the status " + name + " is unknown");
}

void writeOutcome(const check::Outcome &outcome, JsonWriter &json)
{
    json.member("status", nameOf(outcome.status)).member("cause", outcome.cause).member("detail", outcome.detail);
    json.member("reproducer", outcome.reproducer).member("rays", hexadecimal(outcome.rays));
    json.list("files", outcome.files, [&](const check::OutcomeFile &file) {
        json.beginObject()
            .member("extension", file.extension)
            .member("hex", hexOf({reinterpret_cast<const uint8_t *>(file.bytes.data()), file.bytes.size()}))
            .end();
    });
}

check::Outcome readOutcome(const JsonReader &reader)
{
    check::Outcome outcome{statusOf(reader.text("status")), reader.text("cause"),     reader.text("detail"),
                           reader.text("reproducer"),       reader.hexNumber("rays"), {}};
    reader.forEach("files", [&](const rapidjson::Value &file) {
        outcome.files.push_back({JsonReader::textOf(file, "extension"), bytesOf(JsonReader::textOf(file, "hex"))});
    });
    return outcome;
}

} // namespace

std::string write(const Request &request)
{
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("request", kRequests.at(static_cast<size_t>(request.kind)));
    json.member("group", request.group).member("seed", hexadecimal(request.seed));
    json.member("reproducer", request.reproducer).member("timeout", hexadecimal(request.timeout));
    json.member("shrinkSeconds", hexadecimal(request.shrinkSeconds)).end();
    return json.text();
}

Request parseRequest(const std::string &line)
{
    const JsonReader reader(line);
    return {kindOf<Request::Kind>(reader.text("request"), kRequests),
            reader.text("group"),
            reader.hexNumber("seed"),
            reader.text("reproducer"),
            static_cast<uint32_t>(reader.hexNumber("timeout")),
            static_cast<uint32_t>(reader.hexNumber("shrinkSeconds"))};
}

std::string write(const Event &event)
{
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("event", kEvents.at(static_cast<size_t>(event.kind)));
    switch (event.kind) {
    case Event::Kind::Device:
        json.member("number", hexadecimal(event.device.number))
            .member("name", event.device.name)
            .member("implementation", event.device.implementation);
        json.member("khr", event.device.khr ? "yes" : "no").member("ext", event.device.ext ? "yes" : "no");
        json.list("knownFaults", event.device.knownFaults, [&](const DeviceSummary::Fault &fault) {
            json.beginObject().member("text", fault.text).member("response", fault.response).end();
        });
        break;
    case Event::Kind::Begin: break;
    case Event::Kind::End: writeOutcome(event.outcome, json); break;
    case Event::Kind::Error: return job::errorEvent(event.message);
    }
    json.end();
    return json.text();
}

Event parseEvent(const std::string &line)
{
    const JsonReader reader(line);
    Event event;
    event.kind = kindOf<Event::Kind>(reader.text("event"), kEvents);
    switch (event.kind) {
    case Event::Kind::Device:
        event.device = {static_cast<uint32_t>(reader.hexNumber("number")),
                        reader.text("name"),
                        reader.text("implementation"),
                        reader.text("khr") == "yes",
                        reader.text("ext") == "yes",
                        {}};
        reader.forEach("knownFaults", [&](const rapidjson::Value &fault) {
            event.device.knownFaults.push_back(
                {JsonReader::textOf(fault, "text"), JsonReader::textOf(fault, "response")});
        });
        break;
    case Event::Kind::Begin: break;
    case Event::Kind::End: event.outcome = readOutcome(reader); break;
    case Event::Kind::Error: event.message = reader.text("message"); break;
    }
    return event;
}

std::string write(const Reproducer &reproducer)
{
    JsonWriter json;
    beginReport(json, "check --replay");
    json.member("name", reproducer.name).member("api", nameOf(reproducer.api)).member("group", reproducer.group);
    json.member("seed", hexadecimal(reproducer.seed));
    if (!reproducer.shrunk.empty())
        json.key("case").json(reproducer.shrunk);
    json.end();
    return json.text() + "\n";
}

Reproducer parseReproducer(const std::string &text)
{
    const JsonReader reader(text);
    if (reader.text("command") != "check --replay")
        throw Error("no reproducer of vellum check");
    if (const std::string schema = reader.text("schema"); schema != kReportSchema)
        throw Error("is by the schema " + schema + ", which this version of vellum does not read; it reads " +
                    kReportSchema);
    const std::string api = reader.text("api");
    if (api != "khr" && api != "ext")
        throw Error("\"api\" must be khr or ext, got " + api);
    return {reader.text("name"), api == "khr" ? check::Api::Khr : check::Api::Ext, reader.text("group"),
            reader.hexNumber("seed"), reader.json("case")};
}

Reproducer readReproducer(const std::filesystem::path &path)
{
    std::string text;
    try {
        text = readFile(path);
    } catch (const Error &error) {
        throw UsageError(error.what());
    }
    try {
        return parseReproducer(text);
    } catch (const Error &error) {
        throw UsageError(utf8Text(path) + ": " + error.what());
    }
}

} // namespace vellum::cli
