// SPDX-License-Identifier: Apache-2.0
// Compares the layer's shaders in compilers for GPUs: Mesa's RADV and ANV compile for GPUs that are not there
// (tests/drivers/kernel). Numbers of VK_KHR_pipeline_executable_properties, without the layer and with it.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <iterator>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "drivers/compiled.h"
#include "shaders/compiler_bench_any_hit.h"
#include "shaders/compiler_bench_closest_hit.h"
#include "shaders/compiler_bench_heavy_any_hit.h"
#include "shaders/compiler_bench_heavy_closest_hit.h"
#include "shaders/compiler_bench_heavy_query.h"
#include "shaders/compiler_bench_miss.h"
#include "shaders/compiler_bench_query.h"
#include "shaders/compiler_bench_raygen.h"

namespace
{

using vellum::test::Compiled;
using vellum::test::Driver;
using vellum::test::Executable;

// A column of the table: a number that the driver reports, by its names there.
enum class Over { Sum, Most, Least }; // of all shaders of a pipeline
enum class Shown { Plain, Difference, Thousands };
struct Column {
    const char *title;
    Over over;
    Shown shown;
    std::vector<const char *> names; // added up
};

const std::vector<Column> &columnsOf(Driver driver)
{
    // RADV puts a pipeline's shaders into the one for ray generation, where it can.
    static const std::vector<Column> radv{
        {"instructions", Over::Sum, Shown::Difference, {"Instructions"}},
        {"VGPRs", Over::Most, Shown::Difference, {"VGPRs"}},
        {"SGPRs", Over::Most, Shown::Plain, {"SGPRs"}},
        {"spills", Over::Sum, Shown::Plain, {"Spilled VGPRs", "Spilled SGPRs"}},
        {"load groups", Over::Sum, Shown::Difference, {"VMEM Clause", "SMEM Clause"}},
        {"est. latency", Over::Sum, Shown::Thousands, {"Latency"}},
    };
    // The names in Mesa 25 and in Mesa 26.
    static const std::vector<Column> anv{
        {"instructions", Over::Sum, Shown::Difference, {"Instruction Count", "Instructions"}},
        {"live registers", Over::Most, Shown::Difference, {"Max live registers"}},
        {"SIMD width", Over::Least, Shown::Plain, {"Max dispatch width"}},
        {"spills", Over::Sum, Shown::Plain, {"Spill Count", "Fill Count", "Spills", "Fills"}},
        {"messages", Over::Sum, Shown::Difference, {"SEND Count", "SENDs"}},
        {"est. cycles", Over::Sum, Shown::Thousands, {"Cycle Count", "Cycles"}},
    };
    return driver == Driver::Anv ? anv : radv;
}

uint64_t get(const Executable &executable, const char *name)
{
    const auto found = executable.statistics.find(name);
    return found == executable.statistics.end() ? 0 : found->second;
}

using Numbers = std::vector<uint64_t>; // one for each column

Numbers numbersOf(const Compiled &pipeline, const std::vector<Column> &columns, bool all)
{
    const std::vector<Executable> executables = pipeline.executables();
    for (const Executable &e : executables) {
        if (!all)
            break;
        fmt::print("    {} (stages {:#x}):", e.name, e.stages);
        for (const auto &[name, value] : e.statistics)
            fmt::print(" {} {};", name, value);
        fmt::print("\n");
    }
    Numbers numbers;
    for (const Column &column : columns) {
        uint64_t number = column.over == Over::Least ? UINT64_MAX : 0;
        for (const Executable &e : executables) {
            uint64_t one = 0;
            for (const char *name : column.names)
                one += get(e, name);
            number = column.over == Over::Sum    ? number + one
                     : column.over == Over::Most ? std::max(number, one)
                                                 : std::min(number, one);
        }
        numbers.push_back(number);
    }
    return numbers;
}

std::string cell(Shown shown, uint64_t from, uint64_t to)
{
    const auto a = static_cast<double>(from), b = static_cast<double>(to);
    switch (shown) {
    case Shown::Plain: return fmt::format("{} -> {}", from, to);
    case Shown::Difference:
        return fmt::format("{} -> {} ({:+})", from, to, static_cast<int64_t>(to) - static_cast<int64_t>(from));
    case Shown::Thousands: return fmt::format("{:.1f}k -> {:.1f}k ({:+.0f} %)", a / 1e3, b / 1e3, (b / a - 1) * 100);
    }
    return {};
}

enum class Kind { Query, Pipeline, PipelineWithoutAnyHit };

Compiled compile(vt::Gpu &gpu, Kind kind, bool heavy)
{
    if (kind == Kind::Query)
        return heavy ? Compiled::compute(gpu, compiler_bench_heavy_query)
                     : Compiled::compute(gpu, compiler_bench_query);
    vt::PipelineSetup setup;
    setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, compiler_bench_raygen},
                    {VK_SHADER_STAGE_MISS_BIT_KHR, compiler_bench_miss},
                    {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, compiler_bench_closest_hit}};
    if (heavy)
        setup.stages[2].words = compiler_bench_heavy_closest_hit;
    setup.groups = {{.general = 0}, {.general = 1}, {.closestHit = 2}};
    if (kind == Kind::Pipeline) {
        setup.stages.push_back({VK_SHADER_STAGE_ANY_HIT_BIT_KHR, compiler_bench_any_hit});
        if (heavy)
            setup.stages[3].words = compiler_bench_heavy_any_hit;
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
    if (const std::string whyNot = vellum::test::useGpu(name, options); !whyNot.empty())
        throw std::runtime_error(whyNot);
    const std::vector<Column> &columns = columnsOf(vellum::test::driverOf(name));
    std::vector<Numbers> without, with;
    for (const bool layer : {false, true}) {
        options.vellum = options.micromaps = layer;
        vt::Gpu gpu(options);
        for (const Case &c : kCases) {
            if (all)
                fmt::print("  {}, {}, {} the layer\n", name, c.name, layer ? "with" : "without");
            (layer ? with : without).push_back(numbersOf(compile(gpu, c.kind, c.heavy), columns, all));
        }
    }
    for (size_t i = 0; i < std::size(kCases); ++i) {
        fmt::print("| {} | {} |", name, kCases[i].name);
        for (size_t c = 0; c < columns.size(); ++c)
            fmt::print(" {} |", cell(columns[c].shown, without[i][c], with[i][c]));
        fmt::print("\n");
    }
}

void printHeader(Driver driver)
{
    std::string titles = "| GPU | shader |", rule = "|---|---|";
    for (const Column &column : columnsOf(driver)) {
        titles += fmt::format(" {} |", column.title);
        rule += "--:|";
    }
    fmt::print("{}\n{}\n", titles, rule);
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app("What the compilers of RADV and ANV make of shaders, without the layer -> with it. No GPU is needed.");
    std::vector<std::string> gpus{"navi21", "navi31", "gfx1201", "dg2", "bmg"};
    bool all = false, emulate = false;
    app.add_option("gpu", gpus, "RADV's names of AMD's GPUs; of Intel's dg2, mtl, lnl, bmg");
    app.add_flag("--all", all, "Print all numbers of each shader of each pipeline");
    app.add_flag("--emulate", emulate, "Emulate what AMD's GPU lacks to trace rays");
    CLI11_PARSE(app, argc, argv);
    if (emulate)
        setenv("RADV_PERFTEST", "emulate_rt", 1);
    // Each driver has a table of its own.
    std::ranges::stable_sort(gpus, {}, vellum::test::driverOf);
    try {
        for (size_t i = 0; i < gpus.size(); ++i) {
            const Driver driver = vellum::test::driverOf(gpus[i]);
            if (i == 0 || driver != vellum::test::driverOf(gpus[i - 1]))
                printHeader(driver);
            measure(gpus[i], all);
        }
    } catch (const std::exception &e) {
        fmt::print(stderr, "vellum-compiler-bench: {}\n", e.what());
        return 1;
    }
    return 0;
}
