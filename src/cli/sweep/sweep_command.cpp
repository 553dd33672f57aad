// SPDX-License-Identifier: Apache-2.0
#include "cli/sweep/sweep.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <map>
#include <mutex>

#include "base/error.h"
#include "base/process.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/bake/bake.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "core/parallel.h"
#include "core/utf8_path.h"
#include "gltf/file/gltf_error.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{
namespace
{

SweptFile sweepFile(const std::filesystem::path &path, const DocumentBakeOptions &options,
                    UnmatchedExclusions &exclusions)
{
    SweptFile file;
    file.path = utf8Text(path);
    try {
        const Document document = openDocument(path);
        exclusions.note(document);
        file.result = sweepDocument(document, options);
        return file;
    } catch (const GltfError &error) {
        file.error = error.what();
    } catch (const std::bad_alloc &) {
        file.error = file.path + ": out of memory";
    } catch (const std::exception &error) {
        file.error = file.path + ": " + error.what();
    }
    exclusions.noteUnread();
    return file;
}

Sweep sweepFiles(const SweepOptions &options)
{
    Sweep sweep;
    const std::vector<std::filesystem::path> paths = gltfFiles(options.inputs);
    UnmatchedExclusions exclusions(options.bake);
    sweep.files.resize(paths.size());
    ProgressLine progress("sweeping");
    std::mutex updating;
    std::vector<double> done(paths.size());
    double all = 0;
    const auto update = [&](size_t file, double share) {
        const std::lock_guard lock(updating);
        all += share - done[file];
        done[file] = share;
        progress.update(static_cast<size_t>(1000 * all / static_cast<double>(done.size())), 1000);
    };
    const unsigned threads = threadCount(options.threads);
    DecodedImages images;
    inParallel(threads, paths.size(), [&](size_t i) {
        DocumentBakeOptions bake = options.bake;
        bake.images = &images;
        bake.bake.threads = std::max(1u, threads / static_cast<unsigned>(std::min<size_t>(threads, paths.size())));
        bake.bake.progress = [&](size_t n, size_t total) {
            update(i, static_cast<double>(n) / static_cast<double>(std::max<size_t>(total, 1)));
        };
        sweep.files[i] = sweepFile(paths[i], bake, exclusions);
        update(i, 1);
    });
    std::vector<const DocumentOutlines *> bakeable;
    for (const SweptFile &file : sweep.files)
        if (!file.result.outlines.empty())
            bakeable.push_back(&file.result);
    sweep.bakeable = bakeable.size();
    sweep.rows = rowsOf(bakeable);
    sweep.recommendation = recommend(sweep.rows, options.given);
    exclusions.print();
    return sweep;
}

} // namespace

std::string exclusionsText(const Sweep &sweep)
{
    double without = 0;
    size_t count = 0;
    std::map<std::string, size_t> reasons;
    for (const SweptFile &file : sweep.files) {
        without += file.result.withoutMicromap / static_cast<double>(std::max<size_t>(sweep.bakeable, 1));
        for (const SkippedPrimitive &skipped : file.result.skipped) {
            ++count;
            ++reasons[reasonFor(skipped)];
        }
    }
    std::string text;
    if (without > 1e-9)
        text = percent(without) + " of the alpha-tested surface gets no micromap";
    if (count == 0)
        return text;
    text += text.empty() ? "" : ": ";
    text += counted(count, "alpha-tested primitive") + " skipped (";
    for (const auto &[reason, times] : reasons)
        text += (text.ends_with('(') ? "" : ", ") + reason + (reasons.size() > 1 ? fmt::format(": {}", times) : "");
    return text + ")";
}

std::vector<std::array<std::string, 6>> tableOf(const Sweep &sweep)
{
    std::vector<std::array<std::string, 6>> table = {
        {"options", "bytes", "surface known", "approximate", "bytes per further %", "shader calls"}};
    for (const SweepRow &row : sweep.rows)
        table.push_back(
            {row.options(), row.tooLarge ? "too large" : grouped(row.bytes), percent(row.proven),
             row.setting.format == Format::TwoState ? percent(row.approximate()) : "-",
             row.bytesPerPercent ? grouped(static_cast<uint64_t>(std::max(0.0, *row.bytesPerPercent))) : "-",
             fmt::format("{:.0f}", row.shaderCalls())});
    return table;
}

void printSweep(const Sweep &sweep)
{
    fmt::print("{}\n", sweep.bakeable == 1 && sweep.files.size() == 1
                           ? sweep.files[0].path
                           : counted(sweep.bakeable, "file") + ": bytes of all, mean share of the surface");
    std::vector<std::vector<std::string>> table;
    for (const auto &cells : tableOf(sweep)) {
        table.emplace_back(cells.begin(), cells.end());
        table.back().push_back(table.size() == 1 ? "levels" : levelsText(sweep.rows[table.size() - 2].levels));
    }
    fmt::print("{}", alignedRows(table, 1, "  "));
    if (sweep.recommendation)
        fmt::print("recommended: {}: {}\n", sweep.recommendation->options, sweep.recommendation->reason);
    fmt::print("{}\n", kBytesText);
    fmt::print("{}\n", kApproximateText);
    fmt::print("{}\n", kShaderCallsText);
    if (const std::string text = exclusionsText(sweep); !text.empty())
        fmt::print("{}\n", text);
}

void printSweepJson(const Sweep &sweep, const SweepOptions &options)
{
    JsonWriter json;
    beginReport(json, "sweep");
    json.key("outputs").beginArray();
    if (options.output)
        json.value(utf8Text(*options.output));
    json.end();
    json.list("files", sweep.files, [&](const SweptFile &file) {
        json.beginObject().member("file", file.path);
        if (!file.error.empty()) {
            json.member("error", file.error).end();
            return;
        }
        json.member("measured", file.result.measured).member("withoutMicromap", file.result.withoutMicromap);
        json.list("rows", rowsOf({&file.result}), [&](const SweepRow &row) { write(row, json); });
        writeSkipped(file.result.skipped, json);
        json.end();
    });
    json.list("rows", sweep.rows, [&](const SweepRow &row) { write(row, json); });
    json.key("recommendation");
    if (sweep.recommendation)
        json.beginObject()
            .member("options", sweep.recommendation->options)
            .member("reason", sweep.recommendation->reason)
            .end();
    else
        json.null();
    fmt::print("{}\n", json.end().text());
}

int sweepCommand(const SweepOptions &options)
{
    std::optional<DataOutput> data;
    if (options.output && isStandardStream(*options.output))
        data.emplace(DataOutput::Reports::ToStderr);
    if (options.quiet && !options.json)
        discardReports();
    const Sweep sweep = sweepFiles(options);
    auto code = ExitCode::Success;
    for (const SweptFile &file : sweep.files)
        if (!file.error.empty()) {
            std::fprintf(stderr, "vellum: %s\n", file.error.c_str());
            code = ExitCode::Failed;
        }
    if (sweep.rows.empty() && code == ExitCode::Success) {
        const std::string text = exclusionsText(sweep);
        throw Error("no primitive gets a micromap" + (text.empty() ? "" : ": " + text));
    }
    if (options.output && !sweep.rows.empty())
        writeData(*options.output, suffixOf(*options.output) == ".svg" ? sweepChart(sweep) : sweepPage(sweep), data);
    if (options.json)
        printSweepJson(sweep, options);
    else if (!sweep.rows.empty())
        printSweep(sweep);
    if (options.output && !options.json && !sweep.rows.empty() && !isStandardStream(*options.output))
        fmt::print("wrote {}\n", utf8Text(*options.output));
    return static_cast<int>(code);
}

} // namespace vellum::cli
