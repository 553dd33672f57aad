// SPDX-License-Identifier: Apache-2.0
// The measurements of `vellum bench`, in parts. Each part runs in a process of its own, since a driver may hang, crash
// or lose the device. Its results are rows: JSON objects.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "gpu/device.h"
#include "job/worker.h"
#include "render/renderer.h"

namespace vellum::cli
{

enum class PartKind {
    Device,    // the device, and who implements micromaps
    Check,     // random cases against the oracle of `vellum check`
    Frames,    // frames with micromaps compared with frames with alpha tests
    Builds,    // micromaps and acceleration structures
    Pipelines, // making pipelines
};
inline constexpr const char *kPartNames[] = {"device", "check", "frames", "builds", "pipelines"};

struct Part {
    PartKind kind = PartKind::Device;
    std::string implementation = "auto"; // the layer's setting
    gpu::Api api = gpu::Api::Khr;
    render::Trace trace = render::Trace::Query; // of frames
    double seconds = 10;                        // intended duration

    // "frames-query-emulated-khr"; "device-auto"
    [[nodiscard]] std::string name() const;
};

// The device, and the folder of the layer.
struct BenchDevice {
    gpu::DeviceSelection device;
    std::optional<std::filesystem::path> layerFolder;
};

// A worker process measures parts (job/worker.h). Its events: a row, or that it has completed a frame, a build, a
// pipeline or a case since the last event.
std::string rowEvent(const std::string &row);
inline constexpr const char *kProgressEvent = R"({"event":"progress"})";

// Answers requests for parts. Returns the exit code.
int runPartWorker(const BenchDevice &device);

struct PartResult {
    Part part;
    std::vector<std::string> rows; // JSON objects, all that were complete
    std::string failure;           // how it ended, in words; empty for success
    double seconds = 0;
    double others = 0; // the share of the processors that other programs took before it and after it
};

// Measures a part in a worker, `vellum bench --worker`, and ends it if it reports neither a row nor progress for
// `timeout` seconds, or if this process is interrupted. `progress` is called now and then.
PartResult runPartProcess(const Part &part, const BenchDevice &device, double timeout,
                          const std::function<void()> &progress);

} // namespace vellum::cli
