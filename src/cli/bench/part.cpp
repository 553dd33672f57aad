// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/part.h"

#include <algorithm>
#include <chrono>
#include <fmt/format.h>
#include <iterator>
#include <string_view>

#include "base/error.h"
#include "base/json_reader.h"
#include "base/json_writer.h"
#include "base/process.h"
#include "base/statistics.h"
#include "check/groups/group.h"
#include "cli/bench/timing.h"
#include "cli/info/device_details.h"
#include "core/utf8_path.h"
#include "gpu/instance.h"
#include "render/baked_scene.h"
#include "render/grove.h"

namespace vellum::cli
{
namespace
{

constexpr uint32_t kLevels[] = {3, 5, 7};

class Clock
{
public:
    [[nodiscard]] double seconds() const
    {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    }

private:
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

// The destination of the part's events.
job::Events *events = nullptr;

// A row, sent when it is complete. Html: so that the report can hold it as it is.
template <typename Write>
void sendRow(const char *kind, Write &&write)
{
    JsonWriter json(JsonStyle::Html);
    json.beginObject().member("row", kind);
    write(json);
    json.end();
    events->send(rowEvent(json.text()));
}

// Something was completed: the device does not hang.
void reportProgress()
{
    static Clock sinceLast;
    static bool first = true;
    if (!first && sinceLast.seconds() < 0.1)
        return;
    first = false;
    sinceLast = Clock();
    events->send(kProgressEvent);
}

void writeQuartiles(JsonWriter &json, const char *name, const Quartiles &quartiles)
{
    json.key(name).beginArray().value(quartiles.low).value(quartiles.middle).value(quartiles.high).end();
}

// The two devices that are compared: without the layer, and with micromaps by one implementation.
struct Devices {
    explicit Devices(const Part &part, const BenchDevice &wanted)
        : without(false), with(true), bareInfo(wanted.device.from(without)), layeredInfo(wanted.device.from(with))
    {
        gpu::requireMicromaps(layeredInfo, part.api, with.hasLayers());
    }
    void create(gpu::Api api)
    {
        bare = std::make_unique<gpu::Device>(bareInfo, std::nullopt);
        layered = std::make_unique<gpu::Device>(layeredInfo, api);
    }
    gpu::Instance without, with;
    gpu::DeviceInfo bareInfo, layeredInfo;
    std::unique_ptr<gpu::Device> bare, layered;
};

// --- device ---

void describe(const BenchDevice &wanted)
{
    const gpu::Instance instance(true);
    const gpu::DeviceInfo chosen = wanted.device.from(instance);
    const DeviceDetails details = describeDevices(instance).at(chosen.number);
    sendRow("device", [&](JsonWriter &json) { writeMembers(details, json); });
}

// --- self-check ---

void selfCheck(const Part &part, const BenchDevice &wanted)
{
    const auto session = check::openSession({wanted.device.from(gpu::Instance(true)).number, part.api, true});
    const Clock clock;
    uint64_t passed = 0, failed = 0, skipped = 0, rays = 0;
    std::string first;
    for (uint64_t seed = 1; clock.seconds() < part.seconds; ++seed) {
        for (const check::Group &group : check::groups()) {
            const check::Outcome outcome = group.run(*session, group.name, seed);
            reportProgress();
            rays += outcome.rays;
            if (outcome.status == check::Status::Pass)
                ++passed;
            else if (outcome.status == check::Status::Skip)
                ++skipped;
            else if (++failed == 1)
                first = std::string(group.name) + ": " + outcome.cause;
            if (clock.seconds() >= part.seconds)
                break;
        }
    }
    sendRow("check", [&](JsonWriter &json) {
        json.member("passed", passed).member("failed", failed).member("skipped", skipped).member("rays", rays);
        json.member("firstFailure", first);
    });
}

// --- frames ---

// One side of a comparison: durations by the device's timestamps if it has them, and by the clock.
class Timed
{
public:
    double add(gpu::Milliseconds milliseconds)
    {
        reportProgress();
        walls_.push_back(milliseconds.wall);
        return milliseconds.gpu;
    }
    [[nodiscard]] double wall() const { return median(walls_); }

private:
    std::vector<double> walls_;
};

// The largest picture of which a frame takes no longer than some milliseconds, or the smallest: systems reset a device
// that works too long on one submission.
render::RenderSettings settingsFor(gpu::Device &device, const render::RenderScene &scene, render::Trace trace)
{
    constexpr std::pair<uint32_t, uint32_t> kSizes[] = {{160, 90}, {320, 180}, {640, 360}, {1280, 720}};
    constexpr double kLongest = 40;
    render::RenderSettings settings;
    settings.trace = trace;
    for (const auto &[width, height] : kSizes) {
        render::RenderSettings larger = settings;
        larger.width = width;
        larger.height = height;
        larger.heavy = true;
        render::Renderer renderer(device, scene, {}, larger);
        renderer.frame(); // warms up
        reportProgress();
        const bool longer = renderer.frame() > kLongest;
        reportProgress();
        if (longer && width != kSizes[0].first)
            break;
        settings.width = width;
        settings.height = height;
        if (longer)
            break;
    }
    return settings;
}

// Values that do not depend on the cost of the alpha test.
struct FrameFacts {
    double candidatesPerRay[2] = {}; // with the alpha test alone, with micromaps
    uint64_t differingPixels = 0;
};

FrameFacts factsOf(render::Renderer &alpha, render::Renderer &micromaps)
{
    FrameFacts facts;
    size_t side = 0;
    for (render::Renderer *renderer : {&alpha, &micromaps}) {
        renderer->frame();
        reportProgress();
        facts.candidatesPerRay[side++] = renderer->count().perRay();
        reportProgress();
    }
    facts.differingPixels = compare(alpha.picture(), micromaps.picture()).pixels;
    return facts;
}

void measureFrames(const Part &part, const BenchDevice &wanted)
{
    const Clock clock;
    Devices devices(part, wanted);
    devices.create(part.api);
    const render::RenderScene scene = render::prepareScene(render::makeGrove(), 1);
    render::RenderSettings settings = settingsFor(*devices.bare, scene, part.trace);
    size_t left = 2 * std::size(kLevels);
    for (const uint32_t level : kLevels) {
        BakeOptions options;
        options.level = level;
        const render::BakedScene baked = render::bakeScene(scene.scene, options);
        reportProgress();
        std::optional<FrameFacts> facts;
        for (const bool heavy : {false, true}) {
            settings.heavy = heavy;
            render::Renderer alpha(*devices.bare, scene, {}, settings);
            reportProgress();
            render::Renderer micromaps(*devices.layered, scene, baked.micromaps(), settings);
            reportProgress();
            if (!facts)
                facts = factsOf(alpha, micromaps);
            Timed alphaTimes, micromapTimes;
            PairedTiming times([&] { return alphaTimes.add(alpha.timedFrame()); },
                               [&] { return micromapTimes.add(micromaps.timedFrame()); });
            const double end = clock.seconds() + (part.seconds - clock.seconds()) / static_cast<double>(left--);
            do {
                times.measure();
            } while (times.pairs() < 101 && (times.pairs() < 5 || clock.seconds() < end));
            sendRow("frame", [&](JsonWriter &json) {
                json.member("level", level).member("heavy", heavy);
                json.member("width", settings.width).member("height", settings.height);
                json.member("alpha", times.a()).member("micromaps", times.b());
                json.member("alphaWall", alphaTimes.wall()).member("micromapsWall", micromapTimes.wall());
                writeQuartiles(json, "ratio", times.ratio());
                json.member("uncertainty", times.uncertainty()).member("pairs", times.pairs());
                json.member("timestamps", devices.layered->hasTimestamps());
                json.member("differingPixels", facts->differingPixels);
                json.values("candidatesPerRay", facts->candidatesPerRay);
                json.member("micromapBytes", micromaps.micromapBytes());
                json.member("alphaStructureBytes", alpha.structureBytes());
                json.member("micromapsStructureBytes", micromaps.structureBytes());
            });
        }
    }
}

// --- builds ---

// Repeats the triangles, each with data of its own.
Micromap repeated(const Micromap &micromap, size_t times)
{
    Micromap all;
    for (size_t i = 0; i < times; ++i) {
        for (MicromapTriangle triangle : micromap.triangles) {
            triangle.dataOffset += static_cast<uint32_t>(all.data.size());
            all.triangles.push_back(triangle);
        }
        all.data.insert(all.data.end(), micromap.data.begin(), micromap.data.end());
    }
    for (size_t i = 0; i < all.triangles.size(); ++i)
        all.indices.push_back(static_cast<int32_t>(i));
    return all;
}

// Measures a micromap of about 1,000 triangles.
void measureMicromaps(gpu::Device &device, const render::BakedScene &baked, uint32_t level, double seconds)
{
    const std::vector<const Micromap *> all = baked.micromaps();
    const auto one =
        std::ranges::find_if(all, [](const Micromap *micromap) { return micromap && !micromap->triangles.empty(); });
    if (one == all.end())
        return;
    const Micromap large = repeated(**one, 1024 / (*one)->triangles.size());
    std::vector<double> times;
    Timed wall;
    const Clock clock;
    do {
        times.push_back(wall.add(render::DeviceMicromap(device, large).build()));
    } while (times.size() < 5 || clock.seconds() < seconds);
    sendRow("micromap", [&](JsonWriter &json) {
        json.member("level", level).member("triangles", large.triangles.size()).member("wall", wall.wall());
        writeQuartiles(json, "milliseconds", quartiles(times));
    });
}

void measureBuilds(const Part &part, const BenchDevice &wanted)
{
    Devices devices(part, wanted);
    const double share = part.seconds / 8;
    TimedWorld bare(devices.bareInfo, std::nullopt), layered(devices.layeredInfo, part.api);
    const auto compareBuilds = [&](const std::string &what, uint32_t count, std::unique_ptr<TimedBuilds> bareBuilds,
                                   std::unique_ptr<TimedBuilds> layeredBuilds) {
        Timed bareTimes, layeredTimes;
        PairedTiming times([&] { return bareTimes.add(bareBuilds->run()); },
                           [&] { return layeredTimes.add(layeredBuilds->run()); });
        const Clock clock;
        do {
            times.measure();
        } while (times.pairs() < 3 || (clock.seconds() < share && times.pairs() < 501));
        sendRow("build", [&](JsonWriter &json) {
            json.member("what", what).member("structures", count);
            json.member("withoutLayer", times.a()).member("withLayer", times.b());
            json.member("withoutLayerWall", bareTimes.wall()).member("withLayerWall", layeredTimes.wall());
            writeQuartiles(json, "ratio", times.ratio());
            json.member("uncertainty", times.uncertainty()).member("pairs", times.pairs());
        });
    };
    for (const uint32_t count : {1u, 1000u, 10000u})
        compareBuilds(fmt::format("TLAS, {} instance{}", count, count == 1 ? "" : "s"), 1, bare.top(count),
                      layered.top(count));
    compareBuilds("1000 BLASes of one triangle", 1000, bare.bottoms(1000), layered.bottoms(1000));
    devices.create(part.api);
    const render::RenderScene scene = render::prepareScene(render::makeGrove(), 1);
    for (const uint32_t level : kLevels) {
        BakeOptions options;
        options.level = level;
        measureMicromaps(*devices.layered, render::bakeScene(scene.scene, options), level, share);
    }
}

// --- pipelines ---

void measurePipelineCreation(const Part &part, const BenchDevice &wanted)
{
    Devices devices(part, wanted);
    devices.create(part.api);
    const std::vector<render::Trace> traces = render::tracesOf(devices.layeredInfo);
    const render::RenderScene scene = render::prepareScene(render::makeGrove(), 1);
    const double share = part.seconds / static_cast<double>(traces.size());
    for (const render::Trace trace : traces) {
        const Clock clock;
        const auto timings =
            measurePipelines({*devices.bare, *devices.layered}, scene, trace, kLevels[0], reportProgress,
                             [&](size_t pairs) { return pairs < 3 || (pairs < 21 && clock.seconds() < share); });
        for (const PipelineTiming &timing : timings) {
            sendRow("pipeline", [&](JsonWriter &json) {
                json.member("trace", trace == render::Trace::Query ? "query" : "pipeline");
                json.member("withMicromaps", timing.micromaps);
                json.member("withoutLayer", timing.bare).member("withLayer", timing.layered);
                json.member("ratio", timing.ratio);
            });
        }
    }
}

} // namespace

std::string Part::name() const
{
    std::string name = kPartNames[static_cast<size_t>(kind)];
    if (kind == PartKind::Frames)
        name += trace == render::Trace::Query ? "-query" : "-pipeline";
    name += "-" + implementation;
    return kind == PartKind::Device ? name : name + (api == gpu::Api::Khr ? "-khr" : "-ext");
}

void runPart(const Part &part, const BenchDevice &device, job::Events &output)
{
    events = &output;
    setVariable("VELLUM_IMPLEMENTATION", part.implementation);
    if (part.kind == PartKind::Pipelines)
        disableShaderCaches();
    gpu::offerLayer(device.layerFolder);
    switch (part.kind) {
    case PartKind::Device: describe(device); break;
    case PartKind::Check: selfCheck(part, device); break;
    case PartKind::Frames: measureFrames(part, device); break;
    case PartKind::Builds: measureBuilds(part, device); break;
    case PartKind::Pipelines: measurePipelineCreation(part, device); break;
    }
}

namespace
{

constexpr std::string_view kRowEvent = R"({"event":"row","row":)"; // and the row, and a brace

std::vector<std::string> argumentsOf(PartKind kind, const BenchDevice &device)
{
    std::vector<std::string> words = {"bench", "--worker", kPartNames[static_cast<size_t>(kind)]};
    if (device.device.text())
        words.insert(words.end(), {"--device", *device.device.text()});
    if (device.layerFolder)
        words.insert(words.end(), {"--layer-path", utf8Text(*device.layerFolder)});
    return words;
}

std::string write(const Part &part)
{
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("part", kPartNames[static_cast<size_t>(part.kind)]);
    json.member("implementation", part.implementation).member("api", part.api == gpu::Api::Khr ? "khr" : "ext");
    json.member("trace", part.trace == render::Trace::Query ? "query" : "pipeline");
    return json.member("milliseconds", hexadecimal(static_cast<uint64_t>(1000 * part.seconds))).end().text();
}

Part parsePart(const std::string &request)
{
    const JsonReader reader(request);
    const auto kind = std::ranges::find(kPartNames, reader.text("part"));
    if (kind == std::end(kPartNames))
        throw Error("there is no part " + reader.text("part"));
    return {static_cast<PartKind>(kind - std::begin(kPartNames)), reader.text("implementation"),
            reader.text("api") == "khr" ? gpu::Api::Khr : gpu::Api::Ext,
            reader.text("trace") == "query" ? render::Trace::Query : render::Trace::Pipeline,
            static_cast<double>(reader.hexNumber("milliseconds")) / 1000};
}

// The row of an event; nothing of another line. A driver may print as well, in the middle of a line too.
std::optional<std::string> rowOf(const std::string &line)
{
    rapidjson::Document event;
    if (!line.starts_with(kRowEvent) ||
        event.Parse<rapidjson::kParseIterativeFlag>(line.data(), line.size()).HasParseError() ||
        !event["row"].IsObject() || !event["row"].HasMember("row") || !event["row"]["row"].IsString())
        return std::nullopt;
    return line.substr(kRowEvent.size(), line.size() - kRowEvent.size() - 1);
}

// Describes the failure; empty for success.
std::string failureOf(const ProcessEnd &end)
{
    return !end.crash.empty() ? "crashed: " + end.crash
           : end.code == 0    ? ""
                              : fmt::format("ended with code {}", end.code);
}

} // namespace

std::string rowEvent(const std::string &row)
{
    return std::string(kRowEvent) + row + "}";
}

int runPartWorker(const BenchDevice &device)
{
    return job::answerRequests(
        [&](const std::string &request, job::Events &events) { runPart(parsePart(request), device, events); });
}

PartResult runPartProcess(const Part &part, const BenchDevice &device, double timeout,
                          const std::function<void()> &progress)
{
    constexpr double kSecondsOfLook = 0.1;
    PartResult result;
    result.part = part;
    result.others = shareOfOthers(kSecondsOfLook);
    const auto begin = std::chrono::steady_clock::now();
    std::optional<job::Worker> worker;
    try {
        worker.emplace(argumentsOf(part.kind, device));
    } catch (const Error &error) { // a limit of processes or of files
        result.failure = error.what();
        return result;
    }
    worker->send(write(part));
    worker->endRequests();
    const ChildProcess *const process = &worker->process();
    std::optional<ProcessEnd> end;
    std::optional<std::string> error;
    worker->startWaiting();
    for (; !end && !worker->isLate(timeout) && !Interruptible::interrupted(); progress()) {
        ChildProcess::waitForAny({&process, 1}, 200);
        job::Worker::Output output = worker->read();
        end = std::move(output.end);
        for (const std::string &line : output.lines) {
            if (std::optional<std::string> row = rowOf(line))
                result.rows.push_back(std::move(*row));
            else if (const auto message = job::errorIn(line))
                error = message;
            else if (line != kProgressEvent)
                continue; // a driver that hangs may print
            worker->startWaiting();
        }
    }
    if (Interruptible::interrupted()) // the interrupt may have ended the process as well
        result.failure = "interrupted";
    else
        result.failure =
            end ? error.value_or(failureOf(*end)) : fmt::format("hung: no progress for {:g} seconds", timeout);
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    worker.reset();
    result.others = (result.others + shareOfOthers(kSecondsOfLook)) / 2;
    return result;
}

} // namespace vellum::cli
