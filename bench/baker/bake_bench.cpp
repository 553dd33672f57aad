// SPDX-License-Identifier: Apache-2.0
// vellum-bake-bench: the speed of the baker, the share of unknown states, and its memory, compared with other bakers if
// their shared libraries are given. Times include the preparation of the texture.
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <functional>

#include "bake/classify.h"
#include "bake_work.h"
#include "process_times.h"
#include "rivals.h"

// The measured code runs in here, so that a profiler can be restricted to it: valgrind --tool=callgrind
// --toggle-collect=vellum_bench_measured
extern "C" [[gnu::noinline]] void vellum_bench_measured(const std::function<void()> &function)
{
    function();
}

namespace
{

using namespace vellum;
using namespace vellum::bench;

struct Settings {
    std::vector<size_t> triangles = {10000};
    std::vector<uint32_t> textures = {1024};
    std::vector<std::string> scenes;
    std::vector<std::string> levels = {"3", "5", "auto", "7"};
    unsigned threads = 2;
    unsigned rounds = 3;
    std::string meshoptimizer;
    std::string ommSdk;
    std::string once;
    bool memory = false;
};

void measure(BestTimes &times, const std::function<void()> &function)
{
    times.measure([&] { vellum_bench_measured(function); });
}

BakeOptions optionsFor(const std::string &level, unsigned threads)
{
    BakeOptions options;
    options.threads = threads;
    if (level != "auto")
        options.level = static_cast<uint32_t>(std::stoul(level));
    return options;
}

std::vector<BakeResult> bakeAll(const BakeWork &work, BakeOptions options)
{
    std::vector<BakeResult> results;
    for (const BakeMesh &mesh : work.meshes) {
        options.cutoff = mesh.cutoff;
        results.push_back(bake(mesh.texture(), mesh.triangles, options));
    }
    return results;
}

// The levels that the baker chooses, for others to use.
std::vector<std::vector<uint8_t>> levelsOf(const BakeWork &work, const BakeOptions &options)
{
    std::vector<std::vector<uint8_t>> levels;
    for (const BakeMesh &mesh : work.meshes) {
        const AlphaTexture texture = mesh.texture();
        const Classifier classifier(texture, options);
        auto &of = levels.emplace_back();
        for (const TriangleUvs &uvs : mesh.triangles)
            of.push_back(static_cast<uint8_t>(classifier.levelFor(uvs)));
    }
    return levels;
}

struct Totals {
    double micro = 0;
    double unknown = 0;
    double bytes = 0; // of data, triangle records and indices
};

Totals totalsOf(const std::vector<BakeResult> &results)
{
    Totals totals;
    for (const BakeResult &result : results) {
        for (size_t s = 0; s < 4; ++s) {
            totals.micro += static_cast<double>(result.statistics.states[s]);
            totals.unknown += s >= 2 ? static_cast<double>(result.statistics.states[s]) : 0;
        }
        const Micromap &m = result.micromap;
        totals.bytes += static_cast<double>(m.data.size() + 8 * m.triangles.size() + 4 * m.indices.size());
    }
    return totals;
}

void printRow(const Settings &settings, const BakeWork &work, const std::string &level,
              const std::vector<std::unique_ptr<Rival>> &rivals)
{
    const BakeOptions tolerant = optionsFor(level, 1);
    BakeOptions exact = tolerant;
    exact.exactly();
    BakeOptions threaded = exact;
    threaded.threads = settings.threads;
    const auto levels = levelsOf(work, exact);

    BestTimes exactTimes;
    BestTimes threadedTimes;
    BestTimes tolerantTimes;
    std::vector<BestTimes> theirTimes(rivals.size());
    std::vector<RivalScore> scores(rivals.size());
    std::vector<BakeResult> exactResults;
    Totals tolerantTotals;
    for (unsigned round = 0; round < settings.rounds; ++round) {
        measure(exactTimes, [&] { exactResults = bakeAll(work, exact); });
        std::vector<BakeResult> results;
        measure(threadedTimes, [&] { results = bakeAll(work, threaded); });
        measure(tolerantTimes, [&] { results = bakeAll(work, tolerant); });
        tolerantTotals = totalsOf(results);
        results = {};
        for (size_t r = 0; r < rivals.size(); ++r) {
            std::vector<RivalResult> theirs(work.meshes.size());
            measure(theirTimes[r], [&] {
                for (size_t i = 0; i < theirs.size(); ++i)
                    theirs[i] = rivals[r]->bake(work.meshes[i], levels[i]);
            });
            if (round == 0)
                for (size_t i = 0; i < theirs.size(); ++i)
                    addScore(scores[r], theirs[i], exactResults[i].micromap, levels[i]);
        }
    }
    const Totals totals = totalsOf(exactResults);
    fmt::print("| {} | {} | {:.4f} | {:.4f} | {:.4f} | {:.2f} | {:.3f} % | {:.4f} | {:.3f} % |", work.name, level,
               exactTimes.cpu, exactTimes.wall, threadedTimes.wall, exactTimes.wall / threadedTimes.wall,
               100 * totals.unknown / totals.micro, tolerantTimes.cpu,
               100 * tolerantTotals.unknown / tolerantTotals.micro);
    for (size_t r = 0; r < rivals.size(); ++r)
        fmt::print(" {:.4f} | {:.2f} | {:.2f} | {:.3f} % | {:.1f} |", theirTimes[r].cpu,
                   theirTimes[r].cpu / exactTimes.cpu, theirTimes[r].cpu / tolerantTimes.cpu,
                   100 * (1 - scores[r].known / scores[r].micro), 1e6 * scores[r].wrong / scores[r].known);
    fmt::print("\n");
    std::fflush(stdout);
}

void printHeader(const Settings &settings, const std::vector<std::unique_ptr<Rival>> &rivals)
{
    std::string header = fmt::format("| input | level | exact, CPU s | wall s | wall s, {} threads | faster | unknown "
                                     "| tolerant, CPU s | unknown |",
                                     settings.threads);
    for (const auto &rival : rivals)
        header += fmt::format(" {}, CPU s | / exact | / tolerant | unknown | wrong per million |", rival->name);
    std::string line;
    for (size_t column = 0; column < static_cast<size_t>(std::count(header.begin(), header.end(), '|')) - 1; ++column)
        line += column < 2 ? "|---" : "|--:";
    fmt::print("{}\n{}|\n", header, line);
}

// One bake of one kind only, for profilers.
void runOnce(const std::string &which, const BakeWork &work, const std::string &level,
             const std::vector<std::unique_ptr<Rival>> &rivals)
{
    BakeOptions options = optionsFor(level, 1);
    const auto levels = levelsOf(work, options);
    double micro = 0;
    double texels = 0;
    for (size_t i = 0; i < work.meshes.size(); ++i) {
        texels += static_cast<double>(work.meshes[i].alpha.size());
        for (const uint8_t of : levels[i])
            micro += microTriangleCount(of);
    }
    if (which == "exact")
        options.exactly();
    BestTimes times;
    if (which == "exact" || which == "tolerant")
        measure(times, [&] { bakeAll(work, options); });
    else
        measure(times, [&] {
            for (size_t i = 0; i < work.meshes.size(); ++i)
                (void)rivals.front()->bake(work.meshes[i], levels[i]);
        });
    fmt::print("{}, level {}, {}: {:.0f} micro-triangles, {:.0f} texels\n", work.name, level, which, micro, texels);
}

// The most memory that this process has had since the last call, in bytes.
double peakSinceLast()
{
    double peak = 0;
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with("VmHWM:"))
            peak = std::stod(line.substr(6)) * 1024;
    std::ofstream("/proc/self/clear_refs") << "5"; // proc(5): resets the peak
    return peak;
}

// Measures in a new process, which has no memory of earlier bakes to reuse.
void printMemory(const BakeWork &work, const std::string &level, unsigned threads)
{
    std::fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
        peakSinceLast();
        const double before = peakSinceLast();
        const std::vector<BakeResult> results = bakeAll(work, optionsFor(level, threads));
        const double used = peakSinceLast() - before;
        const double bytes = totalsOf(results).bytes;
        fmt::print("| {} | {} | {} | {:.1f} | {:.1f} | {:.2f} |\n", work.name, level, threads, bytes * 0x1p-20,
                   used * 0x1p-20, used / bytes);
        std::fflush(stdout);
        _exit(0);
    }
    waitpid(child, nullptr, 0);
}

int run(const Settings &settings)
{
    std::vector<std::unique_ptr<Rival>> rivals;
    if (!settings.meshoptimizer.empty())
        rivals.push_back(loadMeshoptimizer(settings.meshoptimizer));
    if (!settings.ommSdk.empty())
        rivals.push_back(loadOmmSdk(settings.ommSdk));
    if (settings.once == "rival" && rivals.empty())
        throw std::runtime_error("--once rival needs one");
    std::vector<std::function<BakeWork()>> works;
    for (const std::string &scene : settings.scenes)
        works.emplace_back([&] { return leafCards(scene); });
    if (settings.scenes.empty())
        for (const uint32_t texture : settings.textures)
            for (const size_t triangles : settings.triangles)
                works.emplace_back([=] { return leaves(texture, triangles); });
    if (settings.memory)
        fmt::print("| input | level | threads | result, MiB | peak, MiB | ratio |\n|---|---|--:|--:|--:|--:|\n");
    else if (settings.once.empty())
        printHeader(settings, rivals);
    for (const auto &make : works) {
        const BakeWork work = make();
        for (const std::string &level : settings.levels) {
            if (!settings.once.empty())
                runOnce(settings.once, work, level, rivals);
            else if (!settings.memory)
                printRow(settings, work, level, rivals);
            else
                for (unsigned threads = 1; threads <= settings.threads; ++threads)
                    printMemory(work, level, threads);
        }
    }
    return 0;
}

} // namespace

int main(int argc, char **argv)
{
    Settings settings;
    CLI::App app("Measures the baker; prints a table in Markdown. Times are the best of some rounds.");
    app.add_option("--triangles", settings.triangles,
                   "Triangles with edges of 60 to 100 texels at random places of a\n"
                   "texture of toothed leaves that repeats [10000]")
        ->delimiter(',');
    app.add_option("--texture", settings.textures, "Texels along a side of that texture [1024]")->delimiter(',');
    app.add_option("--scene", settings.scenes, "glTF files, whose masked materials are baked instead")->delimiter(',');
    app.add_option("--levels", settings.levels, "Levels, 0 to 12 or auto [3,5,auto,7]")->delimiter(',');
    app.add_option("--threads", settings.threads, "Threads of the threaded bakes; all others have one [2]");
    app.add_option("--rounds", settings.rounds, "Runs of each, of which the best counts [3]");
    app.add_option("--meshoptimizer", settings.meshoptimizer,
                   "A shared library of meshoptimizer with its opacityMap functions, to run\n"
                   "on the same triangles, textures and levels in between");
    app.add_option("--omm-sdk", settings.ommSdk, "Likewise, of NVIDIA's Opacity Micromap SDK");
    app.add_flag("--memory", settings.memory, "Peak memory instead of times, for 1 to --threads threads");
    app.add_option("--once", settings.once, "One run of exact, tolerant, or rival and nothing more, for profilers")
        ->check(CLI::IsMember({"exact", "tolerant", "rival"}));
    CLI11_PARSE(app, argc, argv);
    try {
        return run(settings);
    } catch (const std::exception &error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
