// SPDX-License-Identifier: Apache-2.0
// vellum-structure-bench: builds of acceleration structures without micromaps, with the layer and without, in turns:
// what the layer adds to rebuilding a TLAS and to building many small BLASes. Times of single submissions, from
// submission to the end of the wait.
#include <cstdio>

#include <fmt/format.h>

#include "base/statistics.h"
#include "cli/bench/timing.h"
#include "layer_comparison.h"

namespace
{

using namespace vellum;

void run(const gpu::DeviceInfo &off, const gpu::DeviceInfo &on, unsigned repetitions)
{
    cli::TimedWorld bare(off, std::nullopt), layered(on, gpu::Api::Khr);
    fmt::print("{}, {}, medians of {}, milliseconds\n\n"
               "| what is built | layer off | layer on | on - off | on/off |\n|---|--:|--:|--:|--:|\n",
               on.name, on.implementation, repetitions);
    const auto row = [&](const std::string &name, cli::TimedBuilds &bareBuilds, cli::TimedBuilds &layeredBuilds) {
        PairedTiming times([&] { return bareBuilds.run().wall; }, [&] { return layeredBuilds.run().wall; });
        for (unsigned r = 0; r < repetitions; ++r)
            times.measure();
        fmt::print("| {} | {:.3f} | {:.3f} | {:.3f} | {:.2f} |\n", name, times.a(), times.b(), times.b() - times.a(),
                   times.ratio().middle);
        std::fflush(stdout);
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
