// SPDX-License-Identifier: Apache-2.0
// `vellum sweep`: what bakes with many settings would be, as a table, a chart and a recommendation.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "gltf/micromaps/sweep.h"

namespace vellum::cli
{

struct SweepOptions {
    std::vector<std::filesystem::path> inputs;   // files and folders
    std::optional<std::filesystem::path> output; // .html or .svg; "-" is stdout
    DocumentBakeOptions bake;                    // without level, states, budget
    std::string given;                           // the options of the command line that made it: " --max-level 7"
    unsigned threads = 0;                        // 0: one for each processor
    bool force = false;
    bool json = false;
    bool quiet = false;
};

struct SweptFile {
    std::string path;
    std::string error; // in one line; empty if it was read
    DocumentOutlines result;
};

struct Sweep {
    std::vector<SweptFile> files;
    size_t bakeable = 0;        // files of which something is baked
    std::vector<SweepRow> rows; // of those
    std::optional<Recommendation> recommendation;
};

// "12.0 % of the alpha-tested surface gets no micromap: 2 primitives skipped (its alphaMode is BLEND)"; empty if all of
// it gets one.
std::string exclusionsText(const Sweep &sweep);

inline constexpr const char *kShaderCallsText =
    "Shader calls: of 1,000 hits that are spread evenly over the alpha-tested surface, those that run the alpha test. "
    "They are where the state is unknown and where there is no micromap; without micromaps it is all of them.";

inline constexpr const char *kBytesText =
    "Bytes: those of micromaps, without the indices of triangles, 1 to 4 bytes each. 9 are an empty micromap: every "
    "triangle is wholly opaque, transparent or unknown.";

inline constexpr const char *kApproximateText =
    "Approximate: 2 states leave nothing unknown, so no hit runs the alpha test. What 4 states at the same level leave "
    "unknown becomes opaque or transparent, whichever --two-state-rule says, and outlines are jagged.";

// The cells of the table, without levels; the first row is its head.
std::vector<std::array<std::string, 6>> tableOf(const Sweep &sweep);

std::string sweepChart(const Sweep &sweep); // SVG
std::string sweepPage(const Sweep &sweep);  // HTML

void printSweep(const Sweep &sweep);
void printSweepJson(const Sweep &sweep, const SweepOptions &options);

// Returns the exit code.
int sweepCommand(const SweepOptions &options);

} // namespace vellum::cli
