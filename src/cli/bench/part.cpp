// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/part.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fmt/format.h>

#include "check/groups/group.h"
#include "cli/base/paired_timing.h"
#include "cli/base/system/child_process.h"
#include "cli/base/system/this_process.h"
#include "cli/bench/pipeline_timing.h"
#include "cli/bench/structure_timing.h"
#include "cli/info/device_details.h"
#include "cli/scene/baked_scene.h"
#include "cli/scene/grove.h"
#include "cli/vulkan/layer_path.h"
#include "gltf/file/json_writer.h"

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

// A row, printed when it is complete. Html: so that the report can hold it as it is.
template <typename Write>
void printRow(const char *kind, Write &&write)
{
    JsonWriter json(JsonStyle::Html);
    json.beginObject().member("row", kind);
    write(json);
    json.end();
    fmt::print("{}\n", json.text());
    std::fflush(stdout);
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
    fmt::print("{}\n", kProgressLine);
    std::fflush(stdout);
}

void writeQuartiles(JsonWriter &json, const char *name, const Quartiles &quartiles)
{
    json.key(name).beginArray().value(quartiles.low).value(quartiles.middle).value(quartiles.high).end();
}

// The two devices that are compared: without the layer, and with micromaps by one implementation.
struct Devices {
    explicit Devices(const Part &part, const BenchDevice &wanted)
        : without(false), with(true), bareInfo(chooseDevice(without, wanted.device)),
          layeredInfo(chooseDevice(with, wanted.device))
    {
        requireMicromaps(layeredInfo, part.api, with.layerEnabled());
    }
    void create(MicromapApi api)
    {
        bare = std::make_unique<Device>(bareInfo, DeviceNeeds{std::nullopt, bareInfo.rayTracingPipelines});
        layered = std::make_unique<Device>(layeredInfo, DeviceNeeds{api, layeredInfo.rayTracingPipelines});
    }
    Instance without, with;
    DeviceInfo bareInfo, layeredInfo;
    std::unique_ptr<Device> bare, layered;
};

// --- device ---

void describe(const BenchDevice &wanted)
{
    const Instance instance(true);
    const DeviceInfo chosen = chooseDevice(instance, wanted.device);
    const DeviceDetails details = describeDevices(instance).at(chosen.number);
    printRow("device", [&](JsonWriter &json) { writeMembers(details, json); });
}

// --- self-check ---

void selfCheck(const Part &part, const BenchDevice &wanted)
{
    const check::Api api = part.api == MicromapApi::Khr ? check::Api::Khr : check::Api::Ext;
    const auto session = check::openSession({chooseDevice(Instance(true), wanted.device).number, api, true});
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
    printRow("check", [&](JsonWriter &json) {
        json.member("passed", passed).member("failed", failed).member("skipped", skipped).member("rays", rays);
        json.member("firstFailure", first);
    });
}

// --- frames ---

// One side of a comparison: durations by the device's timestamps where it has them, and by the clock.
class Timed
{
public:
    double add(Milliseconds milliseconds)
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
RenderSettings settingsFor(Device &device, const RenderScene &scene, Trace trace)
{
    constexpr std::pair<uint32_t, uint32_t> kSizes[] = {{160, 90}, {320, 180}, {640, 360}, {1280, 720}};
    constexpr double kLongest = 40;
    RenderSettings settings;
    settings.trace = trace;
    for (const auto &[width, height] : kSizes) {
        RenderSettings larger = settings;
        larger.width = width;
        larger.height = height;
        larger.heavy = true;
        Renderer renderer(device, scene, {}, larger);
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

// What does not depend on how much the alpha test costs.
struct FrameFacts {
    double candidatesPerRay[2] = {}; // with the alpha test alone, with micromaps
    uint64_t differingPixels = 0;
};

FrameFacts factsOf(Renderer &alpha, Renderer &micromaps)
{
    FrameFacts facts;
    size_t side = 0;
    for (Renderer *renderer : {&alpha, &micromaps}) {
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
    const RenderScene scene = prepareScene(makeGrove(), 1);
    RenderSettings settings = settingsFor(*devices.bare, scene, part.trace);
    size_t left = 2 * std::size(kLevels);
    for (const uint32_t level : kLevels) {
        BakeOptions options;
        options.level = level;
        const BakedScene baked = bakeScene(scene.scene, options);
        reportProgress();
        std::optional<FrameFacts> facts;
        for (const bool heavy : {false, true}) {
            settings.heavy = heavy;
            Renderer alpha(*devices.bare, scene, {}, settings);
            reportProgress();
            Renderer micromaps(*devices.layered, scene, baked.micromaps(), settings);
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
            printRow("frame", [&](JsonWriter &json) {
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

// The same triangles again and again, each with data of its own.
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

// One of about 1,000 triangles.
void measureMicromaps(Device &device, const BakedScene &baked, uint32_t level, double seconds)
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
        times.push_back(wall.add(makeMicromap(device, large)->buildTime()));
    } while (times.size() < 5 || clock.seconds() < seconds);
    printRow("micromap", [&](JsonWriter &json) {
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
        printRow("build", [&](JsonWriter &json) {
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
    const RenderScene scene = prepareScene(makeGrove(), 1);
    for (const uint32_t level : kLevels) {
        BakeOptions options;
        options.level = level;
        measureMicromaps(*devices.layered, bakeScene(scene.scene, options), level, share);
    }
}

// --- pipelines ---

void measurePipelineCreation(const Part &part, const BenchDevice &wanted)
{
    Devices devices(part, wanted);
    devices.create(part.api);
    std::vector<Trace> traces = {Trace::Query};
    if (devices.layeredInfo.rayTracingPipelines)
        traces.push_back(Trace::Pipeline);
    const RenderScene scene = prepareScene(makeGrove(), 1);
    const double share = part.seconds / static_cast<double>(traces.size());
    for (const Trace trace : traces) {
        const Clock clock;
        const auto timings =
            measurePipelines({*devices.bare, *devices.layered}, scene, trace, kLevels[0], reportProgress,
                             [&](size_t pairs) { return pairs < 3 || (pairs < 21 && clock.seconds() < share); });
        for (const PipelineTiming &timing : timings) {
            printRow("pipeline", [&](JsonWriter &json) {
                json.member("trace", trace == Trace::Query ? "query" : "pipeline");
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
        name += trace == Trace::Query ? "-query" : "-pipeline";
    name += "-" + implementation;
    return kind == PartKind::Device ? name : name + (api == MicromapApi::Khr ? "-khr" : "-ext");
}

int runPart(const Part &part, const BenchDevice &device)
{
    endWithParent();
    setVariable("VELLUM_IMPLEMENTATION", part.implementation);
    if (part.kind == PartKind::Pipelines)
        disableShaderCaches();
    offerLayer(device.layerFolder);
    switch (part.kind) {
    case PartKind::Device: describe(device); break;
    case PartKind::Check: selfCheck(part, device); break;
    case PartKind::Frames: measureFrames(part, device); break;
    case PartKind::Builds: measureBuilds(part, device); break;
    case PartKind::Pipelines: measurePipelineCreation(part, device); break;
    }
    return 0;
}

} // namespace vellum::cli
