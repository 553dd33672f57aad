// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/bench_report.h"

#include <algorithm>
#include <chrono>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <rapidjson/document.h>

#include "cli/base/report_parts.h"
#include "cli/base/version.h"
#include "cli/bench/bench_page_files.h"

namespace vellum::cli
{
namespace
{

using Row = rapidjson::Document;

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

// The median; 0 where the device's clock stands still, which JSON has as null.
double ratioOf(const Row &row)
{
    const rapidjson::Value &median = row["ratio"][1];
    return median.IsNumber() ? median.GetDouble() : 0;
}

// "emulated micromaps", "the driver's micromaps"
std::string implementationOf(const Part &part)
{
    const std::string api = part.api == MicromapApi::Khr ? "KHR" : "EXT";
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

// By alpha test: plain and heavy.
void addFrames(const PartResult &result, std::vector<std::string> &verdict)
{
    double best[2] = {0, 0};
    unsigned levels[2] = {0, 0};
    uint64_t differing = 0;
    for (const Row &row : rowsOf(result, "frame")) {
        const size_t heavy = row["heavy"].GetBool() ? 1 : 0;
        differing += row["differingPixels"].GetUint64();
        const double ratio = ratioOf(row);
        const double speed = ratio > 0 ? 1 / ratio : 0; // 0: timestamps that do not advance
        if (speed <= best[heavy])
            continue;
        best[heavy] = speed;
        levels[heavy] = row["level"].GetUint();
    }
    if (best[0] == 0)
        return;
    std::string text = fmt::format("By {}, {} are {:.2f} times as fast as a plain alpha test (level {})",
                                   result.part.trace == Trace::Query ? "ray queries" : "a ray tracing pipeline",
                                   implementationOf(result.part), best[0], levels[0]);
    if (best[1] > 0)
        text += fmt::format(" and {:.2f} times as fast as a heavy one (level {})", best[1], levels[1]);
    verdict.push_back(text + ".");
    if (differing > 0)
        verdict.push_back(fmt::format("{} pixels of these frames differ from those of the alpha test.", differing));
}

void addBuilds(const PartResult &result, std::vector<std::string> &verdict)
{
    const std::vector<Row> rows = rowsOf(result, "build");
    const auto slowest = std::ranges::max_element(rows, {}, ratioOf);
    if (slowest == rows.end() || ratioOf(*slowest) == 0)
        return;
    const Row &row = *slowest;
    verdict.push_back(
        fmt::format("With {}, builds without micromaps take up to {:.2f} times as long ({}: {:.3f} ms instead "
                    "of {:.3f}).",
                    implementationOf(result.part), ratioOf(row), row["what"].GetString(), row["withLayer"].GetDouble(),
                    row["withoutLayer"].GetDouble()));
}

} // namespace

std::vector<std::string> verdictOf(const std::vector<PartResult> &results)
{
    std::vector<std::string> verdict;
    for (const PartResult &result : results) {
        addCheck(result, verdict);
        addFrames(result, verdict);
        addBuilds(result, verdict);
        if (!result.failure.empty())
            verdict.push_back(fmt::format("The part {} was not completed: {}.", result.part.name(), result.failure));
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
    json.member("seconds", seconds).values("verdict", verdict);
    json.list("parts", results, [&](const PartResult &result) {
        json.beginObject().member("name", result.part.name()).member("implementation", result.part.implementation);
        json.member("api", result.part.api == MicromapApi::Khr ? "khr" : "ext");
        json.member("trace", result.part.trace == Trace::Query ? "query" : "pipeline");
        json.member("failure", result.failure).member("seconds", result.seconds);
        json.list("rows", result.rows, [&](const std::string &row) { json.json(row); });
        json.end();
    });
    json.end();
    return json.text();
}

std::string benchPage(const std::string &json)
{
    std::string page(kPage_bench_html);
    const auto put = [&page](std::string_view place, const std::string &text) {
        page.replace(page.find(place), place.size(), text);
    };
    put("<!--@style-->", "<style>\n" + std::string(kPage_bench_css) + "</style>");
    put("<!--@data-->", "<script type=\"application/json\" id=\"report\">" + json + "</script>");
    put("<!--@script-->", "<script>\n\"use strict\";\n(() => {\n" + std::string(kPage_bench_js) + "})();\n</script>");
    return page;
}

} // namespace vellum::cli
