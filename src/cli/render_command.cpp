#include "cli/render_command.h"

#include <algorithm>
#include <cstdio>
#include <fmt/format.h>

#include "cli/base/progress.h"
#include "cli/scene/baked_scene.h"
#include "cli/scene/grove.h"
#include "cli/vulkan/layer_path.h"

namespace vellum::cli
{
namespace
{

// 1234567 -> 1,234,567
std::string grouped(std::uint64_t number)
{
    std::string text = std::to_string(number);
    for (std::size_t i = text.size(); i > 3;) {
        i -= 3;
        text.insert(i, 1, ',');
    }
    return text;
}

std::filesystem::path withSuffix(const std::filesystem::path &path, const char *suffix)
{
    std::filesystem::path result = path;
    return result.replace_filename(path.stem().string() + suffix + path.extension().string());
}

void printScene(const RenderOptions &options, const DeviceInfo &device, const RenderScene &scene)
{
    fmt::print("device      {}\n", device.name);
    fmt::print("rays        by {}\n",
               options.settings.trace == Trace::Query ? "ray queries" : "a ray tracing pipeline");
    fmt::print("micromaps   {}\n", options.mode == Mode::Alpha
                                       ? "not used"
                                       : fmt::format("{}, {}", nameOf(options.api), device.implementation));
    fmt::print("scene       {}: {} masked and {} solid triangles{}\n",
               options.input ? options.input->filename().string() : "the built-in grove",
               grouped(scene.maskedTriangles()), grouped(scene.solidTriangles()),
               options.instances > 1 ? fmt::format(", {} copies", options.instances) : "");
    std::fflush(stdout);
}

void printBake(const RenderOptions &options, const BakedScene &baked)
{
    const auto shares = baked.stateShares();
    fmt::print("baked       level {}, {} distinct triangles: {:.1f} % transparent, {:.1f} % opaque, {:.1f} % unknown\n",
               options.bake.level ? std::to_string(*options.bake.level) : "by density", baked.distinctTriangles(),
               100 * shares[0], 100 * shares[1], 100 * (shares[2] + shares[3]));
    std::fflush(stdout);
}

BakedScene bakeWithProgress(const RenderOptions &options, const Scene &scene)
{
    Progress progress("baking");
    BakeOptions bake = options.bake;
    bake.progress = [&](std::size_t done, std::size_t total) { progress.update(done, total); };
    return bakeScene(scene, bake);
}

void writePicture(const std::filesystem::path &path, const Picture &picture)
{
    writePng(path, picture);
    fmt::print("wrote       {}\n", path.string());
}

DeviceNeeds needsOf(const RenderOptions &options, bool micromaps)
{
    return {micromaps ? std::optional(options.api) : std::nullopt, options.settings.trace == Trace::Pipeline};
}

struct Timing {
    double milliseconds = 0;
    CandidateCount count;
};

int renderOne(const RenderOptions &options, Device &device, const RenderScene &scene,
              const std::vector<const Micromap *> &micromaps)
{
    std::unique_ptr<Renderer> renderer;
    std::vector<double> times;
    {
        Progress progress("rendering");
        renderer = std::make_unique<Renderer>(device, scene, micromaps, options.settings);
        for (std::uint32_t i = 0; i < options.frames; ++i) {
            times.push_back(renderer->frame());
            progress.update(i + 1, options.frames);
        }
    }
    fmt::print("frame       {:.2f} ms, the median of {}\n", median(times), options.frames);
    const CandidateCount count = renderer->count();
    fmt::print("candidates  {:.3f} per ray handed to the shader\n", count.perRay());
    if (!micromaps.empty())
        fmt::print("memory      {} bytes of micromaps\n", grouped(renderer->micromapBytes()));
    writePicture(options.output, renderer->picture());
    return 0;
}

void printComparison(const RenderOptions &options, const Timing &alpha, const Timing &omm, VkDeviceSize bytes,
                     const Difference &difference)
{
    const auto ratio = [](double a, double b) { return a > 0 ? fmt::format("{:.3f}", b / a) : std::string("-"); };
    const double pixels = static_cast<double>(options.settings.width) * options.settings.height;
    const std::string share = fmt::format("{:.4f} %", 100.0 * static_cast<double>(difference.pixels) / pixels);
    fmt::print("\n|                                |        alpha |          omm | omm/alpha |\n"
               "|--------------------------------|-------------:|-------------:|----------:|\n");
    fmt::print("| frame, ms (median of {:>4})     | {:>12.2f} | {:>12.2f} | {:>9} |\n", options.frames,
               alpha.milliseconds, omm.milliseconds, ratio(alpha.milliseconds, omm.milliseconds));
    fmt::print("| candidates to the shader / ray | {:>12.3f} | {:>12.3f} | {:>9} |\n", alpha.count.perRay(),
               omm.count.perRay(), ratio(alpha.count.perRay(), omm.count.perRay()));
    fmt::print("| micromap bytes                 | {:>12} | {:>12} | {:>9} |\n", 0, grouped(bytes), "");
    fmt::print("| differing pixels               | {:>12} | {:>12} | {:>9} |\n\n", "", grouped(difference.pixels),
               share);
}

int renderBoth(const RenderOptions &options, const DeviceInfo &info, const RenderScene &scene, const BakedScene &baked)
{
    // Two devices: the classic one enables no extension for micromaps and pays nothing for it.
    Device plain(info, needsOf(options, false));
    Device enabled(info, needsOf(options, true));
    Timing alpha;
    Timing omm;
    std::unique_ptr<Renderer> a;
    std::unique_ptr<Renderer> b;
    {
        Progress progress("rendering");
        a = std::make_unique<Renderer>(plain, scene, std::span<const Micromap *const>(), options.settings);
        b = std::make_unique<Renderer>(enabled, scene, baked.micromaps(), options.settings);
        // The first frame of each warms up.
        a->frame();
        b->frame();
        std::vector<double> times[2];
        for (std::uint32_t i = 0; i < options.frames; ++i) {
            times[0].push_back(a->frame());
            times[1].push_back(b->frame());
            progress.update(i + 1, options.frames);
        }
        alpha = {median(times[0]), a->count()};
        omm = {median(times[1]), b->count()};
    }
    const Picture pictures[2] = {a->picture(), b->picture()};
    const Difference difference = compare(pictures[0], pictures[1]);
    printComparison(options, alpha, omm, b->micromapBytes(), difference);
    writePicture(options.output, pictures[1]);
    writePicture(withSuffix(options.output, "-alpha"), pictures[0]);
    if (difference.pixels != 0)
        writePicture(withSuffix(options.output, "-difference"), difference.amplified);
    return 0;
}

} // namespace

double median(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    const std::size_t middle = values.size() / 2;
    return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

Scene loadScene(const std::optional<std::filesystem::path> &file)
{
    return file ? readGltf(*file) : makeGrove();
}

void offerLayer(const std::optional<std::filesystem::path> &folder)
{
    if (const auto found = folder ? folder : findLayerFolder())
        addLayerFolder(*found);
}

int renderCommand(const RenderOptions &options)
{
    checkWritable(options.output);
    RenderScene scene;
    {
        const Progress progress("reading");
        scene = prepareScene(loadScene(options.input), options.instances);
    }
    if (options.layer)
        offerLayer(options.layerFolder);
    const Instance instance(options.layer);
    const DeviceInfo info = chooseDevice(instance, options.device);
    if (options.mode != Mode::Alpha)
        requireMicromaps(info, options.api, instance.layerEnabled());
    if (options.settings.trace == Trace::Pipeline && !info.rayTracingPipelines)
        throw Error(info.name +
                    " has no ray tracing pipelines (VK_KHR_ray_tracing_pipeline); --trace query does without");
    printScene(options, info, scene);
    if (options.mode == Mode::Alpha) {
        Device device(info, needsOf(options, false));
        return renderOne(options, device, scene, {});
    }
    const BakedScene baked = bakeWithProgress(options, scene.scene);
    printBake(options, baked);
    if (options.mode == Mode::Compare)
        return renderBoth(options, info, scene, baked);
    Device device(info, needsOf(options, true));
    return renderOne(options, device, scene, baked.micromaps());
}

} // namespace vellum::cli
