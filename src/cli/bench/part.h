// SPDX-License-Identifier: Apache-2.0
// What `vellum bench` measures, in parts. Each part runs in a process of its own, since a driver may hang, crash or
// lose the device. Its results are rows: JSON objects, one a line on stdout, each whole before the next begins. Between
// them are lines that report progress.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "cli/renderer/trace_pipeline.h"
#include "cli/vulkan/context.h"

namespace vellum::cli
{

enum class PartKind {
    Device,    // what the device is, and who implements micromaps
    Check,     // random cases against the oracle of `vellum check`
    Frames,    // frames with micromaps beside frames with alpha tests
    Builds,    // micromaps and acceleration structures
    Pipelines, // making pipelines
};
inline constexpr const char *kPartNames[] = {"device", "check", "frames", "builds", "pipelines"};

struct Part {
    PartKind kind = PartKind::Device;
    std::string implementation = "auto"; // the layer's setting
    MicromapApi api = MicromapApi::Khr;
    Trace trace = Trace::Query; // of frames
    double seconds = 10;        // that it should take

    // "frames-query-emulated-khr"; "device-auto"
    [[nodiscard]] std::string name() const;
};

// Which device, and where the layer is.
struct BenchDevice {
    std::optional<std::string> device;
    std::optional<std::filesystem::path> layerFolder;
};

// The line of a part that has completed a frame, a build, a pipeline or a case since the last such line.
inline constexpr const char *kProgressLine = R"({"progress":true})";

// Measures in this process. Returns the exit code.
int runPart(const Part &part, const BenchDevice &device);

} // namespace vellum::cli
