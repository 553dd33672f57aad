// SPDX-License-Identifier: Apache-2.0
// The options of `vellum check`, and what runs it once they are parsed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "gpu/device_selection.h"
#include "job/shard.h"

namespace vellum::cli
{

struct CheckOptions {
    gpu::DeviceSelection device;
    std::optional<std::string> api; // ext, khr or both; what the device has without
    bool layer = true;
    std::string implementation;                       // empty: not given
    std::optional<std::filesystem::path> layerFolder; // instead of the one next to the program
    std::vector<std::string> filters;
    std::optional<std::filesystem::path> caseList;
    std::optional<std::filesystem::path> replay;
    std::optional<std::filesystem::path> baseline;
    std::vector<std::filesystem::path> skips;
    std::vector<std::filesystem::path> flakes;
    std::optional<double> minutes;
    job::Shard shard;
    std::vector<std::filesystem::path> merge; // folders of runs
    bool quick = false;
    bool failFast = false;
    uint32_t jobs = 1;
    uint64_t seed = 1;
    double timeout = 60; // seconds
    std::filesystem::path output = "vellum-check";
    std::optional<std::filesystem::path> results; // besides those in `output`
    std::optional<std::filesystem::path> junit;
    bool force = false;
    bool list = false;
    bool groups = false;
    bool json = false;
    double progress = 10; // seconds between lines if stderr is not a terminal; 0: none
    bool worker = false;
};

// Returns the exit code. Throws Error.
int checkCommand(const CheckOptions &options);

} // namespace vellum::cli
