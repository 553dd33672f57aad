// SPDX-License-Identifier: Apache-2.0
// vellum-command-bench: what a command costs the processor with the layer, against the same command without it.
//
// Of each command so many calls in a row are timed on each device in turns. The time is that of the calling thread's
// processor: what else the machine does is not in it, and neither are the driver's own threads.
#include <algorithm>
#include <barrier>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "base/statistics.h"
#include "cli/bench/timing.h"
#include "cli/render_command.h"
#include "command_cases.h"
#include "gpu/instance.h"

namespace
{

using namespace vellum;
using bench::CommandCase;
using bench::CommandSide;

struct BenchOptions {
    std::optional<std::filesystem::path> layerFolder;
    std::optional<std::string> device;
    std::string filter;
    std::string validate; // the setting, of one more side; empty: none
    unsigned repetitions = 101;
    unsigned calls = 256;
    unsigned objects = 4096;
    unsigned threads = 1;
};

double threadNanoseconds()
{
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return 1e9 * static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec);
}

// The objects that one thread records into on a side.
struct Recorder {
    explicit Recorder(const CommandSide &s)
        : side(s), pool(s.makePool()), commands(s.allocate(pool, VK_COMMAND_BUFFER_LEVEL_PRIMARY))
    {
    }
    ~Recorder() { side.vk.DestroyCommandPool(side.device, pool, nullptr); }
    Recorder(const Recorder &) = delete;
    Recorder &operator=(const Recorder &) = delete;

    // Nanoseconds of a call.
    double measure(const CommandCase &command, uint32_t calls)
    {
        side.begin(commands);
        side.vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, side.compute);
        side.vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, side.rayTracing);
        const double begin = threadNanoseconds();
        command.run(side, commands, calls);
        const double end = threadNanoseconds();
        side.vk.EndCommandBuffer(commands);
        return (end - begin) / calls;
    }

    const CommandSide &side;
    VkCommandPool pool;
    VkCommandBuffer commands;
};

struct Times {
    double median = 0, worst = 0;
};

// By side. For the first, its own times; for the others, the additional time over the first right before them.
std::vector<Times> measure(const CommandCase &command, const std::vector<std::unique_ptr<CommandSide>> &sides,
                           const BenchOptions &options)
{
    const uint32_t calls = command.creation ? 4 : options.calls;
    const unsigned repetitions = command.creation ? std::max(options.repetitions / 4, 3u) : options.repetitions;
    std::vector<std::vector<double>> all(sides.size());
    std::mutex mutex;
    std::exception_ptr failure;
    std::barrier together(static_cast<ptrdiff_t>(options.threads));
    const auto work = [&] {
        std::vector<std::vector<double>> own(sides.size());
        {
            std::vector<std::unique_ptr<Recorder>> recorders;
            for (const auto &side : sides)
                recorders.push_back(std::make_unique<Recorder>(*side));
            for (unsigned r = 0; r < repetitions + 2; ++r) {
                double first = 0;
                for (size_t i = 0; i < sides.size(); ++i) {
                    together.arrive_and_wait();
                    const double time = command.available(*sides[i]) ? recorders[i]->measure(command, calls) : 0;
                    if (i == 0)
                        first = time;
                    if (r >= 2) // the first rounds fill caches
                        own[i].push_back(i == 0 ? time : time - first);
                }
            }
        }
        std::lock_guard lock(mutex);
        for (size_t i = 0; i < sides.size(); ++i)
            all[i].insert(all[i].end(), own[i].begin(), own[i].end());
    };
    const auto guarded = [&] {
        try {
            work();
        } catch (...) {
            std::lock_guard lock(mutex);
            failure = std::current_exception();
            together.arrive_and_drop();
        }
    };
    std::vector<std::thread> threads;
    for (unsigned t = 1; t < options.threads; ++t)
        threads.emplace_back(guarded);
    guarded();
    for (std::thread &thread : threads)
        thread.join();
    if (failure)
        std::rethrow_exception(failure);
    std::vector<Times> result;
    for (const auto &times : all)
        result.push_back({median(times), *std::max_element(times.begin(), times.end())});
    return result;
}

void run(const BenchOptions &options)
{
    cli::disableShaderCaches();
    gpu::offerLayer(options.layerFolder);
    const gpu::Instance without(false);
    const gpu::Instance with(true);
    const gpu::DeviceInfo off = gpu::DeviceSelection(options.device).from(without);
    const gpu::DeviceInfo on = gpu::DeviceSelection(options.device).from(with);
    std::unique_ptr<gpu::Instance> validating; // the setting is read when the instance is made
    std::vector<std::unique_ptr<CommandSide>> sides;
    const auto add = [&](const char *name, const gpu::DeviceInfo &info, std::optional<gpu::Api> api) {
        sides.push_back(std::make_unique<CommandSide>(name, info, api, options.objects));
    };
    add("no layer", off, std::nullopt);
    add("no layer again", off, std::nullopt);
    add("layer, no extension", on, std::nullopt);
    if (on.has(gpu::Api::Ext))
        add("layer, ext", on, gpu::Api::Ext);
    if (on.has(gpu::Api::Khr))
        add("layer, khr", on, gpu::Api::Khr);
    if (!options.validate.empty()) {
        setenv("VELLUM_VALIDATE", options.validate.c_str(), 1);
        validating = std::make_unique<gpu::Instance>(true);
        add("layer, khr, validate", gpu::DeviceSelection(options.device).from(*validating), gpu::Api::Khr);
    }
    fmt::print("{}, {}\n{} repetitions of {} calls, {} thread(s), {} command buffers, buffers and structures besides. "
               "Nanoseconds "
               "of CPU for a call: of the driver, and what the others take more: median (worst repetition)\n\n",
               on.name, on.implementation, options.repetitions, options.calls, options.threads, options.objects);
    fmt::print("| command |");
    for (const auto &side : sides)
        fmt::print(" {} |", side->name);
    fmt::print("\n|---|");
    for (size_t i = 0; i < sides.size(); ++i)
        fmt::print("--:|");
    fmt::print("\n");
    for (const CommandCase &command : bench::commandCases()) {
        if (command.name.find(options.filter) == std::string::npos)
            continue;
        fmt::print("| {} |", command.name);
        for (const Times &times : measure(command, sides, options))
            fmt::print(" {:.0f} ({:.0f}) |", times.median, times.worst);
        fmt::print("\n");
        std::fflush(stdout);
    }
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app("What a command costs the processor with the layer and without; prints Markdown.",
                 "vellum-command-bench");
    BenchOptions options;
    app.add_option("-r,--repetitions", options.repetitions, "Repetitions on each device")
        ->capture_default_str()
        ->check(CLI::Range(3, 100000));
    app.add_option("-n,--calls", options.calls, "Calls in a repetition")
        ->capture_default_str()
        ->check(CLI::Range(1, 100000));
    app.add_option("-o,--objects", options.objects,
                   "Command buffers, buffers and acceleration structures that are there besides")
        ->capture_default_str()
        ->check(CLI::Range(0, 12000));
    app.add_option("-t,--threads", options.threads, "Threads that call the same at the same time")
        ->capture_default_str()
        ->check(CLI::Range(1, 64));
    app.add_option("-f,--filter", options.filter, "Only commands with this in their name");
    app.add_option("--validate", options.validate, "Also with this value of the layer's setting validate");
    app.add_option("-d,--device", options.device, "The Vulkan device: a number or a part of its name");
    app.add_option("--layer-path", options.layerFolder, "Folder of the layer's manifest");
    CLI11_PARSE(app, argc, argv);
    try {
        run(options);
        return 0;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum-command-bench: %s\n", error.what());
        return 1;
    }
}
