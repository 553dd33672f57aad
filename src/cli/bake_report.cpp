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

// Shares of the states in each triangle of a micromap.
std::vector<std::array<double, 4>> sharesOf(const StoredMicromap &micromap)
{
    std::vector<std::array<double, 4>> shares;
    for (const MicromapTriangle &triangle : micromap.triangles) {
        std::array<double, 4> &share = shares.emplace_back();
        const std::uint32_t count = microTriangleCount(triangle.subdivisionLevel);
        for (std::uint32_t i = 0; i < count; ++i) {
            const State state = readState(micromap.data.data() + triangle.dataOffset, i, triangle.format);
            share[static_cast<std::size_t>(state)] += 1.0 / count;
        }
    }
    return shares;
}

PrimitiveReport reportOf(const BakedPrimitive &primitive, const StoredMicromap &micromap,
                         const std::vector<std::array<double, 4>> &shares)
{
    PrimitiveReport report;
    report.material = primitive.material;
    report.triangles = primitive.micromap.indices.size();
    report.varying = primitive.varying;
    report.micromap = primitive.micromap.micromap;
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
    std::string text =
        file.primitives.empty()
            ? "nothing to bake"
            : fmt::format("{} primitive{}, {} triangles, {} known, {} bytes of micromaps", file.primitives.size(),
                          file.primitives.size() == 1 ? "" : "s", grouped(triangles),
                          percent(knownShare(file.primitives)), grouped(micromapBytes(file)));
    if (!file.left.empty())
        text +=
            fmt::format("; {} alpha-tested primitive{} left out", file.left.size(), file.left.size() == 1 ? "" : "s");
    const auto lost =
        std::count_if(file.left.begin(), file.left.end(), [](const LeftReport &l) { return l.hadMicromap; });
    if (lost != 0)
        text += fmt::format(" ({} lost {} micromap)", lost, lost == 1 ? "its" : "their");
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
    out.Key("replaced");
    out.Bool(file.replaced);
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

} // namespace

FileReport reportOf(const BakeJob &job, const FileBake &result)
{
    FileReport report{job, "", result.replaced, result.inputBytes, result.outputBytes, {}, {}, {}};
    std::vector<std::vector<std::array<double, 4>>> shares;
    for (const StoredMicromap &micromap : result.bake.micromaps) {
        shares.push_back(sharesOf(micromap));
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
    return report;
}

void printLines(const std::vector<FileReport> &files)
{
    for (const FileReport &file : files)
        if (file.error.empty())
            fmt::print("{}: {}\n", file.job.output.string(), summary(file));
}

void printTable(const std::vector<FileReport> &files)
{
    for (const FileReport &file : files) {
        if (!file.error.empty())
            continue;
        fmt::print("{} -> {}: {}\n", file.job.input.string(), file.job.output.string(), summary(file));
        fmt::print("  {} bytes became {}{}\n", grouped(file.inputBytes), grouped(file.outputBytes),
                   file.replaced ? ", its micromaps were replaced" : "");
        std::vector<Row> rows = {{"primitive", "material", "triangles", "with data", "levels", "transparent", "opaque",
                                  "unknown", "micromap"}};
        for (const PrimitiveReport &p : file.primitives)
            rows.push_back({p.name, p.material, grouped(p.triangles),
                            grouped(std::accumulate(p.levels.begin(), p.levels.end(), std::size_t{0})), levelsText(p),
                            percent(p.states[0]), percent(p.states[1]), percent(p.states[2] + p.states[3]),
                            std::to_string(p.micromap)});
        if (rows.size() > 1)
            printRows(rows);
        for (std::size_t i = 0; i < file.micromaps.size(); ++i)
            fmt::print("  micromap {}: {} triangles, {} bytes\n", i, grouped(file.micromaps[i].triangles),
                       grouped(file.micromaps[i].bytes));
        for (const PrimitiveReport &p : file.primitives)
            if (p.varying != 0)
                fmt::print("  {}: {} triangles are unknown, the alphas of their vertices (COLOR_0) differ\n", p.name,
                           grouped(p.varying));
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
