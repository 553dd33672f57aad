// SPDX-License-Identifier: Apache-2.0
// The report of `vellum bake`.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/bake/bake.h"
#include "cli/base/exit_code.h"
#include "gltf/micromaps/known_surface.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{

struct BakedReport {
    std::string primitive; // `mesh 2 "leaves" primitive 0`
    std::string material;
    size_t triangles = 0;
    std::array<size_t, 4> special{};   // triangles with a special index, by State
    size_t varying = 0;                // triangles that are unknown because the alphas of their vertices differ
    std::array<uint64_t, 13> levels{}; // the other triangles by level
    std::array<double, 4> states{};    // shares of State, each triangle counted alike
    size_t micromap = 0;               // the number of its micromap
    std::string caution;               // BakedPrimitive::caution
};

struct BakeFileReport {
    BakeJob job;
    ExitCode code = ExitCode::Success;
    bool ended = true; // false: it was not baked because of an interruption or a full disk
    std::string error; // in one line; empty if the file was baked. Otherwise nothing below is known
    // Why no primitive was baked although some should have been: something is not supported, or micromaps are required.
    // Empty if one was.
    std::string failure;
    bool replaced = false;
    std::string replacedLoss; // lossOfMicromaps() of the micromaps that were replaced
    bool written = false;
    uint64_t inputBytes = 0;
    uint64_t outputBytes = 0;                                      // 0 if nothing was written
    std::vector<std::pair<std::filesystem::path, uint64_t>> files; // FileBake::files
    std::vector<BakedReport> primitives;
    std::vector<MicromapSummary> micromaps;
    uint64_t indexBytes = 0; // of the micromap indices of all primitives
    std::vector<SkippedPrimitive> skipped;
    std::optional<SurfaceShares> surface;
    size_t cacheHits = 0; // and misses: both 0 without a cache
    size_t cacheMisses = 0;
};

BakeFileReport reportOf(const BakeJob &job, FileBake result);

// `; 2 alpha-tested primitives skipped (alphaMode BLEND: 1 primitive of 1 material; --blend bakes it)`, or empty.
std::string skippedText(const BakeFileReport &file);

void printLines(const std::vector<BakeFileReport> &files);
void printTable(const std::vector<BakeFileReport> &files);
// What became of several files, in a line; of one, why it was not written. Empty if there is nothing to add, and where
// the run ended early, which has a line of its own.
std::string totals(const std::vector<BakeFileReport> &files);
// `done`: the number of files that earlier logs have as done.
void printJson(const std::vector<BakeFileReport> &files, size_t done, bool dryRun);

} // namespace vellum::cli
