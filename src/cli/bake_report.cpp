#include "cli/bake_report.h"

#include <algorithm>
#include <fmt/format.h>
#include <numeric>

#include "cli/base/numbers.h"
#include "cli/surface_report.h"

namespace vellum::cli
{
namespace
{

PrimitiveReport reportOf(const BakedPrimitive &primitive, const StoredMicromap &micromap,
                         const std::vector<std::array<double, 4>> &shares)
{
    PrimitiveReport report;
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

double knownShare(const std::vector<PrimitiveReport> &primitives)
{
    double known = 0;
    double all = 0;
    for (const PrimitiveReport &primitive : primitives) {
        known += (primitive.states[0] + primitive.states[1]) * static_cast<double>(primitive.triangles);
        all += static_cast<double>(primitive.triangles);
    }
    return all > 0 ? known / all : 0;
}

size_t micromapBytes(const FileReport &file)
{
    size_t bytes = 0;
    for (const MicromapReport &micromap : file.micromaps)
        bytes += micromap.bytes;
    return bytes;
}

std::string levelsText(const PrimitiveReport &primitive)
{
    const auto used = [](size_t count) { return count != 0; };
    const auto first = std::find_if(primitive.levels.begin(), primitive.levels.end(), used);
    if (first == primitive.levels.end())
        return "-";
    const auto last = std::find_if(primitive.levels.rbegin(), primitive.levels.rend(), used).base() - 1;
    const auto low = first - primitive.levels.begin();
    const auto high = last - primitive.levels.begin();
    return low == high ? std::to_string(low) : fmt::format("{}-{}", low, high);
}

std::string summary(const FileReport &file)
{
    size_t triangles = 0;
    for (const PrimitiveReport &primitive : file.primitives)
        triangles += primitive.triangles;
    std::string text = file.primitives.empty()
                           ? "nothing to bake"
                           : fmt::format("{}, {}, {} of triangles known, {} of micromaps",
                                         counted(file.primitives.size(), "primitive"), counted(triangles, "triangle"),
                                         percent(knownShare(file.primitives)), counted(micromapBytes(file), "byte"));
    if (!file.left.empty())
        text += fmt::format("; {} left out", counted(file.left.size(), "alpha-tested primitive"));
    const auto lost =
        std::count_if(file.left.begin(), file.left.end(), [](const LeftReport &l) { return l.hadMicromap; });
    if (lost != 0)
        text += fmt::format(" ({} lost {} micromap)", lost, lost == 1 ? "its" : "their");
    if (file.surface)
        text += "; " + describe(*file.surface);
    const auto cautions = std::count_if(file.primitives.begin(), file.primitives.end(),
                                        [](const PrimitiveReport &p) { return !p.caution.empty(); });
    if (cautions != 0)
        text += fmt::format("; {}, see --report", counted(static_cast<size_t>(cautions), "caution"));
    return text;
}

using Row = std::vector<std::string>;

// The first two columns to the left, numbers to the right.
void printRows(const std::vector<Row> &rows)
{
    std::vector<size_t> widths(rows.front().size());
    for (const Row &row : rows)
        for (size_t i = 0; i < row.size(); ++i)
            widths[i] = std::max(widths[i], row[i].size());
    for (const Row &row : rows) {
        std::string line = " ";
        for (size_t i = 0; i < row.size(); ++i)
            line += i < 2 ? fmt::format(" {:<{}}", row[i], widths[i]) : fmt::format("  {:>{}}", row[i], widths[i]);
        fmt::print("{}\n", line);
    }
}

// An object with a member for each State.
template <typename Values>
void writeStates(const char *name, const Values &values, JsonWriter &json)
{
    json.key(name).beginObject();
    for (size_t s = 0; s < 4; ++s)
        json.member(kStateNames[s], values[s]);
    json.end();
}

void write(const PrimitiveReport &primitive, JsonWriter &json)
{
    json.beginObject().member("name", primitive.name).member("material", primitive.material);
    json.member("triangles", primitive.triangles).member("micromap", primitive.micromap);
    json.member("varyingAlpha", primitive.varying);
    if (!primitive.caution.empty())
        json.member("caution", primitive.caution);
    writeStates("special", primitive.special, json);
    json.key("levels").beginObject();
    for (size_t level = 0; level < primitive.levels.size(); ++level)
        if (primitive.levels[level] != 0)
            json.member(std::to_string(level), primitive.levels[level]);
    json.end();
    writeStates("states", primitive.states, json);
    json.end();
}

void write(const FileReport &file, JsonWriter &json)
{
    json.beginObject().member("input", file.job.input.string());
    if (!file.error.empty()) {
        json.member("error", file.error).end();
        return;
    }
    json.member("output", file.job.output.string());
    json.member("inputBytes", file.inputBytes).member("outputBytes", file.outputBytes);
    if (!file.failure.empty())
        json.member("failure", file.failure);
    json.member("replaced", file.replaced);
    if (!file.replacedLoss.empty())
        json.member("replacedLoss", file.replacedLoss);
    cli::write(file.surface, json.key("surface"));
    json.list("micromaps", file.micromaps, [&](const MicromapReport &micromap) {
        json.beginObject().member("triangles", micromap.triangles).member("bytes", micromap.bytes).end();
    });
    json.list("primitives", file.primitives, [&](const PrimitiveReport &primitive) { write(primitive, json); });
    json.list("left", file.left, [&](const LeftReport &left) {
        json.beginObject().member("name", left.name).member("material", left.material);
        json.member("reason", left.reason).member("hadMicromap", left.hadMicromap).end();
    });
    json.end();
}

// Where everything that was to be baked is something that is not supported.
std::string failureOf(const BakeJob &job, const FileBake &result)
{
    const std::vector<LeftPrimitive> &left = result.bake.left;
    const auto first = std::find_if(left.begin(), left.end(), [](const LeftPrimitive &l) { return l.unreadable; });
    if (!result.bake.primitives.empty() || first == left.end())
        return "";
    return fmt::format("{}: none of its alpha-tested primitives could be baked: {}: {}", job.input.string(),
                       result.leftNames[static_cast<size_t>(first - left.begin())], first->reason);
}

// What is said of a file in every form for people.
void printNotes(const FileReport &file)
{
    if (!file.replacedLoss.empty())
        fmt::print("  replaced: {}\n", file.replacedLoss);
}

} // namespace

FileReport reportOf(const BakeJob &job, const FileBake &result)
{
    FileReport report;
    report.job = job;
    report.replaced = result.replaced;
    report.replacedLoss = result.replacedLoss;
    report.inputBytes = result.inputBytes;
    report.outputBytes = result.outputBytes;
    report.surface = result.surface;
    std::vector<std::vector<std::array<double, 4>>> shares;
    for (const StoredMicromap &micromap : result.bake.micromaps) {
        shares.push_back(stateShares(micromap.triangles, micromap.data));
        report.micromaps.push_back(
            {micromap.triangles.size(), micromap.data.size() + sizeof(MicromapTriangle) * micromap.triangles.size()});
    }
    for (size_t i = 0; i < result.bake.primitives.size(); ++i) {
        const BakedPrimitive &primitive = result.bake.primitives[i];
        const uint32_t micromap = primitive.micromap.micromap;
        report.primitives.push_back(reportOf(primitive, result.bake.micromaps[micromap], shares[micromap]));
        report.primitives.back().name = result.names[i];
    }
    for (size_t i = 0; i < result.bake.left.size(); ++i)
        report.left.push_back({result.leftNames[i], result.bake.left[i].material, result.bake.left[i].reason,
                               result.bake.left[i].hadMicromap});
    report.failure = failureOf(job, result);
    return report;
}

void printLines(const std::vector<FileReport> &files)
{
    for (const FileReport &file : files)
        if (file.error.empty()) {
            fmt::print("{}: {}\n", file.job.output.string(), summary(file));
            printNotes(file);
        }
}

void printTable(const std::vector<FileReport> &files)
{
    for (const FileReport &file : files) {
        if (!file.error.empty())
            continue;
        fmt::print("{} -> {}: {}\n", file.job.input.string(), file.job.output.string(), summary(file));
        fmt::print("  {} bytes became {}{}\n", grouped(file.inputBytes), grouped(file.outputBytes),
                   file.replaced ? ", its micromaps were replaced" : "");
        printNotes(file);
        std::vector<Row> rows = {{"primitive", "material", "triangles", "with data", "levels", "transparent", "opaque",
                                  "unknown", "micromap"}};
        for (const PrimitiveReport &p : file.primitives)
            rows.push_back({p.name, p.material, grouped(p.triangles),
                            grouped(std::accumulate(p.levels.begin(), p.levels.end(), size_t{0})), levelsText(p),
                            percent(p.states[0]), percent(p.states[1]), percent(p.states[2] + p.states[3]),
                            std::to_string(p.micromap)});
        if (rows.size() > 1) {
            printRows(rows);
            fmt::print("  shares are of triangles, each counted alike\n");
        }
        for (size_t i = 0; i < file.micromaps.size(); ++i)
            fmt::print("  micromap {}: {}, {}\n", i, counted(file.micromaps[i].triangles, "triangle"),
                       counted(file.micromaps[i].bytes, "byte"));
        for (const PrimitiveReport &p : file.primitives)
            if (p.varying != 0)
                fmt::print("  {}: {} unknown, the alphas of {} vertices (COLOR_0) differ\n", p.name,
                           counted(p.varying, "triangle is", "triangles are"), p.varying == 1 ? "its" : "their");
        for (const PrimitiveReport &p : file.primitives)
            if (!p.caution.empty())
                fmt::print("  caution: {}{}: {}\n", p.name, p.material.empty() ? "" : fmt::format(" ({})", p.material),
                           p.caution);
        for (const LeftReport &left : file.left)
            fmt::print("  left out: {}{}: {}{}\n", left.name,
                       left.material.empty() ? "" : fmt::format(" ({})", left.material), left.reason,
                       left.hadMicromap ? "; its micromap was removed" : "");
    }
}

void printJson(const std::vector<FileReport> &files)
{
    JsonWriter json;
    json.beginObject().list("files", files, [&](const FileReport &file) { write(file, json); });
    fmt::print("{}\n", json.end().text());
}

} // namespace vellum::cli
