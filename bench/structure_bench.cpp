// SPDX-License-Identifier: Apache-2.0
// vellum-structure-bench: builds of acceleration structures without micromaps, with the layer and without, in turns:
// what the layer adds to rebuilding a TLAS and to building many small BLASes. Times of single submissions: from
// submission to the end of the wait, and of the processor, which is what counts where the driver is the processor.
// Memory: of the structures, and the scratch memory of their builds.
#include <cstdio>

#include <fmt/format.h>

#include "base/statistics.h"
#include "cli/bench/timing.h"
#include "layer_comparison.h"
#include "process_times.h"

namespace
{

using namespace vellum;

void run(const gpu::DeviceInfo &off, const gpu::DeviceInfo &on, unsigned repetitions)
{
    cli::TimedWorld bare(off, std::nullopt), layered(on, gpu::Api::Khr);
    fmt::print("{}, {}, medians of {}, milliseconds and KB\n\n"
               "| what is built | what is measured | layer off | layer on | on - off | on/off | quartiles |\n"
               "|---|---|--:|--:|--:|--:|--:|\n",
               on.name, on.implementation, repetitions);
    const auto measure = [&](const std::string &name, const char *kind, cli::TimedBuilds &bareBuilds,
                             cli::TimedBuilds &layeredBuilds, double (*time)(cli::TimedBuilds &)) {
        PairedTiming times([&] { return time(bareBuilds); }, [&] { return time(layeredBuilds); });
        for (unsigned r = 0; r < repetitions; ++r)
            times.measure();
        const Quartiles ratio = times.ratio();
        fmt::print("| {} | {} | {:.3f} | {:.3f} | {:.3f} | {:.2f} | {:.2f}, {:.2f} |\n", name, kind, times.a(),
                   times.b(), times.b() - times.a(), ratio.middle, ratio.low, ratio.high);
        std::fflush(stdout);
    };
    const auto memory = [](const std::string &name, const char *kind, VkDeviceSize bareBytes,
                           VkDeviceSize layeredBytes) {
        const double without = static_cast<double>(bareBytes) / 1024;
        const double with = static_cast<double>(layeredBytes) / 1024;
        fmt::print("| {} | {} | {:.1f} | {:.1f} | {:.1f} | {:.2f} | |\n", name, kind, without, with, with - without,
                   with / without);
    };
    const auto row = [&](const std::string &name, cli::TimedBuilds &bareBuilds, cli::TimedBuilds &layeredBuilds) {
        measure(name, "wait", bareBuilds, layeredBuilds, [](cli::TimedBuilds &builds) { return builds.run().wall; });
        measure(name, "processor", bareBuilds, layeredBuilds, [](cli::TimedBuilds &builds) {
            const double begin = bench::processorSeconds();
            builds.run();
            return 1e3 * (bench::processorSeconds() - begin);
        });
        const auto bytes = bareBuilds.bytes(), layeredBytes = layeredBuilds.bytes();
        memory(name, "structures", bytes.structures, layeredBytes.structures);
        memory(name, "scratch memory", bytes.scratch, layeredBytes.scratch);
    };
    for (const uint32_t count : {1u, 1000u, 100000u})
        row(fmt::format("TLAS of {} instances", count), *bare.top(count), *layered.top(count));
    row("1,000 BLASes of one triangle", *bare.bottoms(1000), *layered.bottoms(1000));
}

} // namespace

int main(int argc, char **argv)
{
    return bench::compareDevices(argc, argv, "vellum-structure-bench",
                                 "Builds of acceleration structures with the layer and without; prints Markdown.",
                                 "Builds of each kind", run);
}
