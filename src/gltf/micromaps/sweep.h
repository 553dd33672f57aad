// SPDX-License-Identifier: Apache-2.0
// What bakes of glTF files with many settings would be: `vellum sweep`.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/json_writer.h"
#include "gltf/micromaps/document_bake.h"

namespace vellum
{

// Automatic levels and each level up to the highest automatic one, in 4 and in 2 states, then budgets.
DocumentOutlines sweepDocument(const Document &document, const DocumentBakeOptions &options);

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

// The rows of files, which have the same settings. Budgets that change nothing are excluded.
std::vector<SweepRow> rowsOf(const std::vector<const DocumentOutlines *> &files);

// The fewest bytes that know 95 % of what the best of the rows knows; none if no row knows anything. `given`: what
// all of these settings had in addition, as options of vellum bake with a space before each.
std::optional<Recommendation> recommend(const std::vector<SweepRow> &rows, const std::string &given);

// An element of "rows": schema.json describes it.
void write(const SweepRow &row, JsonWriter &json);

// 65536 -> "64K"
std::string shortBytes(double bytes);

} // namespace vellum
