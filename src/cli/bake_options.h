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
    std::vector<std::filesystem::path> inputs; // files and folders
    std::optional<std::filesystem::path> output;
    FileBakeOptions bake;
    unsigned threads = 0; // 0: one for each processor
    bool report = false;
    bool json = false;
};

// How `vellum bake` bakes, for other commands that do, as options of theirs. The function that is returned is to be
// called after the command line was read; it throws Error.
std::function<void()> declareBaking(CLI::App &command, DocumentBakeOptions &options, const std::string &group = "");

// "1500", "64K", "2M" or "1G", with steps of 1024. Throws Error.
uint64_t parseBytes(const std::string &text);

} // namespace vellum::cli
