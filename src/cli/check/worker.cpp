// SPDX-License-Identifier: Apache-2.0
#include "cli/check/worker.h"

#include <array>
#include <charconv>
#include <chrono>
#include <exception>
#include <utility>

#include "base/error.h"
#include "base/json_reader.h"
#include "base/json_writer.h"
#include "cli/base/files.h"
#include "cli/check/cases.h"
#include "cli/check/expectations.h"
#include "core/utf8_path.h"
#include "inspect/report_parts.h"

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
    case Event::Kind::End:
        writeOutcome(event.outcome, json);
        json.member("before", hexadecimal(event.before));
        break;
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
    case Event::Kind::End:
        event.outcome = readOutcome(reader);
        event.before = static_cast<size_t>(reader.hexNumber("before"));
        break;
    case Event::Kind::Error: event.message = reader.text("message"); break;
    }
    return event;
}

std::string namesOf(const std::vector<EarlierCase> &cases)
{
    std::string names;
    for (const EarlierCase &earlier : cases)
        names += (names.empty() ? "" : ", ") + earlier.name;
    return names;
}

std::string write(const Reproducer &reproducer)
{
    JsonWriter json;
    beginReport(json, "check --replay");
    json.member("name", reproducer.name).member("api", nameOf(reproducer.api)).member("group", reproducer.group);
    json.member("seed", hexadecimal(reproducer.seed));
    if (!reproducer.before.empty())
        json.list("before", reproducer.before, [&](const EarlierCase &earlier) {
            json.beginObject().member("name", earlier.name).member("group", earlier.group);
            json.member("seed", hexadecimal(earlier.seed)).end();
        });
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
    Reproducer reproducer{reader.text("name"),  api == "khr" ? check::Api::Khr : check::Api::Ext,
                          reader.text("group"), reader.hexNumber("seed"),
                          reader.json("case"),  {}};
    if (!reader.json("before").empty())
        reader.forEach("before", [&](const rapidjson::Value &earlier) {
            const std::string group = JsonReader::textOf(earlier, "group");
            const std::optional<uint64_t> seed = parseHexadecimal(JsonReader::textOf(earlier, "seed"));
            if (findGroup(group) == nullptr || !seed)
                throw Error("there is no case " + JsonReader::textOf(earlier, "name"));
            reproducer.before.push_back({JsonReader::textOf(earlier, "name"), group, *seed});
        });
    return reproducer;
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

namespace
{

class Worker
{
public:
    explicit Worker(const WorkerOptions &options) : options_(options) {}

    void answer(const Request &request, job::Events &events)
    {
        const auto send = [&events](const Event &event) { events.send(write(event)); };
        if (request.kind == Request::Kind::Describe) {
            send({Event::Kind::Device, describeDevice(options_), {}, {}});
            return;
        }
        if (request.kind == Request::Kind::Separate) {
            send(runSeparately(request, events));
            return;
        }
        if (session_ == nullptr)
            session_ = check::openSession({chosenDevice(), options_.api, options_.layer});
        send({Event::Kind::Begin, {}, {}, {}});
        send({Event::Kind::End, {}, outcomeOf(request, events), {}});
    }

private:
    [[nodiscard]] uint32_t chosenDevice() const
    {
        const std::optional<uint32_t> number = options_.device.number();
        if (!number)
            throw Error("a worker takes a device by its number");
        return *number;
    }

    Event runSeparately(const Request &request, job::Events &events)
    {
        SeparateRuns runs(options_, request.timeout);
        const std::string made = runs.make(request.group, request.seed);
        events.send(write(Event{.kind = Event::Kind::Begin}));
        Event end{.kind = Event::Kind::End};
        end.outcome = check::runSeparately(made, options_.api, request.shrinkSeconds,
                                           [&](const std::string &reproducer) { return runs.run(reproducer); });
        const bool repeats = end.outcome.status != check::Status::Pass && end.outcome.status != check::Status::Skip;
        if (!repeats && !request.reproducer.empty())
            runSequence(made, request, runs, events, end);
        return end;
    }

    // Runs the case, which passes alone, after those that its process ran before it. If it fails, drops the first of
    // them while it still crashes.
    void runSequence(const std::string &made, const Request &request, SeparateRuns &runs, job::Events &events,
                     Event &end)
    {
        const Reproducer whole = parseReproducer(request.reproducer);
        const auto after = [&](size_t number) {
            Reproducer sequence = whole;
            sequence.before.erase(sequence.before.begin(), sequence.before.end() - static_cast<ptrdiff_t>(number));
            return sequence;
        };
        const auto run = [&](size_t number) {
            events.send(write(Event{.kind = Event::Kind::Begin})); // it takes as long as all these cases
            return runs.runInNewProcess(after(number));
        };
        const auto crashed = [](const check::Outcome &outcome) {
            return outcome.status == check::Status::Crash || outcome.status == check::Status::DeviceLost;
        };
        size_t number = whole.before.size();
        check::Outcome outcome = run(number);
        if (!crashed(outcome) && outcome.status != check::Status::Timeout)
            return;
        const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(request.shrinkSeconds);
        for (size_t step = crashed(outcome) ? number / 2 : 0; step > 0; step /= 2)
            while (number > step && std::chrono::steady_clock::now() < limit && crashed(run(number - step)))
                number -= step;
        end.outcome = std::move(outcome);
        end.outcome.files = {
            check::separateAccount(made, options_.api, end.outcome,
                                   "only after these cases in the same process: " + namesOf(after(number).before))};
        end.before = number;
    }

    check::Outcome outcomeOf(const Request &request, job::Events &events)
    {
        try {
            if (request.kind == Request::Kind::Run)
                return run(request.group, request.seed);
            if (request.kind == Request::Kind::Make) {
                check::Outcome outcome;
                outcome.reproducer = check::makeCase(*session_, groupOf(request.group), request.seed);
                return outcome;
            }
            const Reproducer reproducer = parseReproducer(request.reproducer);
            for (const EarlierCase &earlier : reproducer.before) {
                const Request alone{.group = earlier.group, .seed = earlier.seed};
                if (check::Outcome outcome = outcomeOf(alone, events); outcome.status == check::Status::DeviceLost)
                    return outcome;
                events.send(write(Event{.kind = Event::Kind::Begin})); // of the next case
            }
            return reproducer.shrunk.empty() ? run(reproducer.group, reproducer.seed)
                                             : check::replay(*session_, reproducer.shrunk);
        } catch (const std::exception &error) {
            check::Outcome outcome;
            outcome.status = check::Status::Fail;
            outcome.cause = std::string("exception: ") + error.what();
            return outcome;
        }
    }

    check::Outcome run(const std::string &group, uint64_t seed) { return groupOf(group).run(*session_, group, seed); }

    static const check::Group &groupOf(const std::string &name)
    {
        const check::Group *group = findGroup(name);
        if (group == nullptr)
            throw Error("there is no group " + name);
        return *group;
    }

    WorkerOptions options_;
    std::shared_ptr<check::Session> session_;
};

} // namespace

int runWorker(const WorkerOptions &options)
{
    Worker worker(options);
    return job::answerRequests(
        [&](const std::string &request, job::Events &events) { worker.answer(parseRequest(request), events); });
}

namespace
{

constexpr int kMillisecondsBetweenChecks = 20;

std::vector<std::string> argumentsOf(const WorkerOptions &options)
{
    std::vector<std::string> arguments = {"check", "--worker", "--api", nameOf(options.api)};
    if (options.device.text())
        arguments.insert(arguments.end(), {"--device", *options.device.text()});
    if (!options.layer)
        arguments.emplace_back("--no-layer");
    return arguments;
}

} // namespace

WorkerProcess::WorkerProcess(const WorkerOptions &options) : Worker(argumentsOf(options)) {}

WorkerProcess::Output WorkerProcess::read()
{
    const Worker::Output read = Worker::read();
    Output output{{}, read.end};
    for (const std::string &line : read.lines) {
        try {
            output.events.push_back(parseEvent(line));
        } catch (const Error &) { // a driver writes where it should not
        }
    }
    return output;
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
    worker.startWaiting();
    while (!worker.isLate(seconds) && !Interruptible::interrupted()) {
        const ChildProcess *const process = &worker.process();
        ChildProcess::waitForAny({&process, 1}, kMillisecondsBetweenChecks);
        const auto [events, end] = worker.read();
        for (const Event &event : events) {
            if (event.kind != Event::Kind::Begin)
                return {event, {}};
            worker.startWaiting();
        }
        if (end)
            return {{}, end};
    }
    return {};
}

std::string SeparateRuns::make(const std::string &group, uint64_t seed)
{
    const check::Outcome outcome = outcomeOf({.kind = Request::Kind::Make, .group = group, .seed = seed});
    if (outcome.status != check::Status::Pass)
        throw Error(outcome.cause.empty() ? "timeout" : outcome.cause);
    return outcome.reproducer;
}

check::Outcome SeparateRuns::run(const std::string &reproducer)
{
    return outcomeOf(
        {.kind = Request::Kind::Replay, .reproducer = write(Reproducer{.api = options_.api, .shrunk = reproducer})});
}

check::Outcome SeparateRuns::runInNewProcess(const Reproducer &reproducer)
{
    process_.reset();
    check::Outcome outcome = outcomeOf({.kind = Request::Kind::Replay, .reproducer = write(reproducer)});
    process_.reset();
    return outcome;
}

check::Outcome SeparateRuns::outcomeOf(const Request &request)
{
    if (process_ == nullptr)
        process_ = std::make_unique<WorkerProcess>(options_);
    process_->send(request);
    const Answer answer = waitForAnswer(*process_, timeout_);
    const std::string printed = process_->printed();
    const std::string cause = answer.end ? process_->causeOf(*answer.end) : "";
    const bool alive = answer.event && answer.event->kind == Event::Kind::End &&
                       answer.event->outcome.status != check::Status::DeviceLost;
    if (!alive)
        process_.reset();
    if (answer.event)
        return answer.event->kind == Event::Kind::End
                   ? answer.event->outcome
                   : outcomeOfEnd(check::Status::Crash, answer.event->message, printed);
    if (answer.end)
        return outcomeOfEnd(check::Status::Crash, cause, printed);
    return outcomeOfEnd(check::Status::Timeout, "", printed);
}

} // namespace vellum::cli
