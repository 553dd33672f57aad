// SPDX-License-Identifier: Apache-2.0
#include "inspect/report_parts.h"

#include <algorithm>

#include "base/text.h"
#include "gltf/data/decompress.h"
#include "gltf/data/image.h"

namespace vellum
{

void beginReport(JsonWriter &json, const char *command)
{
    json.beginObject().member("schema", kReportSchema).member("command", command);
}

std::string levelsText(std::span<const uint64_t> counts)
{
    const auto used = [](uint64_t count) { return count != 0; };
    const auto first = std::find_if(counts.begin(), counts.end(), used);
    if (first == counts.end())
        return "-";
    const std::string low = std::to_string(first - counts.begin());
    const std::string high =
        std::to_string(std::find_if(counts.rbegin(), counts.rend(), used).base() - counts.begin() - 1);
    return low == high ? low : low + "-" + high;
}

std::string describe(const SurfaceShares &surface)
{
    const bool approximate = surface.twoStates > 0;
    std::string text = percent(surface.known()) + " of the alpha-tested surface is " +
                       (approximate ? "opaque or transparent" : "known");
    if (surface.withoutMicromap > 0)
        text += ", " + percent(surface.withoutMicromap) + " of it has no micromap";
    if (approximate)
        text += ", " + percent(surface.twoStates) + " of it is in triangles with " + kTwoStatesText;
    return text;
}

void writeSurface(const std::optional<SurfaceShares> &surface, JsonWriter &json)
{
    json.key("surface");
    if (!surface) {
        json.null();
        return;
    }
    json.beginObject().member("known", surface->known());
    writeStates("states", surface->states, json);
    json.member("withoutMicromap", surface->withoutMicromap).member("twoStates", surface->twoStates).end();
}

void writeFinding(const char *kind, const std::string &place, const std::string &message, JsonWriter &json)
{
    json.beginObject().member("kind", kind).member("place", place).member("message", message).end();
}

std::vector<MicromapSummary> summariesOf(std::span<const StoredMicromap> micromaps)
{
    std::vector<MicromapSummary> summaries;
    for (const StoredMicromap &micromap : micromaps) {
        MicromapSummary &summary = summaries.emplace_back();
        summary.triangles = micromap.triangles.size();
        summary.bytes = micromap.bytes();
        for (const MicromapTriangle &t : micromap.triangles)
            ++summary.levels[{t.subdivisionLevel, t.format == Format::TwoState ? 2 : 4}];
    }
    return summaries;
}

void writeMicromaps(std::span<const MicromapSummary> micromaps, JsonWriter &json)
{
    json.list("micromaps", micromaps, [&](const MicromapSummary &micromap) {
        json.beginObject().member("triangles", micromap.triangles).member("bytes", micromap.bytes);
        json.list("levels", micromap.levels, [&](const auto &entry) {
            json.beginObject().member("level", entry.first.first).member("states", entry.first.second);
            json.member("triangles", entry.second).end();
        });
        json.end();
    });
}

std::string reasonFor(const SkippedPrimitive &skipped)
{
    return skipped.reason + (skipped.code == SkipReason::AlphaModeBlend ? "; --blend bakes it"
                             : skipped.hasFallback ? "; --fallback-images bakes from another image of the texture"
                                                   : "");
}

std::string describe(const SkippedPrimitive &skipped)
{
    return skipped.name + (skipped.material.empty() ? "" : " (" + skipped.material + ")") + ": " + reasonFor(skipped);
}

void writeSkipped(std::span<const SkippedPrimitive> skipped, JsonWriter &json)
{
    json.list("skipped", skipped, [&](const SkippedPrimitive &s) {
        json.beginObject().member("primitive", s.name).member("material", s.material);
        json.member("reason", nameOf(s.code)).member("message", s.reason);
        json.member("hadMicromap", s.hadMicromap).end();
    });
}

std::vector<std::string> unreadableFormats()
{
    std::vector<std::string> formats;
    if (!kDecodesWebpAndAvif)
        formats.emplace_back("WebP and AVIF images");
    if (!kDecompressesMeshes)
        formats.emplace_back("geometry compressed by Draco or meshoptimizer");
    if (const std::string what = undecodableByMeshoptimizer(); !what.empty())
        formats.push_back("geometry by EXT_meshopt_compression and KHR_meshopt_compression with " + what);
    return formats;
}

} // namespace vellum
