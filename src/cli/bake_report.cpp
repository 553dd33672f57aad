#include "cli/bake_report.h"

#include <algorithm>
#include <fmt/format.h>
#include <numeric>
#include <rapidjson/prettywriter.h>
#include <rapidjson/stringbuffer.h>

#include "cli/base/numbers.h"
#include "gltf/file/utf8.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kStateNames[] = {"transparent", "opaque", "unknownTransparent", "unknownOpaque"};

PrimitiveReport reportOf(const BakedPrimitive &primitive, const StoredMicromap &micromap,
                         const std::vector<std::array<double, 4>> &shares)
{
    PrimitiveReport report;
    report.material = primitive.material;
    report.triangles = primitive.micromap.indices.size();
    report.varying = primitive.varying;
    report.micromap = primitive.micromap.micromap;
    report.caution = primitive.caution;
    for (const std::int32_t index : primitive.micromap.indices) {
        if (const auto special = specialState(index)) {
            ++report.special[static_cast<std::size_t>(*special)];
            ++report.states[static_cast<std::size_t>(*special)];
            continue;
        }
        const auto triangle = static_cast<std::uint32_t>(index) + primitive.micromap.baseTriangle;
        ++report.levels[micromap.triangles[triangle].subdivisionLevel];
        for (std::size_t s = 0; s < 4; ++s)
            report.states[s] += shares[triangle][s];
    }
    for (double &state : report.states)
        state /= static_cast<double>(std::max<std::size_t>(report.triangles, 1));
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

std::size_t micromapBytes(const FileReport &file)
{
    std::size_t bytes = 0;
    for (const MicromapReport &micromap : file.micromaps)
        bytes += micromap.bytes;
    return bytes;
}

std::string levelsText(const PrimitiveReport &primitive)
{
    const auto used = [](std::size_t count) { return count != 0; };
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
    std::size_t triangles = 0;
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
        text += "; " + surfaceKnown(file.surface->known());
    const auto cautions = std::count_if(file.primitives.begin(), file.primitives.end(),
                                        [](const PrimitiveReport &p) { return !p.caution.empty(); });
    if (cautions != 0)
        text += fmt::format("; {}, see --report", counted(static_cast<std::size_t>(cautions), "caution"));
    return text;
}

using Row = std::vector<std::string>;

// The first two columns to the left, numbers to the right.
void printRows(const std::vector<Row> &rows)
{
    std::vector<std::size_t> widths(rows.front().size());
    for (const Row &row : rows)
        for (std::size_t i = 0; i < row.size(); ++i)
            widths[i] = std::max(widths[i], row[i].size());
    for (const Row &row : rows) {
        std::string line = " ";
        for (std::size_t i = 0; i < row.size(); ++i)
            line += i < 2 ? fmt::format(" {:<{}}", row[i], widths[i]) : fmt::format("  {:>{}}", row[i], widths[i]);
        fmt::print("{}\n", line);
    }
}

using JsonOut = rapidjson::PrettyWriter<rapidjson::StringBuffer>;

void putString(JsonOut &out, const char *name, const std::string &value)
{
    out.Key(name);
    const std::string text = toUtf8(value);
    out.String(text.c_str(), static_cast<rapidjson::SizeType>(text.size()));
}

void putNumber(JsonOut &out, const char *name, std::uint64_t value)
{
    out.Key(name);
    out.Uint64(value);
}

void putPrimitive(JsonOut &out, const PrimitiveReport &primitive)
{
    out.StartObject();
    putString(out, "name", primitive.name);
    putString(out, "material", primitive.material);
    putNumber(out, "triangles", primitive.triangles);
    putNumber(out, "micromap", primitive.micromap);
    putNumber(out, "varyingAlpha", primitive.varying);
    if (!primitive.caution.empty())
        putString(out, "caution", primitive.caution);
    out.Key("special");
    out.StartObject();
    for (std::size_t s = 0; s < 4; ++s)
        putNumber(out, kStateNames[s], primitive.special[s]);
    out.EndObject();
    out.Key("levels");
    out.StartObject();
    for (std::size_t level = 0; level < primitive.levels.size(); ++level)
        if (primitive.levels[level] != 0)
            putNumber(out, std::to_string(level).c_str(), primitive.levels[level]);
    out.EndObject();
    out.Key("states");
    out.StartObject();
    for (std::size_t s = 0; s < 4; ++s) {
        out.Key(kStateNames[s]);
        out.Double(primitive.states[s]);
    }
    out.EndObject();
    out.EndObject();
}

void putSurface(JsonOut &out, const std::optional<SurfaceShares> &surface)
{
    if (!surface) {
        out.Null();
        return;
    }
    out.StartObject();
    out.Key("known");
    out.Double(surface->known());
    for (std::size_t s = 0; s < 4; ++s) {
        out.Key(kStateNames[s]);
        out.Double(surface->states[s]);
    }
    out.Key("withoutMicromap");
    out.Double(surface->withoutMicromap);
    out.EndObject();
}

void putFile(JsonOut &out, const FileReport &file)
{
    out.StartObject();
    putString(out, "input", file.job.input.string());
    if (!file.error.empty()) {
        putString(out, "error", file.error);
        out.EndObject();
        return;
    }
    putString(out, "output", file.job.output.string());
    putNumber(out, "inputBytes", file.inputBytes);
    putNumber(out, "outputBytes", file.outputBytes);
    if (!file.failure.empty())
        putString(out, "failure", file.failure);
    out.Key("replaced");
    out.Bool(file.replaced);
    if (!file.replacedLoss.empty())
        putString(out, "replacedLoss", file.replacedLoss);
    out.Key("surface");
    putSurface(out, file.surface);
    out.Key("micromaps");
    out.StartArray();
    for (const MicromapReport &micromap : file.micromaps) {
        out.StartObject();
        putNumber(out, "triangles", micromap.triangles);
        putNumber(out, "bytes", micromap.bytes);
        out.EndObject();
    }
    out.EndArray();
    out.Key("primitives");
    out.StartArray();
    for (const PrimitiveReport &primitive : file.primitives)
        putPrimitive(out, primitive);
    out.EndArray();
    out.Key("left");
    out.StartArray();
    for (const LeftReport &left : file.left) {
        out.StartObject();
        putString(out, "name", left.name);
        putString(out, "material", left.material);
        putString(out, "reason", left.reason);
        out.Key("hadMicromap");
        out.Bool(left.hadMicromap);
        out.EndObject();
    }
    out.EndArray();
    out.EndObject();
}

// Where everything that was to be baked is something that is not supported.
std::string failureOf(const BakeJob &job, const FileBake &result)
{
    const std::vector<LeftPrimitive> &left = result.bake.left;
    const auto first = std::find_if(left.begin(), left.end(), [](const LeftPrimitive &l) { return l.unreadable; });
    if (!result.bake.primitives.empty() || first == left.end())
        return "";
    return fmt::format("{}: none of its alpha-tested primitives could be baked: {}: {}", job.input.string(),
                       result.leftNames[static_cast<std::size_t>(first - left.begin())], first->reason);
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
    for (std::size_t i = 0; i < result.bake.primitives.size(); ++i) {
        const BakedPrimitive &primitive = result.bake.primitives[i];
        const std::uint32_t micromap = primitive.micromap.micromap;
        report.primitives.push_back(reportOf(primitive, result.bake.micromaps[micromap], shares[micromap]));
        report.primitives.back().name = result.names[i];
    }
    for (std::size_t i = 0; i < result.bake.left.size(); ++i)
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
                            grouped(std::accumulate(p.levels.begin(), p.levels.end(), std::size_t{0})), levelsText(p),
                            percent(p.states[0]), percent(p.states[1]), percent(p.states[2] + p.states[3]),
                            std::to_string(p.micromap)});
        if (rows.size() > 1) {
            printRows(rows);
            fmt::print("  shares are of triangles, each counted alike\n");
        }
        for (std::size_t i = 0; i < file.micromaps.size(); ++i)
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
    rapidjson::StringBuffer buffer;
    JsonOut out(buffer);
    out.SetIndent(' ', 2);
    out.StartObject();
    out.Key("files");
    out.StartArray();
    for (const FileReport &file : files)
        putFile(out, file);
    out.EndArray();
    out.EndObject();
    fmt::print("{}\n", buffer.GetString());
}

} // namespace vellum::cli
