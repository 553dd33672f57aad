// What the layer makes of shaders, as compilers for GPUs see it: Mesa's RADV compiles for GPUs that are not there
// (tests/layer/layers/null_layer.cpp). Numbers of VK_KHR_pipeline_executable_properties, without the layer and with it.
#include <cstdio>
#include <exception>
#include <iterator>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "drivers/compiled.h"
#include "shaders/compiler_bench_any_hit.h"
#include "shaders/compiler_bench_any_hit_heavy.h"
#include "shaders/compiler_bench_closest_hit.h"
#include "shaders/compiler_bench_closest_hit_heavy.h"
#include "shaders/compiler_bench_miss.h"
#include "shaders/compiler_bench_query.h"
#include "shaders/compiler_bench_query_heavy.h"
#include "shaders/compiler_bench_raygen.h"

namespace
{

using vellum::test::Compiled;
using vellum::test::Executable;

struct Numbers {
    std::uint64_t instructions = 0, vectors = 0, scalars = 0, spills = 0, loads = 0, latency = 0;
};

std::uint64_t get(const Executable &executable, const char *name)
{
    const auto found = executable.statistics.find(name);
    return found == executable.statistics.end() ? 0 : found->second;
}

// Of all shaders of a pipeline. Where the compiler puts all into the ray generation shader, that is all there is.
Numbers numbersOf(const Compiled &pipeline, bool all)
{
    Numbers sum;
    for (const Executable &e : pipeline.executables()) {
        if (all) {
            fmt::print("    {} (stages {:#x}):", e.name, e.stages);
            for (const auto &[name, value] : e.statistics)
                fmt::print(" {} {};", name, value);
            fmt::print("\n");
        }
        sum.instructions += get(e, "Instructions");
        sum.vectors = std::max(sum.vectors, get(e, "VGPRs"));
        sum.scalars = std::max(sum.scalars, get(e, "SGPRs"));
        sum.spills += get(e, "Spilled VGPRs") + get(e, "Spilled SGPRs");
        sum.loads += get(e, "VMEM Clause") + get(e, "SMEM Clause");
        sum.latency += get(e, "Latency");
    }
    return sum;
}

enum class Kind { Query, Pipeline, PipelineWithoutAnyHit };

Compiled compile(vt::Gpu &gpu, Kind kind, bool heavy)
{
    if (kind == Kind::Query)
        return heavy ? Compiled::compute(gpu, compiler_bench_query_heavy)
                     : Compiled::compute(gpu, compiler_bench_query);
    vt::PipelineSetup setup;
    setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, compiler_bench_raygen},
                    {VK_SHADER_STAGE_MISS_BIT_KHR, compiler_bench_miss},
                    {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, compiler_bench_closest_hit}};
    if (heavy)
        setup.stages[2].words = compiler_bench_closest_hit_heavy;
    setup.groups = {{.general = 0}, {.general = 1}, {.closestHit = 2}};
    if (kind == Kind::Pipeline) {
        setup.stages.push_back({VK_SHADER_STAGE_ANY_HIT_BIT_KHR, compiler_bench_any_hit});
        if (heavy)
            setup.stages[3].words = compiler_bench_any_hit_heavy;
        setup.groups[2].anyHit = 3;
    }
    if (gpu.options().micromaps)
        setup.flags = vt::kMicromapBit;
    return Compiled::rays(gpu, setup);
}

struct Case {
    const char *name;
    Kind kind;
    bool heavy;
};
constexpr Case kCases[] = {
    {"query, plain", Kind::Query, false},
    {"query, heavy", Kind::Query, true},
    {"pipeline, plain", Kind::Pipeline, false},
    {"pipeline, heavy", Kind::Pipeline, true},
    {"pipeline, plain, no any-hit", Kind::PipelineWithoutAnyHit, false},
    {"pipeline, heavy, no any-hit", Kind::PipelineWithoutAnyHit, true},
};

void measure(const std::string &name, bool all)
{
    vt::Options options{.vellum = false, .validation = false, .spy = false, .micromaps = false};
    if (!vellum::test::useGpu(name, options))
        throw std::runtime_error(fmt::format("{} is not installed (Debian: mesa-vulkan-drivers)",
                                             vellum::test::nameOf(vellum::test::driverOf(name))));
    std::vector<Numbers> without, with;
    for (const bool layer : {false, true}) {
        options.vellum = options.micromaps = layer;
        vt::Gpu gpu(options);
        for (const Case &c : kCases) {
            if (all)
                fmt::print("  {}, {}, {} the layer\n", name, c.name, layer ? "with" : "without");
            (layer ? with : without).push_back(numbersOf(compile(gpu, c.kind, c.heavy), all));
        }
    }
    for (std::size_t i = 0; i < std::size(kCases); ++i) {
        const Numbers &a = without[i], &b = with[i];
        const auto difference = [](std::uint64_t from, std::uint64_t to) {
            return static_cast<std::int64_t>(to) - static_cast<std::int64_t>(from);
        };
        fmt::print("| {} | {} | {} -> {} ({:+}) | {} -> {} ({:+}) | {} -> {} | {} -> {} | {} -> {} ({:+}) | {:.1f}k -> "
                   "{:.1f}k ({:+.0f} %) |\n",
                   name, kCases[i].name, a.instructions, b.instructions, difference(a.instructions, b.instructions),
                   a.vectors, b.vectors, difference(a.vectors, b.vectors), a.scalars, b.scalars, a.spills, b.spills,
                   a.loads, b.loads, difference(a.loads, b.loads), static_cast<double>(a.latency) / 1e3,
                   static_cast<double>(b.latency) / 1e3,
                   (static_cast<double>(b.latency) / static_cast<double>(a.latency) - 1) * 100);
    }
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app("What RADV's compiler makes of shaders, without the layer -> with it. No GPU is needed.");
    std::vector<std::string> gpus{"navi21", "navi31", "gfx1201"};
    bool all = false, emulate = false;
    app.add_option("gpu", gpus, "RADV's names of GPUs");
    app.add_flag("--all", all, "Print all numbers of each shader of each pipeline");
    app.add_flag("--emulate", emulate, "Emulate what the GPU lacks to trace rays");
    CLI11_PARSE(app, argc, argv);
    if (emulate)
        setenv("RADV_PERFTEST", "emulate_rt", 1);
    fmt::print("| GPU | shader | instructions | VGPRs | SGPRs | spills | load groups | est. latency |\n"
               "|---|---|--:|--:|--:|--:|--:|--:|\n");
    try {
        for (const std::string &gpu : gpus)
            measure(gpu, all);
    } catch (const std::exception &e) {
        fmt::print(stderr, "vellum-compiler-bench: {}\n", e.what());
        return 1;
    }
    return 0;
}
