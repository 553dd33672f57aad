// SPDX-License-Identifier: Apache-2.0
// The two ends of a worker process of `vellum check`, and the messages between them: a JSON object a line. Only in a
// worker does the driver run, which may crash, hang and print what it likes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "check/groups/group.h"
#include "gpu/device_selection.h"
#include "job/worker.h"

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
    std::string reproducer;     // Replay: its text. Separate: the case after those that its process ran before it
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
    // End of Request::Separate: how many of the cases that ran before the case in its process it needs to fail.
    size_t before = 0;
};
std::string write(const Event &event);
// Throws Error.
Event parseEvent(const std::string &line);

// A case that runs before another one in the same process.
struct EarlierCase {
    std::string name;
    std::string group;
    uint64_t seed = 0;
};
// "khr.levels.0001, khr.levels.0002"
std::string namesOf(const std::vector<EarlierCase> &cases);

// A file that --replay runs.
struct Reproducer {
    std::string name; // of the case
    check::Api api = check::Api::Khr;
    std::string group;
    uint64_t seed = 0;
    std::string shrunk; // JSON of the group; empty: the case is that of the seed
    std::vector<EarlierCase> before;
};
std::string write(const Reproducer &reproducer);
// Throws Error.
Reproducer parseReproducer(const std::string &text);
// Throws UsageError.
Reproducer readReproducer(const std::filesystem::path &path);

// Answers the requests of stdin until it ends, on stdout. What the driver prints goes to stderr. Returns an exit code.
int runWorker(const WorkerOptions &options);

// Worker processes of `vellum check`.
class WorkerProcess : public job::Worker
{
public:
    // Starts `vellum check --worker` with these options. Throws Error.
    explicit WorkerProcess(const WorkerOptions &options);

    void send(const Request &request) { Worker::send(write(request)); }

    struct Output {
        std::vector<Event> events;
        std::optional<ProcessEnd> end; // after these events
    };
    // The output since the last call.
    Output read();
};

// A worker's answer to a request.
struct Answer {
    std::optional<Event> event;    // no Event::Begin
    std::optional<ProcessEnd> end; // of a process that has ended instead; neither: the time is over
};
// Waits that many seconds for the device to be open, and as many for what follows; less if vellum is interrupted.
Answer waitForAnswer(WorkerProcess &worker, double seconds);

// The outcome of a case whose worker ended or did not end in time.
check::Outcome outcomeOfEnd(check::Status status, std::string cause, const std::string &printed);

// Cases in worker processes that they may end.
class SeparateRuns
{
public:
    SeparateRuns(WorkerOptions options, double timeout) : options_(std::move(options)), timeout_(timeout) {}

    // The case of a group as a reproducer; it does not run. Throws Error.
    std::string make(const std::string &group, uint64_t seed);
    // Runs one. Another process follows one that has ended.
    check::Outcome run(const std::string &reproducer);
    // Runs a case and those before it in a new process.
    check::Outcome runInNewProcess(const Reproducer &reproducer);

private:
    check::Outcome outcomeOf(const Request &request);

    WorkerOptions options_;
    double timeout_;
    std::unique_ptr<WorkerProcess> process_;
};

} // namespace vellum::cli
