// vellum-bench: what micromaps cost and save on this machine, as Markdown.
#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "cli/options.h"
#include "cli/progress.h"
#include "cli/render_command.h"
#include "scene_bench.h"

namespace
{

using namespace vellum;

struct Options {
    std::vector<std::filesystem::path> files;
    std::string size = "640x360";
    unsigned repetitions = 5;
    std::vector<std::uint32_t> levels = {3, 5, 7};
    std::vector<std::uint32_t> instances = {1, 9};
    std::optional<std::string> device;
    std::optional<std::filesystem::path> layerFolder;
};

struct Row {
    std::string name;
    std::uint32_t instances;
    bench::SceneResult result;
};

void printLevels(const std::vector<Row> &rows)
{
    fmt::print("| scene | copies | level | micromap bytes | unknown | candidates/ray alpha | candidates/ray omm | "
               "time omm/alpha | heavy omm/alpha |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|\n");
    for (const Row &row : rows)
        for (const bench::LevelResult &l : row.result.levels)
            fmt::print("| {} | {} | {} | {} | {:.1f} % | {:.3f} | {:.3f} | {:.3f} | {:.3f} |\n", row.name,
                       row.instances, l.level, l.bytes, 100 * l.unknown, row.result.candidatesPerRay,
                       l.candidatesPerRay, l.plainRatio, l.heavyRatio);
}

void printScenes(const std::vector<Row> &rows)
{
    fmt::print("\n| scene | copies | alpha, ms | heavy alpha, ms | without micromaps: extension enabled / layer off "
               "|\n|---|--:|--:|--:|--:|\n");
    for (const Row &row : rows)
        fmt::print("| {} | {} | {:.1f} | {:.1f} | {:.3f} |\n", row.name, row.instances, row.result.alphaMilliseconds,
                   row.result.heavyMilliseconds, row.result.withoutMicromaps);
}

std::vector<std::optional<std::filesystem::path>> scenesOf(const Options &options)
{
    std::vector<std::optional<std::filesystem::path>> scenes(options.files.begin(), options.files.end());
    if (!scenes.empty())
        return scenes;
    for (const char *name : {"ash_medium.glb", "aspen_medium.glb", "bush_1.glb"}) {
        const std::filesystem::path path = std::filesystem::path(VELLUM_ASSETS) / name;
        if (std::filesystem::exists(path))
            scenes.emplace_back(path);
    }
    if (scenes.empty())
        scenes.emplace_back(std::nullopt); // the grove
    return scenes;
}

void run(const Options &options)
{
    cli::RenderSettings settings;
    cli::parseSize(options.size, settings);
    cli::offerLayer(options.layerFolder);
    const cli::Instance without(false);
    const cli::Instance with(true);
    const cli::DeviceInfo info = cli::chooseDevice(with, options.device);
    cli::Device classic(cli::chooseDevice(without, options.device), {});
    cli::Device enabled(info, {true, false});
    fmt::print("{}, micromaps: {}. {} x {} pixels, median of {}.\n\n", info.name, info.implementation, settings.width,
               settings.height, options.repetitions);
    std::fflush(stdout);

    std::vector<Row> rows;
    for (const auto &file : scenesOf(options)) {
        const std::string name = file ? file->stem().string() : "grove";
        for (const std::uint32_t copies : options.instances) {
            cli::Progress progress(name + " x " + std::to_string(copies));
            const cli::RenderScene scene = cli::prepareScene(cli::loadScene(file), copies);
            rows.push_back(
                {name, copies,
                 bench::measureScene({classic, enabled}, scene, settings, options.levels, options.repetitions,
                                     [&](std::size_t done, std::size_t all) { progress.update(done, all); })});
        }
    }
    printLevels(rows);
    printScenes(rows);
}

} // namespace

int main(int argc, char **argv)
{
    try {
        Options options;
        CLI::App app("Compares frames with and without opacity micromaps; prints Markdown.", "vellum-bench");
        app.add_option("files", options.files, "GLB files; without: the shared trees, or the grove");
        app.add_option("-s,--size", options.size, "Width and height in pixels")->capture_default_str();
        app.add_option("-r,--repetitions", options.repetitions, "Frames of each variant")
            ->capture_default_str()
            ->check(CLI::Range(1, 1000));
        app.add_option("-l,--levels", options.levels, "Subdivision levels")
            ->capture_default_str()
            ->check(CLI::Range(0, 12));
        app.add_option("-n,--instances", options.instances, "Numbers of copies")
            ->capture_default_str()
            ->check(CLI::Range(1, 1000));
        app.add_option("-d,--device", options.device, "The Vulkan device: a number or a part of its name");
        app.add_option("--layer-path", options.layerFolder, "Folder of the layer's manifest");
        CLI11_PARSE(app, argc, argv);
        run(options);
        return 0;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum-bench: %s\n", error.what());
        return 1;
    }
}
