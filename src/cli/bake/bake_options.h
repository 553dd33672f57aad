// SPDX-License-Identifier: Apache-2.0
// The options of `vellum bake`.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "gltf/micromaps/file_bake.h"

namespace CLI
{
class App;
}

namespace vellum::cli
{

struct BakeCommandOptions {
    std::vector<std::filesystem::path> inputs;   // files and folders; "-" is stdin
    std::optional<std::filesystem::path> output; // "-" is stdout
    FileBakeOptions bake;
    unsigned threads = 0; // 0: one for each processor
    bool force = false;   // replaces any file
    bool dryRun = false;  // writes nothing
    bool requireMicromaps = false;
    bool table = false;
    bool json = false;
    bool quiet = false;
};

// Declares the options that say how to bake, for every command that bakes. The function that is returned completes
// `options` once the command line is parsed; it throws UsageError.
std::function<void()> declareBaking(CLI::App &command, DocumentBakeOptions &options);

// "auto" is no level. Throws UsageError.
std::optional<uint32_t> parseLevel(const std::string &text);

// "1500", "64K", "2M" or "1G", with steps of 1024. Throws UsageError.
uint64_t parseBytes(const std::string &text);

} // namespace vellum::cli
