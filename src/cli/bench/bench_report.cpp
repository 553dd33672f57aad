// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/bench_report.h"

#include <chrono>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <optional>
#include <rapidjson/document.h>

#include "base/statistics.h"
#include "base/version.h"
#include "cli/bench/bench_page_files.h"
#include "inspect/page.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{
namespace
{

using Row = rapidjson::Document;

// A part that takes this much longer than planned, and that many seconds, is slow.
constexpr double kSlow = 2;
constexpr double kSecondsOfStart = 10;

std::vector<Row> rowsOf(const PartResult &result, std::string_view kind)
{
    std::vector<Row> rows;
    for (const std::string &text : result.rows) {
        Row row;
        row.Parse(text.data(), text.size());
        if (!row.HasParseError() && row["row"].GetString() == kind)
            rows.push_back(std::move(row));
    }
    return rows;
}

// The ratio of a row; nothing where the device's clock stands still, which JSON has as null.
std::optional<Quartiles> ratioOf(const Row &row)
{
    const rapidjson::Value &ratio = row["ratio"];
    for (const rapidjson::Value &value : ratio.GetArray())
        if (!value.IsNumber() || value.GetDouble() <= 0)
            return std::nullopt;
    return Quartiles{ratio[0].GetDouble(), ratio[1].GetDouble(), ratio[2].GetDouble()};
}

// "1.05 times as fast (0.98 to 1.12, not distinguishable)": a value, the middle half of what was measured, and whether
// it is about the same.
std::string comparison(const Quartiles &quartiles, const char *words)
{
    const bool same = quartiles.low <= 1 && quartiles.high >= 1;
    return fmt::format("{:.2f} times as {} ({:.2f} to {:.2f}{})", quartiles.middle, words, quartiles.low,
                       quartiles.high, same ? ", not distinguishable" : "");
}

// "emulated micromaps", "the driver's micromaps"
std::string implementationOf(const Part &part)
{
    const std::string api = part.api == gpu::Api::Khr ? "KHR" : "EXT";
    if (part.implementation == "emulated")
        return "emulated micromaps (" + api + ")";
    return part.implementation == "ext" ? "KHR micromaps translated to the driver's EXT"
                                        : "the driver's micromaps (" + api + ")";
}

void addCheck(const PartResult &result, std::vector<std::string> &verdict)
{
    for (const Row &row : rowsOf(result, "check")) {
        const uint64_t failed = row["failed"].GetUint64();
        verdict.push_back(fmt::format("Self-check of {}: {} random cases passed, {} failed{}.",
                                      implementationOf(result.part), row["passed"].GetUint64(), failed,
                                      failed == 0 ? "" : fmt::format(" ({})", row["firstFailure"].GetString())));
    }
}

// All levels: the application chooses one, not the best of a run.
void addFrames(const PartResult &result, std::vector<std::string> &verdict)
{
    const std::vector<Row> rows = rowsOf(result, "frame");
    for (const bool heavy : {false, true}) {
        std::string levels;
        for (const Row &row : rows) {
            const std::optional<Quartiles> ratio = ratioOf(row);
            if (row["heavy"].GetBool() != heavy || !ratio)
                continue;
            levels += fmt::format("{}level {} is {}", levels.empty() ? "" : "; ", row["level"].GetUint(),
                                  comparison({1 / ratio->high, 1 / ratio->middle, 1 / ratio->low}, "fast"));
        }
        if (!levels.empty())
            verdict.push_back(
                fmt::format("By {}, {} compared with a {} alpha test: {}.",
                            result.part.trace == render::Trace::Query ? "ray queries" : "a ray tracing pipeline",
                            implementationOf(result.part), heavy ? "heavy" : "plain", levels));
    }
}

void addDifferences(const PartResult &result, std::vector<std::string> &verdict)
{
    uint64_t differing = 0;
    for (const Row &row : rowsOf(result, "frame"))
        differing += row["differingPixels"].GetUint64();
    if (differing > 0)
        verdict.push_back(fmt::format("{} pixels of these frames differ from those of the alpha test.", differing));
}

void addBuilds(const PartResult &result, std::vector<std::string> &verdict)
{
    std::string text;
    double worst = 0;
    for (const Row &row : rowsOf(result, "build")) {
        const std::optional<Quartiles> ratio = ratioOf(row);
        if (!ratio || ratio->middle <= worst)
            continue;
        worst = ratio->middle;
        text = fmt::format("With {}, builds without micromaps take up to {}: {}, {:.3f} ms instead of {:.3f}.",
                           implementationOf(result.part), comparison(*ratio, "long"), row["what"].GetString(),
                           row["withLayer"].GetDouble(), row["withoutLayer"].GetDouble());
    }
    if (!text.empty())
        verdict.push_back(text);
}

// Other programs slow both sides of a comparison, but not equally. Their work on the GPU spreads the times of frames:
// without them, the middle half of the ratios lies within a few hundredths.
// Returns the sentence about it; empty if it is quiet.
std::string noiseOf(const std::vector<PartResult> &results)
{
    constexpr double kBusy = 0.2;
    constexpr double kWide = 0.1;
    double others = 0;
    size_t all = 0;
    size_t wide = 0;
    for (const PartResult &result : results) {
        others = std::max(others, result.others);
        for (const Row &row : rowsOf(result, "frame")) {
            const std::optional<Quartiles> ratio = ratioOf(row);
            if (!ratio)
                continue;
            ++all;
            if (ratio->high - ratio->low > kWide * ratio->middle)
                ++wide;
        }
    }
    constexpr const char *kAgain = "Noisy: run again. No times are compared: ";
    if (others > kBusy)
        return fmt::format("{}other programs took up to {:.0f} % of the processors.", kAgain, 100 * others);
    if (3 * wide > all)
        return fmt::format("{}those of {} of {} comparisons of frames spread by more than {:.0f} %, so other programs "
                           "use the device, or its speed changes.",
                           kAgain, wide, all, 100 * kWide);
    return {};
}

// "The part ... was not completed", or it was slow.
void addEnd(const PartResult &result, std::vector<std::string> &verdict)
{
    if (!result.failure.empty())
        verdict.push_back(fmt::format("The part {} was not completed: {}.", result.part.name(), result.failure));
    else if (result.seconds > kSlow * result.part.seconds + kSecondsOfStart)
        verdict.push_back(fmt::format("The part {} took {:.0f} seconds instead of {:.0f}: the device or the machine is "
                                      "slow.",
                                      result.part.name(), result.seconds, result.part.seconds));
}

} // namespace

std::vector<std::string> verdictOf(const std::vector<PartResult> &results)
{
    std::vector<std::string> verdict;
    const std::string noise = noiseOf(results);
    if (!noise.empty())
        verdict.push_back(noise);
    for (const PartResult &result : results) {
        addCheck(result, verdict);
        if (noise.empty())
            addFrames(result, verdict);
        addDifferences(result, verdict);
        if (noise.empty())
            addBuilds(result, verdict);
        addEnd(result, verdict);
    }
    return verdict;
}

bool selfChecksPassed(const std::vector<PartResult> &results)
{
    for (const PartResult &result : results)
        for (const Row &row : rowsOf(result, "check"))
            if (row["failed"].GetUint64() != 0 || row["passed"].GetUint64() == 0)
                return false;
    return true;
}

std::string benchJson(const std::vector<PartResult> &results, const std::vector<std::string> &verdict, double seconds)
{
    JsonWriter json(JsonStyle::Html);
    beginReport(json, "bench");
    json.member("version", versionText());
    json.member("date", fmt::format("{:%Y-%m-%d}", std::chrono::system_clock::now()));
    json.member("seconds", seconds).member("noisy", !noiseOf(results).empty()).values("verdict", verdict);
    json.list("parts", results, [&](const PartResult &result) {
        json.beginObject().member("name", result.part.name()).member("implementation", result.part.implementation);
        json.member("api", result.part.api == gpu::Api::Khr ? "khr" : "ext");
        json.member("trace", result.part.trace == render::Trace::Query ? "query" : "pipeline");
        json.member("failure", result.failure).member("seconds", result.seconds).member("others", result.others);
        json.list("rows", result.rows, [&](const std::string &row) { json.json(row); });
        json.end();
    });
    json.end();
    return json.text();
}

std::string benchPage(const std::string &json)
{
    return inspect::filledPage(kPage_bench_html,
                               {{"style", inspect::styleElement(kPage_bench_css)},
                                {"data", "<script type=\"application/json\" id=\"report\">" + json + "</script>"},
                                {"script", inspect::scriptElement(kPage_bench_js)}});
}

} // namespace vellum::cli
