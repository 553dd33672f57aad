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

void writeQuartiles(JsonWriter &json, const char *name, const Quartiles &quartiles)
{
    json.key(name).beginArray().value(quartiles.low).value(quartiles.middle).value(quartiles.high).end();
}

// The two devices that are compared: without the layer, and with micromaps by one implementation.
struct Devices {
    explicit Devices(const Part &part, const BenchDevice &wanted)
        : without(false), with(true), classicInfo(chooseDevice(without, wanted.device)),
          info(chooseDevice(with, wanted.device))
    {
        requireMicromaps(info, part.api, with.layerEnabled());
    }
    void create(MicromapApi api)
    {
        classic = std::make_unique<Device>(classicInfo, DeviceNeeds{std::nullopt, classicInfo.rayTracingPipelines});
        enabled = std::make_unique<Device>(info, DeviceNeeds{api, info.rayTracingPipelines});
    }
    Instance without, with;
    DeviceInfo classicInfo, info;
    std::unique_ptr<Device> classic, enabled;
};

// --- device ---

const char *nameOf(Provider provider)
{
    switch (provider) {
    case Provider::Driver: return "driver";
    case Provider::Layer: return "emulated";
    case Provider::Translated: return "translated";
    case Provider::Nobody: break;
    }
    return "none";
}

void describe(const BenchDevice &wanted)
{
    const Instance instance(true);
    const DeviceInfo chosen = chooseDevice(instance, wanted.device);
    const std::vector<DeviceInfo> infos = listDevices(instance);
    const auto index = static_cast<size_t>(
        std::ranges::find_if(infos, [&](const DeviceInfo &i) { return i.handle == chosen.handle; }) - infos.begin());
    const DeviceDetails details = describeDevices(instance)[index];
    printRow("device", [&](JsonWriter &json) {
        json.member("name", details.name).member("driver", details.driver).member("vulkan", details.version);
        json.member("kind", details.kind).member("rayTracingPipelines", details.rayTracingPipelines);
        json.member("ext", nameOf(details.ext)).member("khr", nameOf(details.khr));
        json.member("most2StateLevel", details.most2StateLevel).member("most4StateLevel", details.most4StateLevel);
        json.values("missing", details.missing);
    });
}

// --- self-check ---

void selfCheck(const Part &part, const BenchDevice &wanted)
{
    const check::Api api = part.api == MicromapApi::Khr ? check::Api::Khr : check::Api::Ext;
    const auto session = check::openSession({wanted.device, api, true});
    const Clock clock;
    uint64_t passed = 0, failed = 0, skipped = 0, rays = 0;
    std::string first;
    for (uint64_t seed = 1; clock.seconds() < part.seconds; ++seed) {
        for (const check::Group &group : check::groups()) {
            const check::Outcome outcome = group.run(*session, group.name, seed);
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

// Frames of one renderer, by the device's timestamps where it has them, and by the clock.
class TimedFrames
{
public:
    TimedFrames(Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps,
                const RenderSettings &settings)
        : renderer_(device, scene, micromaps, settings)
    {
    }
    double operator()()
    {
        const Clock clock;
        const double milliseconds = renderer_.frame();
        wall_.push_back(1e3 * clock.seconds());
        return milliseconds;
    }
    [[nodiscard]] double wall() const { return median(wall_); }
    Renderer &renderer() { return renderer_; }

private:
    Renderer renderer_;
    std::vector<double> wall_;
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
        const bool longer = renderer.frame() > kLongest;
        if (longer && width != kSizes[0].first)
            break;
        settings.width = width;
        settings.height = height;
        if (longer)
            break;
    }
    return settings;
}

void measureFrames(const Part &part, const BenchDevice &wanted)
{
    const Clock clock;
    Devices devices(part, wanted);
    devices.create(part.api);
    const RenderScene scene = prepareScene(makeGrove(), 1);
    RenderSettings settings = settingsFor(*devices.classic, scene, part.trace);
    size_t left = 2 * std::size(kLevels);
    for (const uint32_t level : kLevels) {
        BakeOptions options;
        options.level = level;
        const BakedScene baked = bakeScene(scene.scene, options);
        for (const bool heavy : {false, true}) {
            settings.heavy = heavy;
            TimedFrames alpha(*devices.classic, scene, {}, settings);
            TimedFrames micromaps(*devices.enabled, scene, baked.micromaps(), settings);
            alpha();
            micromaps();
            const Difference difference = compare(alpha.renderer().picture(), micromaps.renderer().picture());
            const double candidates[] = {alpha.renderer().count().perRay(), micromaps.renderer().count().perRay()};
            PairedTiming times([&] { return alpha(); }, [&] { return micromaps(); });
            const double end = clock.seconds() + (part.seconds - clock.seconds()) / static_cast<double>(left--);
            do {
                times.measure();
            } while (times.pairs() < 101 && (times.pairs() < 3 || clock.seconds() < end));
            printRow("frame", [&](JsonWriter &json) {
                json.member("level", level).member("heavy", heavy);
                json.member("width", settings.width).member("height", settings.height);
                json.member("alpha", times.a()).member("micromaps", times.b());
                json.member("alphaWall", alpha.wall()).member("micromapsWall", micromaps.wall());
                writeQuartiles(json, "ratio", times.ratio());
                json.member("pairs", times.pairs()).member("timestamps", devices.enabled->hasTimestamps());
                json.member("differingPixels", difference.pixels).values("candidatesPerRay", candidates);
                json.member("bytes", micromaps.renderer().micromapBytes());
            });
        }
    }
}

// --- builds ---

void measureMicromaps(Device &device, const BakedScene &baked, uint32_t level, double seconds)
{
    const std::vector<const Micromap *> all = baked.micromaps();
    // The largest.
    const auto one = std::ranges::max_element(
        all, {}, [](const Micromap *micromap) { return micromap ? micromap->triangles.size() : 0; });
    if (one == all.end() || !*one)
        return;
    std::vector<double> times;
    const Clock clock;
    do {
        const Clock build;
        makeMicromap(device, **one);
        times.push_back(1e3 * build.seconds());
    } while (times.size() < 3 || clock.seconds() < seconds);
    printRow("micromap", [&](JsonWriter &json) {
        json.member("level", level).member("triangles", (*one)->triangles.size());
        writeQuartiles(json, "milliseconds", quartiles(times));
    });
}

void measureBuilds(const Part &part, const BenchDevice &wanted)
{
    Devices devices(part, wanted);
    const double share = part.seconds / 8;
    TimedWorld bare(devices.classicInfo, std::nullopt), layered(devices.info, part.api);
    const auto compareBuilds = [&](const std::string &what, uint32_t count, std::unique_ptr<TimedBuilds> classic,
                                   std::unique_ptr<TimedBuilds> own) {
        PairedTiming times([&] { return classic->milliseconds(); }, [&] { return own->milliseconds(); });
        const Clock clock;
        do {
            times.measure();
        } while (times.pairs() < 3 || (clock.seconds() < share && times.pairs() < 501));
        printRow("build", [&](JsonWriter &json) {
            json.member("what", what).member("structures", count);
            json.member("classic", times.a()).member("enabled", times.b());
            writeQuartiles(json, "ratio", times.ratio());
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
        measureMicromaps(*devices.enabled, bakeScene(scene.scene, options), level, share);
    }
}

// --- pipelines ---

void measurePipelineCreation(const Part &part, const BenchDevice &wanted)
{
    Devices devices(part, wanted);
    devices.create(part.api);
    std::vector<Trace> traces = {Trace::Query};
    if (devices.info.rayTracingPipelines)
        traces.push_back(Trace::Pipeline);
    const RenderScene scene = prepareScene(makeGrove(), 1);
    for (const PipelineTiming &timing :
         measurePipelines({*devices.classic, *devices.enabled}, scene, traces, kLevels[0], 5)) {
        printRow("pipeline", [&](JsonWriter &json) {
            json.member("trace", timing.trace == Trace::Query ? "query" : "pipeline");
            json.member("withMicromaps", timing.micromaps);
            json.member("classic", timing.classic).member("enabled", timing.enabled).member("ratio", timing.ratio);
        });
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
