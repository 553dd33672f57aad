// SPDX-License-Identifier: Apache-2.0
#include "cli/bake/bake_report.h"

#include <algorithm>
#include <fmt/format.h>
#include <numeric>
#include <set>

#include "base/text.h"
#include "core/utf8_path.h"

namespace vellum::cli
{
namespace
{

BakedReport reportOf(const BakedPrimitive &primitive, const StoredMicromap &micromap,
                     const std::vector<std::array<double, 4>> &shares)
{
    BakedReport report;
    report.primitive = primitive.name;
    report.material = primitive.material;
    report.triangles = primitive.micromap.indices.size();
    report.varying = primitive.varying;
    report.micromap = primitive.micromap.micromap;
    report.caution = primitive.caution;
    for (const int32_t index : primitive.micromap.indices) {
        if (const auto special = specialState(index)) {
            ++report.special[static_cast<size_t>(*special)];
            ++report.states[static_cast<size_t>(*special)];
            continue;
        }
        const auto triangle = static_cast<uint32_t>(index) + primitive.micromap.baseTriangle;
        ++report.levels[micromap.triangles[triangle].subdivisionLevel];
        for (size_t s = 0; s < 4; ++s)
            report.states[s] += shares[triangle][s];
    }
    for (double &state : report.states)
        state /= static_cast<double>(std::max<size_t>(report.triangles, 1));
    return report;
}

double knownShare(const std::vector<BakedReport> &primitives)
{
    double known = 0;
    double all = 0;
    for (const BakedReport &primitive : primitives) {
        known += (primitive.states[0] + primitive.states[1]) * static_cast<double>(primitive.triangles);
        all += static_cast<double>(primitive.triangles);
    }
    return all > 0 ? known / all : 0;
}

size_t micromapBytes(const BakeFileReport &file)
{
    size_t bytes = 0;
    for (const MicromapSummary &micromap : file.micromaps)
        bytes += micromap.bytes;
    return bytes;
}

// "tree.glb -> tree.omm.glb"
std::string namesOf(const BakeJob &job)
{
    return utf8Text(job.input) + " -> " + utf8Text(job.output);
}

// Of a file without a scene to measure.
std::string describeTriangles(const BakeFileReport &file)
{
    const bool approximate = std::any_of(file.micromaps.begin(), file.micromaps.end(), [](const MicromapSummary &m) {
        return std::any_of(m.levels.begin(), m.levels.end(), [](const auto &entry) { return entry.first.second == 2; });
    });
    const std::string share = percent(knownShare(file.primitives)) + " of triangles are ";
    return approximate ? share + "opaque or transparent, some in " + kTwoStatesText : share + "known";
}

// The caution that all primitives with one have in common, or how many there are.
std::string cautionText(const BakeFileReport &file)
{
    std::set<std::string> cautions;
    size_t primitives = 0;
    for (const BakedReport &primitive : file.primitives)
        if (!primitive.caution.empty()) {
            cautions.insert((primitive.material.empty() ? "" : primitive.material + ": ") + primitive.caution);
            ++primitives;
        }
    if (cautions.size() == 1)
        return "; caution: " + *cautions.begin();
    return cautions.empty() ? "" : fmt::format("; {}, see --report", counted(primitives, "caution"));
}

std::string summary(const BakeFileReport &file)
{
    size_t triangles = 0;
    for (const BakedReport &primitive : file.primitives)
        triangles += primitive.triangles;
    const std::string share = file.surface ? describe(*file.surface) : describeTriangles(file);
    const std::string nothing = file.code == ExitCode::Failed ? "nothing could be baked" : "nothing to bake";
    std::string text = file.primitives.empty()
                           ? nothing + (file.written ? "" : ", not written")
                           : fmt::format("{}; {} of micromaps + {} of indices, {}, {}", share,
                                         counted(micromapBytes(file), "byte"), grouped(file.indexBytes),
                                         counted(file.primitives.size(), "primitive"), counted(triangles, "triangle"));
    std::error_code error;
    if (!file.written && std::filesystem::exists(file.job.output, error))
        text += ", the earlier file is left as it is";
    text += skippedText(file);
    const auto lost = std::count_if(file.skipped.begin(), file.skipped.end(),
                                    [](const SkippedPrimitive &s) { return s.hadMicromap; });
    if (lost != 0 && file.written)
        text += fmt::format(" ({} lost {} micromap)", lost, lost == 1 ? "its" : "their");
    if (file.replaced && file.written && !file.primitives.empty())
        text += "; the input had micromaps already, which were replaced";
    if (file.cacheHits + file.cacheMisses != 0)
        text +=
            fmt::format("; cache: {}, {}", counted(file.cacheHits, "hit"), counted(file.cacheMisses, "miss", "misses"));
    return text + cautionText(file);
}

void write(const BakedReport &primitive, JsonWriter &json)
{
    json.beginObject().member("primitive", primitive.primitive).member("material", primitive.material);
    json.member("triangles", primitive.triangles).member("micromap", primitive.micromap);
    json.member("varyingAlpha", primitive.varying);
    if (!primitive.caution.empty())
        json.member("caution", primitive.caution);
    writeStates("special", primitive.special, json);
    writeLevels(primitive.levels, json);
    writeStates("states", primitive.states, json);
    json.end();
}

void write(const BakeFileReport &file, JsonWriter &json)
{
    json.beginObject().member("file", utf8Text(file.job.input));
    if (!file.error.empty()) {
        json.member("error", file.error).end();
        return;
    }
    json.member("output", utf8Text(file.job.output));
    json.member("written", file.written).member("bytes", file.inputBytes).member("outputBytes", file.outputBytes);
    if (!file.failure.empty())
        json.member("failure", file.failure);
    json.member("replaced", file.replaced);
    if (!file.replacedLoss.empty())
        json.member("replacedLoss", file.replacedLoss);
    if (file.cacheHits + file.cacheMisses != 0) {
        json.key("cache").beginObject().member("hits", file.cacheHits).member("misses", file.cacheMisses);
        json.end();
    }
    writeSurface(file.surface, json);
    writeMicromaps(file.micromaps, json);
    json.list("primitives", file.primitives, [&](const BakedReport &primitive) { write(primitive, json); });
    writeSkipped(file.skipped, json);
    json.end();
}

// If all primitives that should have been baked have something that is not supported.
std::string failureOf(const BakeJob &job, const DocumentBake &bake)
{
    const auto first = std::find_if(bake.skipped.begin(), bake.skipped.end(),
                                    [](const SkippedPrimitive &skipped) { return skipped.unsupported(); });
    if (!bake.primitives.empty() || first == bake.skipped.end())
        return "";
    return fmt::format("{}: none of its alpha-tested primitives could be baked: {}: {}", utf8Text(job.input),
                       first->name, reasonFor(*first));
}

void printReplacedLoss(const BakeFileReport &file)
{
    if (!file.replacedLoss.empty())
        fmt::print("  replaced: {}\n", file.replacedLoss);
}

void printPrimitives(const BakeFileReport &file)
{
    if (file.primitives.empty())
        return;
    std::vector<std::vector<std::string>> rows = {
        {"primitive", "material", "triangles", "with data", "levels", "transparent", "opaque", "unknown", "micromap"}};
    for (const BakedReport &p : file.primitives)
        rows.push_back({p.primitive, p.material, grouped(p.triangles),
                        grouped(std::accumulate(p.levels.begin(), p.levels.end(), uint64_t{0})), levelsText(p.levels),
                        percent(p.states[0]), percent(p.states[1]), percent(p.states[2] + p.states[3]),
                        std::to_string(p.micromap)});
    fmt::print("{}", alignedRows(rows, 2, "  "));
    fmt::print("  shares are of triangles, each counted alike\n");
}

void printRemarks(const BakeFileReport &file)
{
    for (const BakedReport &p : file.primitives)
        if (p.varying != 0)
            fmt::print("  {}: {} unknown, the alphas of {} vertices (COLOR_0) differ\n", p.primitive,
                       counted(p.varying, "triangle is", "triangles are"), p.varying == 1 ? "its" : "their");
    for (const BakedReport &p : file.primitives)
        if (!p.caution.empty())
            fmt::print("  caution: {}{}: {}\n", p.primitive, p.material.empty() ? "" : fmt::format(" ({})", p.material),
                       p.caution);
    for (const SkippedPrimitive &skipped : file.skipped)
        fmt::print("  skipped: {}{}\n", describe(skipped),
                   skipped.hadMicromap && file.written ? "; its micromap was removed" : "");
}

} // namespace

BakeFileReport reportOf(const BakeJob &job, FileBake result)
{
    BakeFileReport report;
    report.job = job;
    report.failure = failureOf(job, result.bake);
    report.code = report.failure.empty() ? ExitCode::Success : ExitCode::Failed;
    report.replaced = result.replaced;
    report.replacedLoss = std::move(result.replacedLoss);
    report.written = result.written;
    report.inputBytes = result.inputBytes;
    report.outputBytes = result.outputBytes;
    report.files = std::move(result.files);
    report.surface = result.surface;
    report.cacheHits = result.bake.cacheHits;
    report.cacheMisses = result.bake.cacheMisses;
    report.micromaps = summariesOf(result.bake.micromaps);
    report.skipped = std::move(result.bake.skipped);
    std::vector<std::vector<std::array<double, 4>>> shares;
    for (const StoredMicromap &micromap : result.bake.micromaps)
        shares.push_back(stateShares(micromap.triangles, micromap.data));
    for (const BakedPrimitive &primitive : result.bake.primitives) {
        const uint32_t micromap = primitive.micromap.micromap;
        report.primitives.push_back(reportOf(primitive, result.bake.micromaps[micromap], shares[micromap]));
        report.indexBytes +=
            primitive.micromap.indices.size() * micromapIndexBytes(result.bake.micromaps[micromap].triangles.size());
    }
    return report;
}

std::string skippedText(const BakeFileReport &file)
{
    if (file.skipped.empty())
        return "";
    std::string text = fmt::format("; {} skipped", counted(file.skipped.size(), "alpha-tested primitive"));
    size_t blended = 0;
    std::set<std::string> materials;
    for (const SkippedPrimitive &skipped : file.skipped)
        if (skipped.code == SkipReason::AlphaModeBlend) {
            ++blended;
            materials.insert(skipped.material);
        }
    if (blended != 0)
        text += fmt::format(" (alphaMode BLEND: {} of {}; --blend bakes {})", counted(blended, "primitive"),
                            counted(materials.size(), "material"), blended == 1 ? "it" : "them");
    return text;
}

void printLines(const std::vector<BakeFileReport> &files)
{
    for (const BakeFileReport &file : files)
        if (file.error.empty()) {
            fmt::print("{}: {}\n", file.written ? namesOf(file.job) : utf8Text(file.job.input), summary(file));
            printReplacedLoss(file);
        }
}

void printTable(const std::vector<BakeFileReport> &files)
{
    for (const BakeFileReport &file : files) {
        if (!file.error.empty())
            continue;
        fmt::print("{}: {}\n", namesOf(file.job), summary(file));
        if (file.written)
            fmt::print("  {} bytes became {}\n", grouped(file.inputBytes), grouped(file.outputBytes));
        printReplacedLoss(file);
        printPrimitives(file);
        for (size_t i = 0; i < file.micromaps.size(); ++i)
            fmt::print("  micromap {}: {}, {}\n", i, counted(file.micromaps[i].triangles, "triangle"),
                       counted(file.micromaps[i].bytes, "byte"));
        printRemarks(file);
    }
}

std::string totals(const std::vector<BakeFileReport> &files)
{
    std::array<size_t, 4> counts{};
    auto &[baked, unwritten, copied, failed] = counts;
    for (const BakeFileReport &file : files) {
        if (!file.ended)
            return "";
        ++(file.code != ExitCode::Success ? failed
           : !file.primitives.empty()     ? baked
           : file.written                 ? copied
                                          : unwritten);
    }
    if (files.size() < 2)
        return unwritten == 0 ? ""
                              : "the output was not written, as nothing is baked; --copy writes a copy of the input";
    std::string text = counted(baked, "file") + " baked";
    if (unwritten != 0)
        text += fmt::format(", {} not written (nothing to bake; --copy writes copies)", grouped(unwritten));
    if (copied != 0)
        text += fmt::format(", {} written with nothing baked", grouped(copied));
    if (failed != 0)
        text += fmt::format(", {} failed", grouped(failed));
    return text;
}

void printJson(const std::vector<BakeFileReport> &files, size_t done, bool dryRun)
{
    JsonWriter json;
    beginReport(json, "bake");
    json.member("dryRun", dryRun);
    if (done != 0)
        json.member("done", done);
    json.list("files", files, [&](const BakeFileReport &file) { write(file, json); });
    fmt::print("{}\n", json.end().text());
}

} // namespace vellum::cli
