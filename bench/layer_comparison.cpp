// SPDX-License-Identifier: Apache-2.0
#include "layer_comparison.h"

#include <cstdio>

#include <CLI/CLI.hpp>

#include "cli/bench/timing.h"
#include "gpu/instance.h"

namespace vellum::bench
{

int compareDevices(int argc, char **argv, const char *program, const char *description, const char *repeated,
                   Comparison comparison)
{
    CLI::App app(description, program);
    std::optional<std::filesystem::path> layerFolder;
    std::optional<std::string> device;
    unsigned repetitions = 21;
    app.add_option("-r,--repetitions", repetitions, repeated)->capture_default_str()->check(CLI::Range(1, 1000));
    app.add_option("-d,--device", device, "The Vulkan device: a number or a part of its name");
    app.add_option("--layer-path", layerFolder, "Folder of the layer's manifest");
    CLI11_PARSE(app, argc, argv);
    try {
        cli::disableShaderCaches();
        gpu::offerLayer(layerFolder);
        const gpu::Instance without(false);
        const gpu::Instance with(true);
        comparison(gpu::DeviceSelection(device).from(without), gpu::DeviceSelection(device).from(with), repetitions);
        return 0;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s: %s\n", program, error.what());
        return 1;
    }
}

} // namespace vellum::bench
