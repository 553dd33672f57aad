// SPDX-License-Identifier: Apache-2.0
// The messages between `vellum check` and its worker processes: a JSON object a line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "check/groups/group.h"
#include "gpu/device_selection.h"

namespace vellum::cli
{

// The device and API that a worker process tests.
struct WorkerOptions {
    gpu::DeviceSelection device; // the operand of --device; the device's number once it is chosen
    check::Api api = check::Api::Khr;
    bool layer = true; // Vellum's layer is enabled
};

// A request to the worker. It answers each with an Event::Device; or with an Event::Begin when the device is open, and
// an Event::End; or with an Event::Error, after which it ends.
struct Request {
    enum class Kind {
        Describe,
        Run,
        Replay,
        Make,     // makes the case, which does not run: the outcome's reproducer
        Separate, // runs and shrinks the case in other workers, because it ended one or did not end
    } kind = Kind::Run;
    std::string group;          // not with Replay
    uint64_t seed = 0;          // the same
    std::string reproducer;     // Replay: its text
    uint32_t timeout = 0;       // Separate: seconds for opening the device and for a case
    uint32_t shrinkSeconds = 0; // Separate: limit of shrinking; 0: none
};
std::string write(const Request &request);
// Throws Error.
Request parseRequest(const std::string &line);

struct DeviceSummary {
    uint32_t number = 0; // in Vulkan's list, for --device
    std::string name;
    std::string implementation; // of micromaps, in words
    bool khr = false;           // has VK_KHR_opacity_micromap
    bool ext = false;
    // Known faults of the driver, and limits of the layer.
    struct Fault {
        std::string text;
        std::string response; // what is avoided or not checked
    };
    std::vector<Fault> knownFaults;

    [[nodiscard]] bool has(check::Api api) const { return api == check::Api::Khr ? khr : ext; }
};

// Loads the drivers. Throws an exception if the device does not exist.
DeviceSummary describeDevice(const WorkerOptions &options);

// An event from the worker.
struct Event {
    enum class Kind { Device, Begin, End, Error } kind = Kind::Begin;
    DeviceSummary device;   // Device
    check::Outcome outcome; // End
    std::string message;    // Error
};
std::string write(const Event &event);
// Throws Error.
Event parseEvent(const std::string &line);

// A file that --replay runs.
struct Reproducer {
    std::string name; // of the case
    check::Api api = check::Api::Khr;
    std::string group;
    uint64_t seed = 0;
    std::string shrunk; // JSON of the group; empty: the case is that of the seed
};
std::string write(const Reproducer &reproducer);
// Throws Error.
Reproducer parseReproducer(const std::string &text);
// Throws UsageError.
Reproducer readReproducer(const std::filesystem::path &path);

} // namespace vellum::cli
