// SPDX-License-Identifier: Apache-2.0
#include "cli/check/protocol.h"

#include <array>
#include <charconv>
#include <rapidjson/document.h>
#include <rapidjson/stringbuffer.h>
#include <rapidjson/writer.h>

#include "cli/base/error.h"
#include "cli/base/input_files.h"
#include "cli/base/report_parts.h"
#include "cli/check/case_id.h"
#include "cli/check/expectations.h"
#include "core/utf8_path.h"
#include "gltf/file/json_writer.h"

namespace vellum::cli
{
namespace
{

constexpr std::array kRequests = {"describe", "run", "replay", "make", "separate"};
constexpr std::array kEvents = {"device", "begin", "end", "error"};
constexpr std::array kStatuses = {check::Status::Pass,  check::Status::Fail,    check::Status::Skip,
                                  check::Status::Crash, check::Status::Timeout, check::Status::DeviceLost};

std::string hexOf(const std::string &bytes)
{
    constexpr const char *kDigits = "0123456789abcdef";
    std::string text;
    text.reserve(2 * bytes.size());
    for (const char c : bytes) {
        text += kDigits[static_cast<uint8_t>(c) >> 4];
        text += kDigits[static_cast<uint8_t>(c) & 15];
    }
    return text;
}

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

// A JSON object whose members are read; what is missing is an error.
class Reader
{
public:
    explicit Reader(const std::string &text)
    {
        document_.Parse(text.data(), text.size());
        if (document_.HasParseError() || !document_.IsObject())
            throw Error("no JSON object");
    }

    [[nodiscard]] std::string text(const char *name) const { return textOf(document_, name); }
    static std::string textOf(const rapidjson::Value &object, const char *name)
    {
        const auto member = object.FindMember(name);
        if (member == object.MemberEnd() || !member->value.IsString())
            throw Error(std::string("no string \"") + name + "\"");
        return {member->value.GetString(), member->value.GetStringLength()};
    }
    [[nodiscard]] uint64_t hexNumber(const char *name) const
    {
        const std::optional<uint64_t> number = parseHexadecimal(text(name));
        if (!number)
            throw Error(std::string("\"") + name + "\" must be a hexadecimal number");
        return *number;
    }
    // What add(object) makes of each object of an array.
    template <typename Add>
    void forEach(const char *name, Add &&add) const
    {
        const auto member = document_.FindMember(name);
        if (member == document_.MemberEnd() || !member->value.IsArray())
            throw Error(std::string("no array \"") + name + "\"");
        for (const rapidjson::Value &element : member->value.GetArray()) {
            if (!element.IsObject())
                throw Error(std::string("no object in \"") + name + "\"");
            add(element);
        }
    }
    // A member as JSON; empty if there is none.
    [[nodiscard]] std::string json(const char *name) const
    {
        const auto member = document_.FindMember(name);
        if (member == document_.MemberEnd())
            return {};
        rapidjson::StringBuffer buffer;
        rapidjson::Writer<rapidjson::StringBuffer> writer(buffer);
        member->value.Accept(writer);
        return {buffer.GetString(), buffer.GetSize()};
    }

private:
    rapidjson::Document document_;
};

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
    for (const check::Status status : kStatuses)
        if (name == nameOf(status))
            return status;
    throw Error("the status " + name + " is unknown");
}

void writeOutcome(const check::Outcome &outcome, JsonWriter &json)
{
    json.member("status", nameOf(outcome.status)).member("cause", outcome.cause).member("detail", outcome.detail);
    json.member("reproducer", outcome.reproducer).member("rays", hexadecimal(outcome.rays));
    json.list("files", outcome.files, [&](const check::OutcomeFile &file) {
        json.beginObject().member("extension", file.extension).member("hex", hexOf(file.bytes)).end();
    });
}

check::Outcome readOutcome(const Reader &reader)
{
    check::Outcome outcome{statusOf(reader.text("status")), reader.text("cause"),     reader.text("detail"),
                           reader.text("reproducer"),       reader.hexNumber("rays"), {}};
    reader.forEach("files", [&](const rapidjson::Value &file) {
        outcome.files.push_back({Reader::textOf(file, "extension"), bytesOf(Reader::textOf(file, "hex"))});
    });
    return outcome;
}

} // namespace

std::string write(const Request &request)
{
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("request", kRequests.at(static_cast<size_t>(request.kind)));
    json.member("group", request.group).member("seed", hexadecimal(request.seed));
    json.member("document", utf8Text(request.document)).member("timeout", hexadecimal(request.timeout));
    json.member("shrinkSeconds", hexadecimal(request.shrinkSeconds)).end();
    return json.text();
}

Request parseRequest(const std::string &line)
{
    const Reader reader(line);
    return {kindOf<Request::Kind>(reader.text("request"), kRequests),
            reader.text("group"),
            reader.hexNumber("seed"),
            utf8Path(reader.text("document")),
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
    case Event::Kind::Error: json.member("message", event.message); break;
    }
    json.end();
    return json.text();
}

Event parseEvent(const std::string &line)
{
    const Reader reader(line);
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
            event.device.knownFaults.push_back({Reader::textOf(fault, "text"), Reader::textOf(fault, "response")});
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

Reproducer readReproducer(const std::filesystem::path &path)
{
    std::string text;
    try {
        text = readFile(path);
    } catch (const Error &error) {
        throw UsageError(error.what());
    }
    try {
        const Reader reader(text);
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
    } catch (const Error &error) {
        throw UsageError(utf8Text(path) + ": " + error.what());
    }
}

} // namespace vellum::cli
