// SPDX-License-Identifier: Apache-2.0
// The contract between `vellum check` and the groups of conformance cases: a group runs one random case, which its seed
// determines, on the device of this process.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gpu/instance.h"

namespace vellum::check
{

using namespace gpu;

enum class Status {
    Pass,
    Fail,
    Skip, // the device lacks a feature that the case needs
    Crash,
    Timeout,
    DeviceLost,
};

// A file that explains a failure, such as a picture.
struct OutcomeFile {
    std::string extension; // "png", "txt"
    std::string bytes;
};

struct Outcome {
    Status status = Status::Pass;
    std::string cause;      // one line without numbers that vary: failures with the same cause are put together
    std::string detail;     // the finding and the expectation; lines
    std::string reproducer; // the shrunk case as JSON; empty if none
    uint64_t rays = 0;      // rays compared with the oracle
    std::vector<OutcomeFile> files;
};

// The tests that a process runs.
struct SessionOptions {
    uint32_t device = 0; // its number in Vulkan's list
    Api api = Api::Khr;
    bool layer = true; // the layer is enabled
};

// The device of one process.
class Session;

struct Group {
    std::string_view name;      // "resolution-query": lower case, hyphens
    std::string_view summary;   // one line
    std::string_view sentences; // of the specification that it tests, with section or VUID
    uint32_t cases = 0;         // in a full run
    Outcome (*run)(Session &session, std::string_view group, uint64_t seed) = nullptr;
    // At least 1: the number of first cases that are a quick run. Chosen so that a group takes about three seconds of a
    // worker on lavapipe for each extension.
    uint32_t quick = 20;
    // Kinds of cases: case n is of kind n % kinds, which is also its seed % kinds. The first `kinds` cases show each.
    uint32_t kinds = 1;

    [[nodiscard]] uint32_t quickCases() const { return std::min(quick, cases); }
};

// All groups, in the order in which they run.
std::span<const Group> groups();

// Opens the device. Throws an exception whose what() says why it cannot be tested.
std::shared_ptr<Session> openSession(const SessionOptions &options);

// Runs the case of an Outcome's reproducer.
Outcome replay(Session &session, const std::string &reproducer);

// The case that a group makes of a seed, as a reproducer. It does not run.
std::string makeCase(Session &session, const Group &group, uint64_t seed);

// For cases that end their process: runs a reproducer by `run`, in a process of its own, and shrinks it for at most
// that many seconds, if it crashes or loses the device.
Outcome runSeparately(const std::string &reproducer, Api api, double seconds,
                      const std::function<Outcome(const std::string &reproducer)> &run);
// The account of a case that ends its process. `note`: a line about when it does; empty: always.
OutcomeFile separateAccount(const std::string &reproducer, Api api, const Outcome &outcome, const std::string &note);

} // namespace vellum::check
