// SPDX-License-Identifier: Apache-2.0
// Parts that the reports of several subcommands share: schema.json describes the JSON.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/json_writer.h"
#include "gltf/micromaps/document_bake.h"
#include "gltf/micromaps/known_surface.h"

namespace vellum
{

inline constexpr const char *kReportSchema = "vellum/1";

// Begins the object that is the whole report; the caller ends it.
void beginReport(JsonWriter &json, const char *command);

// Indexed by State.
inline constexpr const char *kStateNames[] = {"transparent", "opaque", "unknownTransparent", "unknownOpaque"};

// An object with a member for each State.
template <typename Values>
void writeStates(const char *name, const Values &values, JsonWriter &json)
{
    json.key(name).beginObject();
    for (size_t s = 0; s < 4; ++s)
        json.member(kStateNames[s], values[s]);
    json.end();
}

// An object with a member for each level that has some.
template <typename Counts>
void writeLevels(const Counts &counts, JsonWriter &json)
{
    json.key("levels").beginObject();
    for (size_t level = 0; level < counts.size(); ++level)
        if (counts[level] != 0)
            json.member(std::to_string(level), counts[level]);
    json.end();
}

// The levels that have some, as "5" or "2-7", or "-".
std::string levelsText(std::span<const uint64_t> counts);

inline constexpr const char *kTwoStatesText =
    "2 states: approximate, as outlines follow the micro-triangles and no shader refines them";

// "61.2 % of the alpha-tested surface is known, 9.0 % of it has no micromap"; with 2 states nothing is unknown, so what
// is not proven is not said to be known.
std::string describe(const SurfaceShares &surface);

// "surface": null without shares.
void writeSurface(const std::optional<SurfaceShares> &surface, JsonWriter &json);

// An element of "findings".
void writeFinding(const char *kind, const std::string &place, const std::string &message, JsonWriter &json);

struct MicromapSummary {
    size_t triangles = 0;
    size_t bytes = 0;                                       // of data and records
    std::map<std::pair<unsigned, unsigned>, size_t> levels; // triangles by level and number of states
};
std::vector<MicromapSummary> summariesOf(std::span<const StoredMicromap> micromaps);
// "micromaps": an array.
void writeMicromaps(std::span<const MicromapSummary> micromaps, JsonWriter &json);

// `mesh 2 primitive 0 (leaf): its alphaMode is BLEND`
std::string describe(const SkippedPrimitive &skipped);
// Its reason, and the option of `vellum bake` that helps.
std::string reasonFor(const SkippedPrimitive &skipped);
// "skipped": an array.
void writeSkipped(std::span<const SkippedPrimitive> skipped, JsonWriter &json);

// The formats that this build cannot read, such as "WebP and AVIF images"; empty if it reads everything.
std::vector<std::string> unreadableFormats();

} // namespace vellum
