// SPDX-License-Identifier: Apache-2.0
// `vellum sweep`: what bakes with many settings would be, as a table, a chart and a recommendation.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "gltf/micromaps/document_bake.h"

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

// A setting, for one file or for all.
struct SweepRow {
    BakeSetting setting;
    uint64_t bytes = 0; // of all files
    double known = 0;   // share of the alpha-tested surface: the mean of the files
    double proven = 0;  // the same of DocumentOutline::proven
    bool tooLarge = false;
    std::array<uint64_t, 13> levels{};
    // More bytes for each percentage point that is known in addition to the row before: the next lower level, or the
    // next smaller budget. Nothing for the first one, and where nothing is gained.
    std::optional<double> bytesPerPercent;

    // Of 1,000 hits on the alpha-tested surface, those that run the alpha test.
    [[nodiscard]] double shaderCalls() const { return 1000 * (1 - known); }
    // Share of the surface that is known without proof: 2 states instead of unknown.
    [[nodiscard]] double approximate() const { return known - proven; }
    // As options of vellum bake, to which those that were given are added: "--level 5 --states 2".
    [[nodiscard]] std::string options() const;
    // Can be baked, and is exact.
    [[nodiscard]] bool eligible() const { return !tooLarge && setting.format == Format::FourState; }
};

struct Recommendation {
    size_t row = 0;
    std::string options; // of vellum bake, all of them
    std::string reason;  // a sentence without its full stop
};

struct Sweep {
    std::vector<SweptFile> files;
    size_t bakeable = 0;        // files of which something is baked
    std::vector<SweepRow> rows; // of those
    std::optional<Recommendation> recommendation;
};

// The rows of files, which have the same settings. Budgets that change nothing are left out.
std::vector<SweepRow> rowsOf(const std::vector<const DocumentOutlines *> &files);

// The fewest bytes that know 95 % of what the best of the rows knows; none if no row knows anything. `given`: of
// SweepOptions.
std::optional<Recommendation> recommend(const std::vector<SweepRow> &rows, const std::string &given);

// "12.0 % of the alpha-tested surface gets no micromap: 2 primitives skipped (its alphaMode is BLEND)"; empty if all of
// it gets one.
std::string exclusionsText(const Sweep &sweep);

// 65536 -> "64K"
std::string shortBytes(double bytes);

inline constexpr const char *kShaderCallsText =
    "Shader calls: of 1,000 hits that are spread evenly over the alpha-tested surface, those that run the alpha test. "
    "They are where the state is unknown and where there is no micromap; without micromaps it is all of them.";

inline constexpr const char *kTwoStatesText =
    "Approximate: what 2 states say of the surface that is unknown in 4 states at the same level.";

// The cells of the table, without levels; the first row is its head.
std::vector<std::array<std::string, 6>> tableOf(const Sweep &sweep);

std::string sweepChart(const Sweep &sweep); // SVG
std::string sweepPage(const Sweep &sweep);  // HTML

void printSweep(const Sweep &sweep);
void printSweepJson(const Sweep &sweep, const SweepOptions &options);

// Returns the exit code.
int sweepCommand(const SweepOptions &options);

} // namespace vellum::cli
